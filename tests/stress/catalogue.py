"""What a numerical stress case is, how it is run, and how its answer is judged.

A case is a base scene with overrides, on a mesh of the scene or of a function, with a measure of its error. Judgements:
    holds     finished, and the error is within the bound
    warned    finished or not within the bound, but a warning in the log names the limit and an option
    refused   ended with exit code 2 or 3 and a sentence
    WRONG     finished with a larger error and no warning: a silent wrong answer
"""

import csv
import json
import math
import os
import re
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from pathlib import Path

STATUS = {0: "finished", 2: "refused", 3: "diverged"}
PETSC_ERROR = re.compile(r"Error Message -+\n\[\d+\]PETSC ERROR: (.*)\n(?:\[\d+\]PETSC ERROR: (.*))?")
REMEDY = re.compile(r"^\s*remedy: (.*)$", re.MULTILINE)
WARNING = re.compile(r"^warning: (.*)$", re.MULTILINE)


class Run:
    """A scene in a folder, run."""

    def __init__(self, program, folder, time_limit, options=()):
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
        begin = time.monotonic()
        try:
            done = subprocess.run([program, "scene.yaml", "-o", "out", *options], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=time_limit, check=False)
            self.status, output = STATUS.get(done.returncode, f"exit code {done.returncode}"), done.stdout
        except subprocess.TimeoutExpired as error:
            self.status, output = f"stopped after {time_limit:g} s", error.stdout or b""
        self.log, self.seconds = output.decode(errors="replace"), time.monotonic() - begin
        (folder / "log").write_text(self.log, encoding="utf-8")
        file = folder / "out" / "summary.json"
        self.summary = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
        self.history = self.table(folder / "out" / "history.csv")

    @staticmethod
    def table(file):
        if not file.exists():
            return {}
        with file.open(newline="", encoding="utf-8") as text:
            rows = list(csv.DictReader(text))
        return {name: [float(row[name]) for row in rows] for name in (rows[0] if rows else ())}

    def value(self, section, key):
        return (self.summary.get(section) or {}).get(key) or 0

    @property
    def warnings(self):
        return WARNING.findall(self.log)

    @property
    def remedies(self):
        """In the order of their first use, without their numbers, and how often each was used."""
        names = [re.split(", | of | times ", name)[0] for name in REMEDY.findall(self.log)]
        return "; ".join(f"{name} x{names.count(name)}" for name in dict.fromkeys(names))

    @property
    def message(self):
        """Why a run failed: its own words, PETSc's, or its last line."""
        if self.status == "finished" or self.summary.get("message"):
            return self.summary.get("message", "")
        petsc = PETSC_ERROR.search(self.log)
        return ". ".join(filter(None, petsc.groups())) if petsc else " ".join(self.log.strip().splitlines()[-1:])


# ------------------------------------------------------------------------------------------------------------- measures


def errors(run, _):
    """The largest of the relative L2 errors that the scene's exact solution gives."""
    return max((value for value in run.summary["errors"].values() if value is not None), default=math.inf)


def error_of(name):
    """One of them alone."""
    return lambda run, _: run.summary["errors"][name]


def history(scale=0.0, **expected):
    """The largest deviation of columns of history.csv from lists of exact values, relative to the scale or the largest of these."""
    def measure(run, _):
        worst = 0
        for column, values in expected.items():
            found = run.history[column]
            if len(found) != len(values):
                return math.inf
            size = max(scale, *map(abs, values))
            worst = max([worst, *(abs(a - b) / size for a, b in zip(found, values))])
        return worst
    return measure


def both(*measures):
    return lambda run, reference: max(measure(run, reference) for measure in measures)


def refined(*columns):
    """The largest relative deviation at the end from a refined run."""
    def measure(run, reference):
        return max(abs(run.history[c][-1] - reference.history[c][-1]) / (abs(reference.history[c][-1]) or 1) for c in columns)
    return measure


# ---------------------------------------------------------------------------------------------------------------- cases


@dataclass
class Case:
    name: str
    scene: dict = field(default_factory=dict)      # overrides of the family's base scene
    mesh: Callable | None = None                   # returns the Mesh of the scene
    measure: Callable = errors                     # (run, refined run) -> error
    bound: float = 1e-9                            # of an error that is right
    reference: str = "exact"
    finer: dict | None = None                      # overrides that make the refined run
    expect: str = "holds"
    says: str = ""                                 # what a warning or the message must hold
    options: tuple = ()                            # further words of the command line
    quick: bool = False

    def build(self, folder, base, overrides=()):
        scene = base
        for changes in (self.scene, *overrides):
            scene = merged(scene, changes)
        if self.mesh:
            self.mesh().write(folder / "mesh.h5")
            scene = merged(scene, {"mesh": {"box": None, "file": "mesh.h5"}})
        (folder / "scene.yaml").write_text(json.dumps(scene, indent=1), encoding="utf-8")


@dataclass
class Family:
    name: str
    about: str
    base: dict
    cases: list


def merged(base, changes):
    """Maps key by key; anything else is replaced, and null removes it."""
    result = dict(base)
    for key, value in changes.items():
        old = result.get(key)
        result[key] = merged(old if isinstance(old, dict) else {}, value) if isinstance(value, dict) else value
    return {key: value for key, value in result.items() if value is not None}


@dataclass
class Row:
    """One case of the report. Newton counts hold all attempts at a step, remedies included."""

    family: str
    case: str
    judgement: str
    error: float | None
    bound: float | None
    reference: str
    status: str
    newton: int
    newton_max_per_step: int
    krylov: int
    remedies: str
    rejected: int
    cycles: int
    cells: int
    faces: int
    seconds: float
    warnings: str
    message: str
    failed: bool
    about: str = ""

    @property
    def helped(self):
        return bool(self.remedies) or self.rejected > 0


def judge(run, error, bound):
    if run.status != "finished":
        known = run.status in STATUS.values() and run.message
        return "refused" if known else "WRONG"
    if error is None or error <= bound:
        return "holds"
    return "warned" if run.warnings else "WRONG"


def row_of(family, name, run, error=None, bound=None, reference="", expect="holds", says=""):
    judgement = judge(run, error, bound)
    warnings = " / ".join(run.warnings)
    failed = judgement != expect or says not in warnings + run.message
    return Row(family, name, judgement, error, bound, reference, run.status, run.value("newton", "total"), run.value("newton", "max_per_step"),
               run.value("krylov", "total"), run.remedies, run.value("steps", "rejected"), run.value("active_set", "cycles_detected"),
               run.value("mesh", "cells"), run.value("mesh", "fracture_faces"), round(run.seconds, 2), warnings, run.message, failed)


def run_case(family, case, program, time_limit, keep):
    """`keep(folder, row)` may copy the folder, which is removed afterwards."""
    with tempfile.TemporaryDirectory(prefix="stress_") as temporary:
        folder, finer = Path(temporary) / "case", Path(temporary) / "refined"
        folder.mkdir()
        case.build(folder, family.base)
        run, reference = Run(program, folder, time_limit, case.options), None
        if case.finer and run.status == "finished":
            finer.mkdir()
            case.build(finer, family.base, [case.finer])
            reference = Run(program, finer, time_limit, case.options)
        error = float(case.measure(run, reference)) if run.status == "finished" else None
        row = row_of(family.name, case.name, run, error, case.bound, case.reference, case.expect, case.says)
        keep(folder, row)
    return row
