"""Frictionless contact with an exact solution in 3D (examples/manufactured_contact_3d): errors and orders on every kind of cell."""

import unittest

from scene_runs import Run, rate

NAMES = ("displacement_l2", "gradient_l2", "multiplier_normal_l2", "jump_normal_l2")
STABILISATION = {"mechanics.stabilisation": "2mu+lambda"}  # that of the reference figures


def errors(shape, n):
    return Run("manufactured_contact_3d", {"mesh.box.cells": f"[{n},{n},{n}]", "mesh.box.shape": shape, **STABILISATION}).errors


class ManufacturedContact(unittest.TestCase):
    def test_errors_on_cubes_agree_with_an_independent_implementation_in_three_digits(self):
        reference = {4: (0.26448, 0.48307, 0.48270, 0.79667), 8: (9.8817e-2, 0.25603, 0.22295, 0.36193)}
        for n, values in reference.items():
            found = errors("hexahedra", n)
            for name, value in zip(NAMES, values):
                with self.subTest(n=n, name=name):
                    self.assertAlmostEqual(found[name] / value, 1, delta=5e-4)

    # Errors at n = 8 and orders from n = 4 to 8, and to 16 for tets: bounds just above the errors, windows for the orders. Before
    # the asymptotic range displacements fall with less than order 2; lam_n on Voronoi cells with their tiny faces is the slowest.
    BOUNDS = {
        "tets": (0.070, 0.265, 0.263, 0.387),
        "prisms": (0.130, 0.279, 0.269, 0.379),
        "polyhedra": (0.133, 0.278, 0.330, 0.413),
        "warped": (0.110, 0.271, 0.270, 0.378),
        "cut": (0.113, 0.274, 0.293, 0.376),
    }
    ORDERS = {  # (least, most) for each of NAMES
        "tets": ((1.65, 2.0), (0.88, 1.1), (1.0, 1.3), (1.0, 1.4)),
        "prisms": ((1.2, 2.0), (0.86, 1.1), (1.0, 1.7), (1.0, 1.4)),
        "polyhedra": ((1.1, 2.0), (0.84, 1.1), (0.6, 1.3), (1.0, 1.4)),
        "warped": ((1.3, 2.0), (0.86, 1.1), (1.0, 1.4), (1.0, 1.4)),
        "cut": ((1.3, 2.0), (0.86, 1.1), (1.0, 1.4), (1.0, 1.4)),
    }

    def assert_orders(self, shape, coarse, fine):
        for name, (least, most) in zip(NAMES, self.ORDERS[shape]):
            with self.subTest(shape=shape, name=name):
                order = rate(coarse[name], fine[name])
                self.assertGreaterEqual(order, least)
                self.assertLessEqual(order, most)

    def test_errors_and_orders_on_other_cells_keep_within_their_windows(self):
        for shape, bounds in self.BOUNDS.items():
            coarse, fine = errors(shape, 4), errors(shape, 8)
            for name, bound in zip(NAMES, bounds):
                with self.subTest(shape=shape, name=name):
                    self.assertLessEqual(fine[name], bound)
            self.assert_orders(shape, coarse, fine)
            if shape == "tets":
                finest = errors(shape, 16)
                self.assert_orders(shape, fine, finest)
                self.assertGreater(rate(fine["displacement_l2"], finest["displacement_l2"]), 1.8)


if __name__ == "__main__":
    unittest.main()
