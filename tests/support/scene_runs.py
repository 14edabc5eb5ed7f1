"""Runs of the executable on the scenes of examples/, for tests driven from outside.

CTest sets POLYSLIP (the executable), POLYSLIP_MPIRUN (launcher with its options) and POLYSLIP_EXAMPLES (folder of the scenes).
"""

import csv
import json
import math
import os
import shlex
import subprocess
import tempfile
from pathlib import Path


class Run:
    """A finished run: exit code, log, summary.json as `summary`, and the tables; those of lines by their names as `lines`."""

    def __init__(self, example, settings=None, ranks=1, options=()):
        """`example` is a folder or one of its scenes, `settings` are scene keys and values (-set), `options` further words of the command
        line."""
        with tempfile.TemporaryDirectory() as directory:
            scene = Path(os.environ["POLYSLIP_EXAMPLES"]) / example
            scene = scene if scene.suffix else scene / "scene.yaml"
            command = shlex.split(os.environ["POLYSLIP_MPIRUN"]) if ranks > 1 else []
            command += ["-n", str(ranks)] if ranks > 1 else []
            command += [os.environ["POLYSLIP"], str(scene), "-o", directory]
            for key, value in (settings or {}).items():
                command += ["-set", f"{key}={value}"]
            environment = dict(os.environ, OPENBLAS_NUM_THREADS="1")
            done = subprocess.run([*command, *options], capture_output=True, text=True, stdin=subprocess.DEVNULL, env=environment)
            self.code, self.log = done.returncode, done.stdout + done.stderr
            if self.code != 0:
                raise AssertionError(f"{' '.join(command)} ended with {self.code}:\n{self.log}")
            self.summary = json.loads((Path(directory) / "summary.json").read_text())
            self.history = read_table(Path(directory) / "history.csv")
            self.newton = read_table(Path(directory) / "newton.csv")
            self.lines = {file.stem.removeprefix("line_"): read_table(file) for file in Path(directory).glob("line_*.csv")}

    @property
    def errors(self):
        """The relative errors that the scene's exact solution gives."""
        return {name: value for name, value in self.summary["errors"].items() if value is not None}


def read_table(path):
    """Columns of a CSV file by name, as numbers."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: [float(row[name]) for row in rows] for name in (rows[0] if rows else ())}


def rate(coarse, fine):
    """Order of convergence between two errors when the mesh size is halved."""
    return math.log2(coarse / fine)
