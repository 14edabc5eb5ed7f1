"""examples/single_crack with N = 20 against stored tables."""

import unittest
from pathlib import Path

from scene_runs import Run
from stored_tables import StoredTables

STORED = Path(__file__).parent / "single_crack"

# column: (relative, absolute) tolerance
HISTORY = {
    "step": (0, 0), "time": (1e-14, 0), "step_size": (1e-14, 0), "newton": (0, 0), "krylov": (0, 6),
    "open": (0, 0), "stick": (0, 0), "slip": (0, 0), "max_slip": (1e-7, 0), "max_opening": (0, 1e-12),
    "slip_integral": (1e-7, 0), "opening_integral": (0, 1e-12),
    "slipped_area": (1e-12, 0), "seismic_moment": (1e-7, 0),
}
NEWTON = {
    "step": (0, 0), "iteration": (0, 0), "residual_momentum": (1e-5, 1e-9), "residual_contact": (1e-5, 1e-9),
    "open": (0, 0), "stick": (0, 0), "slip": (0, 0), "changed": (0, 0), "step_length": (0, 0), "krylov": (0, 3), "window_steps": (0, 0),
}


class SingleCrack(StoredTables):
    @classmethod
    def setUpClass(cls):
        cls.run_ = Run("single_crack", {"study.n": 20})

    def test_history_has_not_moved(self):
        self.assertEqual(set(self.run_.history), set(HISTORY), "every column has a tolerance")
        self.assert_like_stored(STORED / "history.csv", self.run_.history, HISTORY)

    def test_newton_iterations_have_not_moved(self):
        self.assertEqual(set(self.run_.newton), set(NEWTON), "every column has a tolerance")
        self.assert_like_stored(STORED / "newton.csv", self.run_.newton, NEWTON)


if __name__ == "__main__":
    unittest.main()
