"""A network under compression and shear (examples/six_fractures) against published values and those of an independent finite volume code."""

import unittest

from scene_runs import Run

PUBLISHED = {"max_slip": 1.0589e-3, "max_opening": 2.136e-4}  # static; nodal values
# Poroelastic, at the end: finite volumes on 30933 triangles, and its Newton iterations on the coarser 7979
INDEPENDENT = {"slip_integral": 1.1291e-3, "opening_integral": 4.776e-5, "max_slip": 1.7113e-3}
INDEPENDENT_NEWTON = 142


class SixFractures(unittest.TestCase):
    def test_largest_slip_and_opening_are_those_published(self):
        run = Run("six_fractures")
        for name, value in PUBLISHED.items():
            with self.subTest(name=name):
                self.assertAlmostEqual(run.summary["extremes"][name] / value, 1, delta=0.02)
        self.assertLessEqual(run.summary["newton"]["total"], 15)

    def test_integrals_of_slip_and_opening_approach_those_of_fine_meshes(self):
        history = Run("six_fractures").history
        self.assertAlmostEqual(history["slip_integral"][-1] / 8.705e-4, 1, delta=0.015)
        self.assertAlmostEqual(history["opening_integral"][-1] / 3.716e-5, 1, delta=0.015)

    def test_the_poroelastic_case_agrees_with_an_independent_code_in_two_per_cent(self):
        run = Run("six_fractures/scene_poroelastic.yaml")
        for name, value in INDEPENDENT.items():
            with self.subTest(name=name):
                self.assertAlmostEqual(run.history[name][-1] / value, 1, delta=0.02)
        self.assertEqual(run.summary["steps"]["rejected"], 0)
        self.assertLess(run.summary["newton"]["total"], 0.7 * INDEPENDENT_NEWTON)


if __name__ == "__main__":
    unittest.main()
