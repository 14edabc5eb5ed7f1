"""Published benchmarks of flow in fractured rock (scenes in convergence/fracture_flow): profiles of the pressure and fluxes against
reference solutions and against HFV with discontinuous pressures on equally fine meshes.

Data: the folder POLYSLIP_DATA (default: shared/data beside the checkout). Finer meshes are made by Gmsh, which the first call of
scripts/mesh_network installs into .venv. Tests that miss something are skipped.
    python3 tests/convergence/fracture_flow.py --study [CASE]...
goes on to finer meshes and prints the figures of the README, for all cases or those named (regular, complex, single,
small_features).
"""

import bisect
import csv
import functools
import math
import os
import statistics
import subprocess
import sys
import tempfile
import unittest
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests/support"))
from scene_runs import Run  # noqa: E402  (found by the line above without CTest)

SCENES = Path(__file__).parent / "fracture_flow"
DATA = Path(os.environ.get("POLYSLIP_DATA", ROOT.parent / "shared/data"))
PLANE = DATA / "fractures_2d/flemisch2018"
SOLID = DATA / "fractures_3d"
RESULTS = SOLID / "results"
VENV = ROOT / ".venv"


# ---------------------------------------------------------------------------------------------------------- references


def rows(file):
    """The rows of numbers of a csv file; Fortran writes 1D-3."""
    with open(file, newline="") as table:
        for row in csv.reader(table):
            try:
                yield [float(entry.replace("D", "e")) for entry in row]
            except ValueError:
                continue  # the header


def points_reference(file):
    """(distance, head) of a 2D reference, whose points are in the columns Points:0 and Points:1."""
    with open(file, newline="") as table:
        header = next(csv.reader(table))
    at = [header.index(f"Points:{axis}") for axis in (0, 1)]
    table = list(rows(file))
    start = [table[0][column] for column in at]
    return [(math.dist(start, [row[column] for column in at]), row[0]) for row in table]


def arc_reference(file):
    """(distance, head) of a 3D one."""
    return [(row[0], row[1]) for row in rows(file)]


# ---------------------------------------------------------------------------------------------------------- comparison


@dataclass
class Deviation:
    """Of a profile from a reference, in units of the reference's range."""

    rms: float
    largest: float
    left_out: float  # part of the reference's points in a jump across a fracture


def deviation(profile, reference):
    """`profile` is a table with distance and pressure, linear between its points; a jump of 2 % of the range between two of them is one
    across a fracture, where values depend on the place of the point within the aperture."""
    s, p = profile["distance"], profile["pressure"]
    heads = [head for _, head in reference]
    span = max(heads) - min(heads)
    errors = []
    for distance, head in reference:
        k = min(max(bisect.bisect_right(s, distance), 1), len(s) - 1)
        if abs(p[k] - p[k - 1]) > 0.02 * span:
            continue
        t = (distance - s[k - 1]) / (s[k] - s[k - 1])
        errors.append(((1 - t) * p[k - 1] + t * p[k] - head) / span)
    rms = math.sqrt(sum(error**2 for error in errors) / len(errors))
    return Deviation(rms, max(map(abs, errors)), 1 - len(errors) / len(reference))


def averaged(table, width):
    """Means of a profile, (distance, head), over pieces of the line: what is left of it without the scatter within a cell."""
    distances = [s for s, _ in table]
    pieces = [(bisect.bisect_left(distances, s - width / 2), bisect.bisect_right(distances, s + width / 2)) for s in distances]
    return [(s, statistics.fmean(head for _, head in table[first:last])) for s, (first, last) in zip(distances, pieces)]


def deviation_of_means(profile, reference, width):
    """Rms deviation of the averaged profile from the averaged reference, in units of the latter's range."""
    ours = averaged(list(zip(profile["distance"], profile["pressure"])), width)
    theirs = averaged(reference, width)
    return deviation({"distance": [s for s, _ in ours], "pressure": [head for _, head in ours]}, theirs).rms


def difference_of_references(file, other):
    """Deviation of one reference from another."""
    table = arc_reference(file)
    return deviation({"distance": [s for s, _ in table], "pressure": [head for _, head in table]}, arc_reference(other))


# -------------------------------------------------------------------------------------------------------------- runs


@functools.cache
def run(scene, *settings):
    return Run(SCENES / f"{scene}.yaml", dict(settings))


def regular(n, k=1e4):
    return run("regular", ("mesh.box.cells", f"[{n},{n}]"), ("study.k", k))


def complex_network(mesh, side=0, barriers=True):
    tight = "true" if barriers else "false"
    return run("complex", ("mesh.file", mesh), ("study.side", side), *((f"flow.fractures.fractures[{i}].barrier", tight) for i in (0, 1)))


def single(mesh):
    return run("single", ("mesh.file", mesh))


def small_features(mesh):
    return run("small_features", ("mesh.file", mesh))


REGULAR = (
    ("horizontal", 1e4, "mfd_geiger_conductive_y_eq_0.7.csv"),
    ("vertical", 1e4, "mfd_geiger_conductive_x_eq_0.5.csv"),
    ("oblique", 1e-4, "mfd_geiger_blocking_0_0.1_to_0.9_1.csv"),
)
COMPLEX = ((0, "REF_0p50p9.csv"), (1, "REF_0p50p9LR.csv"))
LINES = (("upright", "dol_line_0"), ("across", "dol_line_1"))


def regular_reference(name):
    return points_reference(PLANE / "case1_regular" / name)


def complex_reference(name):
    return points_reference(PLANE / "case3_complex" / name)


def single_reference(scheme, refinement):
    return RESULTS / "single_fracture" / scheme / f"dol_refinement_{refinement}.csv"


def small_features_reference(scheme, line, refinement):
    return RESULTS / "small_features" / scheme / f"{line}_refinement_{refinement}.csv"


HFV, MPFA = "UNICE_UNIGE/HFV_Disc", "USTUTT/MPFA"
SINGLE_MESHES = ((9, 6), (19, 11), (43, 20))  # of HFV_Disc, refinements 0, 1, 2: 1134, 10108, 103544 cells


def published_fluxes(refinement):
    """Outflow of the lower and upper outlet and mean head at the inlet by HFV_Disc."""
    return list(rows(RESULTS / f"small_features/{HFV}/results.csv"))[refinement][-3:]


def computed_fluxes(done):
    return [done.history[column][-1] for column in ("lower_outlet_outflow", "upper_outlet_outflow", "inlet_pressure")]


# -------------------------------------------------------------------------------------------------------------- tests


HAS_GMSH = (VENV / "installed_mesh_requirements.txt").exists()


class FractureFlow(unittest.TestCase):
    """The bounds are what is measured, rounded up."""

    def assert_close(self, profile, reference, rms):
        met = deviation(profile, reference)
        self.assertLess(met.rms, rms)
        self.assertLess(met.left_out, 0.05)

    def assert_balanced(self, done):
        self.assertLess(done.summary["balance"]["mass_error_max"], 1e-10)

    @unittest.skipUnless(PLANE.exists(), f"no data in {PLANE}")
    def test_a_regular_network_conductive_and_blocking(self):
        for (line, k, file), rms in zip(REGULAR, (0.0005, 0.0025, 0.0002)):
            with self.subTest(line=line, k=k):
                done = regular(64, k)
                self.assert_close(done.lines[line], regular_reference(file), rms)
                self.assert_balanced(done)
                self.assertAlmostEqual(done.history["outlet_outflow"][-1], 1, delta=1e-9)

    @unittest.skipUnless(PLANE.exists(), f"no data in {PLANE}")
    def test_b_complex_network_wants_its_barriers_to_interrupt_the_fractures_that_they_cross(self):
        mesh = PLANE / "case3_complex/complex.msh"
        for (side, file), rms in zip(COMPLEX, (0.008, 0.008)):
            with self.subTest(side=side):
                done, passed = complex_network(mesh, side), complex_network(mesh, side, barriers=False)
                self.assert_close(done.lines["oblique"], complex_reference(file), rms)
                self.assertGreater(deviation(passed.lines["oblique"], complex_reference(file)).rms, 0.025)
                self.assert_balanced(done)

    @unittest.skipUnless(PLANE.exists() and HAS_GMSH, f"no data in {PLANE}, or no Gmsh")
    def test_c_complex_network_on_a_fine_mesh(self):
        with tempfile.TemporaryDirectory() as directory:
            mesh = complex_mesh(directory, 0.02)
            for side, file in COMPLEX:
                with self.subTest(side=side):
                    self.assert_close(complex_network(mesh, side).lines["oblique"], complex_reference(file), 0.005)

    @unittest.skipUnless(SOLID.exists() and HAS_GMSH, f"no data in {SOLID}, or no Gmsh")
    def test_d_single_fracture_in_layered_rock_is_that_of_the_same_scheme_on_the_same_mesh(self):
        with tempfile.TemporaryDirectory() as directory:
            for refinement, rms in ((0, 0.005), (1, 0.002)):
                with self.subTest(refinement=refinement):
                    done = single(single_mesh(directory, *SINGLE_MESHES[refinement]))
                    self.assert_close(done.lines["diagonal"], arc_reference(single_reference(HFV, refinement)), rms)
                    self.assert_balanced(done)

    @unittest.skipUnless(SOLID.exists(), f"no data in {SOLID}")
    def test_e_small_features_on_the_mesh_of_the_benchmark(self):
        done = small_features(SOLID / "case3_small_features/gmsh.msh")
        for (line, file), rms in zip(LINES, (0.0075, 0.025)):
            with self.subTest(line=line):
                self.assert_close(done.lines[line], arc_reference(small_features_reference(HFV, file, 0)), rms)
        for met, published in zip(computed_fluxes(done), published_fluxes(0)):
            self.assertAlmostEqual(met / published, 1, delta=0.003)
        self.assertAlmostEqual(sum(computed_fluxes(done)[:2]), 1 / 3, delta=1e-6)  # the digits of the mesh's coordinates
        self.assert_balanced(done)


# -------------------------------------------------------------------------------------------------------------- study


def complex_mesh(directory, size):
    file = Path(directory) / f"complex_{size}.msh"
    subprocess.run([ROOT / "scripts/mesh_network", SCENES / "complex.yaml", "-o", file, "--size", str(size), "--box", "0", "0", "1", "1"],
                   check=True, stdout=subprocess.DEVNULL)
    return file


def geometry_mesh(directory, geometry, name, *options):
    file = Path(directory) / f"{name}.msh"
    subprocess.run([VENV / "bin/python", SCENES / "mesh_geometry.py", geometry, "-o", file, *options], check=True)
    return file


def single_mesh(directory, n, layers):
    """Hexahedra, n along x and y; `layers` are the vertices of each layer along z in the words of the geometry."""
    numbers = {"numPointsX": n + 1, "numPointsY": n + 1, **{f"numPointsZ_layer{name}": layers for name in ("1", "2_below", "2_above")}}
    options = [word for name, value in numbers.items() for word in ("--number", f"{name}={value}")]
    return geometry_mesh(directory, SOLID / "case1_single/gmsh.geo", f"single_{n}", *options)


def show(case, mesh, done, **figures):
    words = "  ".join(f"{name} {value}" for name, value in figures.items())
    summary = done.summary
    print(f"{case:24} {mesh:28} {summary['mesh']['cells']:7} cells  {words}  mass {summary['balance']['mass_error_max']:.0e}"
          f"  {summary['seconds']['total']:.1f} s", flush=True)


def percent(met):
    return f"{100 * met.rms:.3f} % (max {100 * met.largest:.2f} %, {100 * met.left_out:.1f} % left out)"


def study_regular(_):
    for n in (32, 64, 128, 256):
        for line, k, file in REGULAR:
            done = regular(n, k)
            show(f"regular {line} k={k:g}", f"quads {n} x {n}", done, reference=percent(deviation(done.lines[line], regular_reference(file))))


def study_complex(directory):
    for size in (None, 0.02, 0.01, 0.005):
        mesh = complex_mesh(directory, size) if size else PLANE / "case3_complex/complex.msh"
        for side, file in COMPLEX:
            for barriers in (True, False):
                done = complex_network(mesh, side, barriers)
                show(f"complex {'left-right' if side else 'top-bottom'}", f"{mesh.name}{'' if barriers else ' no barrier'}", done,
                     reference=percent(deviation(done.lines["oblique"], complex_reference(file))))


def study_single(directory):
    meshes = [SOLID / "case1_single/gmsh.msh", *(single_mesh(directory, n, layers) for n, layers in SINGLE_MESHES)]
    for refinement, mesh in zip((0, 0, 1, 2), meshes):
        done = single(mesh)
        profile = done.lines["diagonal"]
        show("single", mesh.name, done, refinement=refinement,
             HFV_Disc=percent(deviation(profile, arc_reference(single_reference(HFV, refinement)))),
             MPFA=percent(deviation(profile, arc_reference(single_reference(MPFA, refinement)))),
             finest_MPFA=percent(deviation(profile, arc_reference(single_reference(MPFA, 5)))))
        print("  HFV_Disc from the finest MPFA:",
              percent(difference_of_references(single_reference(HFV, refinement), single_reference(MPFA, 5))))


def study_small_features(directory):
    """The sizes give 4321 and 7705 fracture faces, 31837 and 150933 tets; HFV_Disc had 4321 and 7711, 31870 and 150083."""
    geometry = SOLID / "case3_small_features/gmsh.geo"
    meshes = [(0, geometry.with_suffix(".msh")), (0, geometry_mesh(directory, geometry, "gmsh_0")),
              (1, geometry_mesh(directory, geometry, "gmsh_1", "--largest", "0.0425"))]
    for refinement, mesh in meshes:
        done = small_features(mesh)
        print("outflow low, high, inlet head:", *(f"{value:.6f}" for value in computed_fluxes(done)),
              " HFV_Disc:", *published_fluxes(refinement))
        for line, file in LINES:
            met = {f"{scheme}_{level}": percent(deviation(done.lines[line], arc_reference(small_features_reference(scheme, file, level))))
                   for scheme, level in ((HFV, refinement), (MPFA, refinement), (MPFA, 5))}
            means = deviation_of_means(done.lines[line], arc_reference(small_features_reference(HFV, file, refinement)), 0.02)
            show(f"small features {line}", mesh.name, done, refinement=refinement, **met, means_over_0_02=f"{100 * means:.3f} %")
            spread = difference_of_references(small_features_reference(HFV, file, refinement), small_features_reference(MPFA, file, refinement))
            print("  HFV_Disc from MPFA as fine:", percent(spread))


STUDIES = {"regular": study_regular, "complex": study_complex, "single": study_single, "small_features": study_small_features}


def study(cases):
    with tempfile.TemporaryDirectory() as directory:
        for case in cases or STUDIES:
            STUDIES[case](directory)


if __name__ == "__main__":
    os.environ.setdefault("POLYSLIP", str(ROOT / "build/release/polyslip"))  # as CTest sets them
    os.environ.setdefault("POLYSLIP_EXAMPLES", str(ROOT / "examples"))
    if "--study" in sys.argv:
        study(sys.argv[sys.argv.index("--study") + 1 :])
    else:
        unittest.main()
