"""Three crossing fractures in wet rock (examples/poromechanics_3d), by fixed stress on one and two ranks: what Newton needs, and books that
close to the end, when hardly anything moves."""

import unittest

from scene_runs import Run


class Poromechanics3d(unittest.TestCase):
    def test_every_step_is_solved_in_few_iterations_and_its_books_close(self):
        one, two = Run("poromechanics_3d"), Run("poromechanics_3d", ranks=2)
        for run in (one, two):
            self.assertEqual(run.summary["steps"], {"accepted": 20, "rejected": 0})
            self.assertLessEqual(run.summary["newton"]["total"], 70)
            self.assertLessEqual(run.summary["newton"]["max_per_step"], 10)
            self.assertLess(run.summary["balance"]["mass_error_max"], 1e-9)
            self.assertLess(run.summary["balance"]["energy_violation_max"], 1e-9)
            self.assertLess(abs(run.history["outflow_volume"][-1]), 1e-9 * max(map(abs, run.history["outflow_volume"])))
        for name in ("max_slip", "slip_integral", "opening_integral"):
            self.assertAlmostEqual(two.history[name][-1] / one.history[name][-1], 1, delta=1e-7)
        self.assertAlmostEqual(one.history["max_slip"][-1] / 1.5598e-3, 1, delta=1e-3)


if __name__ == "__main__":
    unittest.main()
