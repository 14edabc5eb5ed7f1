"""examples/single_crack with N = 20 against stored tables, with a tolerance for each column.

After a change that is meant to move these figures, run with UPDATE=1 in the environment and justify the new tables in the commit.
"""

import csv
import os
import unittest
from pathlib import Path

from scene_runs import Run, read_table

STORED = Path(__file__).parent / "single_crack"

# column: (relative, absolute) tolerance
HISTORY = {
    "step": (0, 0), "time": (1e-14, 0), "step_size": (1e-14, 0), "newton": (0, 0), "krylov": (0, 6),
    "open": (0, 0), "stick": (0, 0), "slip": (0, 0), "max_slip": (1e-7, 0), "max_opening": (0, 1e-12),
    "slip_integral": (1e-7, 0), "opening_integral": (0, 1e-12),
}
NEWTON = {
    "step": (0, 0), "iteration": (0, 0), "residual_momentum": (1e-5, 1e-9), "residual_contact": (1e-5, 1e-9),
    "open": (0, 0), "stick": (0, 0), "slip": (0, 0), "changed": (0, 0), "step_length": (0, 0), "krylov": (0, 3),
}


def write_table(path, table):
    with open(path, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*([f"{value:.12g}" for value in column] for column in table.values())))


class SingleCrack(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        run = Run("single_crack", {"study.n": 20})
        cls.found = {"history": run.history, "newton": run.newton}
        if os.environ.get("UPDATE"):
            for name, table in cls.found.items():
                write_table(STORED / f"{name}.csv", table)

    def assert_like_stored(self, name, tolerances):
        stored, found = read_table(STORED / f"{name}.csv"), self.found[name]
        self.assertEqual(list(found), list(stored), "columns")
        self.assertEqual(set(found), set(tolerances), "every column has a tolerance")
        for column, (relative, absolute) in tolerances.items():
            self.assertEqual(len(found[column]), len(stored[column]), f"rows of {name}.csv")
            for row, (value, expected) in enumerate(zip(found[column], stored[column])):
                with self.subTest(column=column, row=row):
                    self.assertAlmostEqual(value, expected, delta=relative * abs(expected) + absolute)

    def test_history_has_not_moved(self):
        self.assert_like_stored("history", HISTORY)

    def test_newton_iterations_have_not_moved(self):
        self.assert_like_stored("newton", NEWTON)


if __name__ == "__main__":
    unittest.main()
