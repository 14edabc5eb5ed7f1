"""scripts/bench on a small table: its rows, its report, its pictures, and what it does about failures."""

import csv
import os
import re
import subprocess
import tempfile
import unittest
from pathlib import Path

ROOT = Path(os.environ["POLYSLIP_EXAMPLES"]).parent
TABLE = """
studies:
  column:
    title: a column
    scene: examples/terzaghi/scene.yaml
    levels: [4, 8]
    set: {study.n: $n}
    repeats: 2
    cases:
      good: {}
      wrong: {levels: [4], set: {mesh.box.no_such_key: 1}}
    errors: {pressure: errors.pressure_l2}
    kernels: [rock]
    references: [{name: somebody, source: a guess, rows: [{seconds.total: 1, errors.pressure_l2: 0.1}]}]
  unmeshed:
    title: a mesh that cannot be made
    scene: examples/terzaghi/scene.yaml
    mesh: --size -1
    repeats: 1
"""
PICTURES = {f"column_{kind}.png" for kind in ("errors", "growth", "phases", "counts")}


def bench(folder, *arguments):
    """(exit code, rows, report) of a call of scripts/bench."""
    table = Path(folder) / "table.yaml"
    table.write_text(TABLE, encoding="utf-8")
    command = [str(ROOT / "scripts/bench"), "--table", str(table), "--program", os.environ["POLYSLIP"], "-o", f"{folder}/out", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    if not (Path(folder) / "out/report.md").exists():
        raise AssertionError(done.stdout + done.stderr)
    with (Path(folder) / "out/runs.csv").open(newline="") as file:
        return done.returncode, list(csv.DictReader(file)), (Path(folder) / "out/report.md").read_text()


def stored(folder, name, seconds):
    """A runs.csv of the two good levels, with 100 and 1000 unknowns and the given seconds of each repeat."""
    kernel = {"kernels.rock.insertion.seconds": 0.5, "kernels.rock.insertion.flops": 1e9, "kernels.rock.insertion.bytes": 4e9,
              "machine.flops": 1e10, "machine.bandwidth": 2e10, "mesh.cells": 1e6}
    phases = {f"seconds.{phase}": 0 for phase in ("read", "partition", "assemble", "condense", "solve", "write")}
    rows = [{"study": "column", "case": "good", "level": level, "solver": "built-in", "ranks": 1, "repeat": repeat, "status": "finished", "reason": "",
             "load": 0.5, "dofs.total": unknowns, "newton.total": 3, "krylov.total": 6, "steps.accepted": 1, "seconds.total": total, **kernel, **phases}
            for level, unknowns in ((4, 100), (8, 1000)) for repeat, total in enumerate(seconds[level])]
    file = Path(folder) / name
    file.parent.mkdir(exist_ok=True)
    with file.open("w", newline="") as out:
        table = csv.DictWriter(out, rows[0])
        table.writeheader()
        table.writerows(rows)
    return str(file)


def ratios(report):
    """Lines of the table of ratios: case, level and the four ratios."""
    lines = report.partition("## Over the earlier report")[2].splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| column")]
    return {(row[1], row[2]): row[5:] for row in cells}


class Runs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.code, cls.rows, cls.report = bench(cls.folder.name)

    def test_repeats_are_interleaved_and_each_run_is_a_row(self):
        order = [(row["case"], row["level"], row["repeat"]) for row in self.rows if row["study"] == "column"]
        once = [("good", "4"), ("good", "8"), ("wrong", "4")]
        self.assertEqual(order, [(*point, repeat) for repeat in "01" for point in once])

    def test_rows_hold_what_the_summaries_do(self):
        for row in self.rows:
            if row["case"] == "good":
                self.assertEqual((row["status"], row["mesh.cells"], row["build.type"] != ""), ("finished", str(2 * int(row["level"])), True))
                self.assertAlmostEqual(float(row["bytes_per_unknown"]), float(row["memory_mb"]) * 2**20 / float(row["dofs.total"]), delta=1)

    def test_the_log_ends_with_the_bytes_per_unknown_of_the_last_repeat(self):
        last = [row for row in self.rows if (row["case"], row["level"]) == ("good", "8")][-1]
        log = (Path(self.folder.name) / "out/runs/column_good_8_built-in_1/log").read_text()
        self.assertIn(f"{float(last['bytes_per_unknown']):.0f} bytes per unknown", log.splitlines()[-1])

    def test_a_failure_is_a_row_with_its_reason(self):
        self.assertEqual(self.code, 1)
        failures = {row["study"] + row["case"]: row for row in self.rows if row["status"] != "finished"}
        self.assertEqual({name: row["status"] for name, row in failures.items()}, {"columnwrong": "refused", "unmeshed": "no mesh"})
        self.assertIn("no_such_key", failures["columnwrong"]["reason"])
        self.assertIn("## Failures: 3 of 7 runs", self.report)

    def test_report_shows_the_study_and_pictures_that_are_there(self):
        self.assertIn("## column: a column", self.report)
        self.assertEqual(set(re.findall(r"!\[\S+\]\((\w+\.png)\)", self.report)), PICTURES)
        for picture in PICTURES:
            self.assertEqual((Path(self.folder.name) / "out" / picture).read_bytes()[:4], b"\x89PNG")

    def test_against_itself_all_ratios_are_one(self):
        _, rows, report = bench(self.folder.name, "--continue", "--against", f"{self.folder.name}/out/runs.csv")
        self.assertEqual(rows, self.rows, "nothing was missing, so nothing ran")
        self.assertEqual(ratios(report), {("good", level): ["1.000"] * 4 for level in "48"})


class Figures(unittest.TestCase):
    def test_medians_exponents_and_ratios_are_those_of_the_rows(self):
        with tempfile.TemporaryDirectory() as folder:
            stored(folder, "out/runs.csv", {4: [1, 2, 9], 8: [40, 60]})
            earlier = stored(folder, "earlier.csv", {4: [4], 8: [25]})
            code, _, report = bench(folder, "column", "--case", "good", "--continue", "--against", earlier)
        self.assertEqual(code, 0)
        self.assertIn("good N^1.40", report)  # log10(50/2)
        line = next(line for line in report.splitlines() if "rock: insertion" in line)
        self.assertEqual(re.findall(r"\d[\d.]*", line.partition("insertion")[2]), ["0.5", "500", "2", "8", "40", "10", "20"])  # 4e9/2e10 s of 0.5
        self.assertEqual({key: values[0] for key, values in ratios(report).items()}, {("good", "4"): "0.500", ("good", "8"): "2.000"})


if __name__ == "__main__":
    unittest.main()
