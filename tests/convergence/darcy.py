"""Stationary flow with an oblique permeability and an exact solution (convergence/darcy): errors, orders, fluid and energy balances on
every kind of cell, in 2D and 3D, and the same on 1, 2 and 3 ranks."""

import unittest
from pathlib import Path

from scene_runs import Run, rate

SCENES = Path(__file__).parent / "darcy"

# scene, shape: cells along an edge, errors of pressure and flux there
COARSE = {
    ("plane", "quads"): (16, 1.9851e-3, 6.1504e-2),
    ("plane", "triangles"): (16, 4.7296e-3, 7.5580e-2),
    ("plane", "polygons"): (16, 2.6862e-3, 6.2040e-2),
    ("solid", "hexahedra"): (8, 4.2065e-3, 1.2982e-1),
    ("solid", "tets"): (8, 1.5655e-3, 1.0150e-1),
    ("solid", "polyhedra"): (8, 5.6457e-3, 1.3216e-1),
}


def run(scene, shape, n, ranks=1):
    cells = ",".join([str(n)] * (2 if scene == "plane" else 3))
    return Run(SCENES / f"{scene}.yaml", {"mesh.box.shape": shape, "mesh.box.cells": f"[{cells}]"}, ranks)


class Darcy(unittest.TestCase):
    def test_pressures_have_order_two_and_fluxes_order_one(self):
        for (scene, shape), (n, pressure, flux) in COARSE.items():
            with self.subTest(shape=shape):
                coarse, fine = run(scene, shape, n), run(scene, shape, 2 * n)
                self.assertAlmostEqual(coarse.errors["pressure_l2"] / pressure, 1, delta=1e-3)
                self.assertAlmostEqual(coarse.errors["flux_l2"] / flux, 1, delta=1e-3)
                self.assertGreater(rate(coarse.errors["pressure_l2"], fine.errors["pressure_l2"]), 1.9)
                self.assertGreater(rate(coarse.errors["flux_l2"], fine.errors["flux_l2"]), 0.95)
                for done in (coarse, fine):
                    self.assertLess(done.summary["balance"]["mass_error_max"], 1e-12)
                    self.assertLess(done.summary["balance"]["energy_violation_max"], 1e-12)

    def test_there_is_nothing_of_rock_where_only_fluid_is_computed(self):
        summary = run("plane", "quads", 4).summary
        self.assertEqual(summary["dofs"], {"displacement_nodal": 0, "displacement_bubble": 0, "multiplier": 0, "pressure": 56, "total": 56,
                                           "solved": 56})
        self.assertIsNone(summary["extremes"]["max_slip"])
        self.assertAlmostEqual(summary["extremes"]["mean_pressure"], 0.6767, delta=0.03)

    def test_results_do_not_depend_on_the_rank_count(self):
        for scene, shape in (("plane", "polygons"), ("solid", "tets")):
            one = run(scene, shape, 4)
            for ranks in (2, 3):
                with self.subTest(shape=shape, ranks=ranks):
                    other = run(scene, shape, 4, ranks)
                    self.assertEqual(other.summary["dofs"], one.summary["dofs"])
                    for part in ("errors", "extremes"):
                        for name, value in one.summary[part].items():
                            if value is not None:
                                self.assertAlmostEqual(other.summary[part][name], value, delta=1e-9 * abs(value), msg=name)


if __name__ == "__main__":
    unittest.main()
