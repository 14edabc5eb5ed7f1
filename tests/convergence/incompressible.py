"""Bubbles on all faces where volumes cannot change: undrained rock and nearly incompressible solids against exact solutions
(convergence/incompressible) on every kind of cell, by factorisation and by multigrid, on one rank and on two."""

import unittest
from pathlib import Path

from scene_runs import Run, rate

SCENES = Path(__file__).parent / "incompressible"

# scene, shape: cells along an edge, errors of displacement and pressure there
COARSE = {
    ("plane", "quads"): (16, 1.16154e-2, 7.06814e-2),
    ("plane", "triangles"): (16, 6.41862e-3, 1.45051e-1),
    ("plane", "polygons"): (16, 8.90615e-3, 7.24853e-2),
    ("solid", "hexahedra"): (4, 1.35331e-1, 1.06275),
    ("solid", "tets"): (4, 1.54101e-1, 9.56432),
}


def run(scene, shape, n, bubbles="all", **more):
    cells = ",".join([str(n)] * (3 if scene == "solid" else 2))
    return Run(SCENES / f"{scene}.yaml", {"mesh.box.shape": shape, "mesh.box.cells": f"[{cells}]", "mechanics.bubbles": bubbles}, **more)


class Incompressible(unittest.TestCase):
    def test_undrained_displacements_and_pressures_converge_on_every_shape(self):
        for (scene, shape), (n, displacement, pressure) in COARSE.items():
            with self.subTest(scene=scene, shape=shape):
                coarse, fine = run(scene, shape, n).errors, run(scene, shape, 2 * n).errors
                self.assertAlmostEqual(coarse["displacement_l2"] / displacement, 1, delta=1e-3)
                self.assertAlmostEqual(coarse["pressure_l2"] / pressure, 1, delta=1e-3)
                self.assertGreater(rate(coarse["displacement_l2"], fine["displacement_l2"]), 1.5 if scene == "solid" else 1.8)
                self.assertGreater(rate(coarse["pressure_l2"], fine["pressure_l2"]), 1)

    def test_bubbles_on_fracture_faces_alone_leave_triangles_locked(self):
        locked, free = run("elastic", "triangles", 16, "fracture").errors, run("elastic", "triangles", 16).errors
        self.assertGreater(locked["displacement_l2"], 0.3)
        self.assertAlmostEqual(free["displacement_l2"] / 6.30521e-3, 1, delta=1e-3)

    def test_fixed_stress_takes_few_iterations_where_rock_and_fluid_are_incompressible(self):
        direct, split = (run("solid", "hexahedra", 8, options=("-coupled_pc_type", pc, "-coupled_ksp_rtol", "1e-8", "-coupled_loose_rtol", "0"))
                         for pc in ("lu", "fieldsplit"))
        self.assertLessEqual(split.summary["krylov"]["max_per_solve"], 40)
        for name, value in direct.errors.items():
            self.assertAlmostEqual(split.errors[name] / value, 1, delta=1e-4)

    def test_results_do_not_depend_on_the_rank_count(self):
        for scene, shape in (("plane", "polygons"), ("solid", "tets"), ("elastic", "triangles")):
            with self.subTest(scene=scene):
                one, two = run(scene, shape, 4), run(scene, shape, 4, ranks=2)
                self.assertEqual(two.summary["dofs"], one.summary["dofs"])
                for name, value in one.errors.items():
                    self.assertAlmostEqual(two.errors[name] / value, 1, delta=1e-7)


if __name__ == "__main__":
    unittest.main()
