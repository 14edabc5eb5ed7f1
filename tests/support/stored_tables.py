"""Tables of a run against stored ones, with a tolerance for each column.

After a change that is meant to move these figures, run with UPDATE=1 in the environment and justify the new tables in the commit.
"""

import csv
import os
import unittest

from scene_runs import read_table


def write_table(path, table):
    with open(path, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(zip(*([f"{value:.12g}" for value in column] for column in table.values())))


class StoredTables(unittest.TestCase):
    def assert_like(self, found, expected, tolerances):
        """`tolerances` gives the columns that are compared and (relative, absolute) of each."""
        for column, (relative, absolute) in tolerances.items():
            self.assertEqual(len(found[column]), len(expected[column]), f"rows of {column}")
            for row, (value, wanted) in enumerate(zip(found[column], expected[column])):
                with self.subTest(column=column, row=row):
                    self.assertAlmostEqual(value, wanted, delta=relative * abs(wanted) + absolute)

    def assert_like_stored(self, file, found, tolerances):
        self.assertLessEqual(set(tolerances), set(found), "columns")
        if os.environ.get("UPDATE"):
            write_table(file, {column: found[column] for column in tolerances})
        stored = read_table(file)
        self.assertEqual(set(stored), set(tolerances), "every stored column has a tolerance")
        self.assert_like(found, stored, tolerances)
