"""Rigid motions and linear displacements are exact on published meshes.

Data: the folder POLYSLIP_DATA (default: shared/data beside the checkout); without it the test is skipped.
    python3 tests/stress/real_mesh_exactness.py --all
takes meshes of more than MOST_CELLS cells too. Each mesh's errors are printed.
"""

import json
import os
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests/support"))
import real_meshes  # noqa: E402
from scene_runs import Run  # noqa: E402  (found by the line above without CTest)

DATA = Path(os.environ.get("POLYSLIP_DATA", ROOT.parent / "shared/data"))
MOST_CELLS = 400
NO_MESH = {"mesh5.typ2": "an older format in a file of this name", "reek_sim_faults.grdecl": "names of faults, no grid"}
# A turn: skew to first order. A squeeze with shear: all entries differ.
GRADIENTS = {"rigid": ((0, 2e-3, -1e-3), (-2e-3, 0, 3e-3), (1e-3, -3e-3, 0)),
             "linear": ((-1e-3, 2e-4, 3e-4), (1e-4, -1.1e-3, -2e-4), (5e-4, 4e-4, -9e-4))}


def scene(d, file, gradient, centre, size):
    displacement = [f"{0.01 * size!r} + " + " + ".join(f"({g!r})*({axis} - ({c!r}))" for g, axis, c in zip(row, "xyz", centre))
                    for row in gradient[:d]]
    return {"name": "exactness", "mesh": {"file": file}, "materials": [{"young": 1e9, "poisson": 0.25}],
            "mechanics": {"boundary": [{"on": "all", "displacement": displacement}]},
            "exact": {"displacement": displacement, "gradient": [row[:d] for row in gradient[:d]]}, "output": {"every": 1000}}


def box(nodes):
    low, high = ([f(x[axis] for x in nodes) for axis in range(3)] for f in (min, max))
    return [(a + b) / 2 for a, b in zip(low, high)], max(b - a for a, b in zip(low, high))


def errors(path, kind):
    """Of displacement and gradient; the mesh is read by the program itself where it can."""
    with tempfile.TemporaryDirectory() as folder:
        mesh, name = real_meshes.read(path), "mesh.h5"
        if mesh:
            d, (centre, size) = mesh.dim, box(mesh.nodes)
            if d == 2 and any(x[2] for x in mesh.nodes):
                return None  # a surface in space
            mesh.write(Path(folder) / name)
        else:
            d, centre, size, name = 2 if "2d" in str(path.relative_to(DATA)) else 3, [0.5] * 3, 1, str(path)
        file = Path(folder) / "scene.yaml"
        file.write_text(json.dumps(scene(d, name, GRADIENTS[kind], centre, size)), encoding="utf-8")
        return Run(file, options=("-snes_rtol", "1e-13")).errors


def is_small(path):
    """By the size of the file: some 100 bytes a cell."""
    return path.stat().st_size < 3e2 * MOST_CELLS


@unittest.skipUnless(DATA.is_dir(), f"no data in {DATA}: set POLYSLIP_DATA to the folder of the meshes")
class RealMeshExactness(unittest.TestCase):
    def test_rigid_motions_and_linear_displacements(self):
        tried = 0
        for path in (real_meshes.files(DATA) if "--all" in ARGUMENTS else filter(is_small, real_meshes.files(DATA))):
            if path.name in NO_MESH:
                continue
            for kind in GRADIENTS:
                with self.subTest(mesh=str(path.relative_to(DATA)), displacement=kind):
                    found = errors(path, kind)
                    if found is None:
                        continue
                    tried += 1
                    print(f"{path.relative_to(DATA)}, {kind}: displacement {found['displacement_l2']:.1e}, "
                          f"gradient {found['gradient_l2']:.1e}", flush=True)
                    self.assertLess(found["displacement_l2"], 1e-9)
                    self.assertLess(found["gradient_l2"], 1e-7)
        self.assertGreater(tried, 0, f"no mesh in {DATA}")


ARGUMENTS = [word for word in sys.argv[1:] if word == "--all"]
if __name__ == "__main__":
    os.environ.setdefault("POLYSLIP", str(ROOT / "build/release/polyslip"))  # as CTest sets them
    os.environ.setdefault("POLYSLIP_EXAMPLES", str(ROOT / "examples"))
    unittest.main(argv=[word for word in sys.argv if word not in ARGUMENTS])
