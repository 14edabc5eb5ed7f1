"""examples/poromechanics_2d on its mesh: the history against a stored one, the books, and the same on two ranks."""

import unittest
from pathlib import Path

from scene_runs import Run
from stored_tables import StoredTables

STORED = Path(__file__).parent / "poromechanics_2d"

# column: (relative, absolute) tolerance
HISTORY = {
    "step": (0, 0), "time": (1e-14, 0), "open": (0, 1), "stick": (0, 1), "slip": (0, 1),
    "max_slip": (1e-6, 0), "max_opening": (1e-6, 0), "slip_integral": (1e-6, 0), "opening_integral": (1e-6, 0),
    "stored_volume": (1e-6, 0), "outflow_volume": (1e-6, 0), "fluid_energy": (1e-6, 0),
    "dissipated_matrix": (1e-6, 0), "dissipated_interface": (1e-6, 1e-9), "dissipated_fracture": (1e-6, 0),
    "work": (1e-6, 1e-3), "elastic_energy": (1e-6, 0), "min_pressure": (1e-6, 0), "mean_pressure": (1e-6, 0), "max_pressure": (1e-6, 0),
}


class Poromechanics2d(StoredTables):
    @classmethod
    def setUpClass(cls):
        cls.run_ = Run("poromechanics_2d")

    def test_history_has_not_moved(self):
        self.assert_like_stored(STORED / "history.csv", self.run_.history, HISTORY)

    def test_no_step_fails_and_newton_takes_few_iterations(self):
        steps, newton = self.run_.summary["steps"], self.run_.summary["newton"]
        self.assertEqual((steps["accepted"], steps["rejected"]), (20, 0))
        self.assertLessEqual(newton["total"], 2 * 20)
        self.assertLessEqual(newton["max_per_step"], 10)

    def test_fluid_is_conserved_and_energy_not_made(self):
        self.assertLess(self.run_.summary["balance"]["mass_error_max"], 1e-9)
        self.assertLess(self.run_.summary["balance"]["energy_violation_max"], 1e-9)

    def test_recipes_of_options_give_the_same_and_are_used_whole(self):
        options = Path(__file__).parents[2] / "options"
        for recipe in ("fixed_stress_amg", "fixed_stress_flat", "sequential"):
            with self.subTest(recipe=recipe):
                run = Run("poromechanics_2d", options=("-options_file", str(options / f"{recipe}.opts"), "-coupled_mistaken", "1"))
                warnings = [line for line in run.log.splitlines() if "was not used" in line]
                self.assertEqual(len(warnings), 1, warnings)
                self.assertIn("-coupled_mistaken 1", warnings[0])
                self.assertAlmostEqual(run.history["slip_integral"][-1] / self.run_.history["slip_integral"][-1], 1, delta=1e-6)

    def test_two_ranks_compute_the_same(self):
        self.assert_like(Run("poromechanics_2d", ranks=2).history, self.run_.history, HISTORY)
        # Multigrid differs between ranks, and so do solves that Newton cuts short; factorisations do not.
        one, two = (Run("poromechanics_2d", ranks=ranks, options=("-coupled_pc_type", "lu")) for ranks in (1, 2))
        self.assertEqual(two.summary["newton"]["max_per_step"], one.summary["newton"]["max_per_step"])
        self.assert_like(two.history, one.history, HISTORY)


if __name__ == "__main__":
    unittest.main()
