"""Studies of scripts/bench: from the table (bench_studies.yaml) to the runs that it asks for."""

from dataclasses import dataclass, field
from string import Template

import yaml

KEY = ("study", "case", "level", "solver", "ranks")  # what tells one run of the table from another, as columns of runs.csv
DEFAULTS = {"set": {}, "cases": {"": {}}, "solvers": ["built-in"], "ranks": [1], "levels": [""], "quick": [], "repeats": 2, "quick_repeats": 1,
            "time_limit": 600, "mesh": None, "errors": {}, "references": [], "base": None, "kernels": [], "note": "", "options": "",
            "abscissae": ["seconds.total", "memory_mb", "dofs.total"], "size": "dofs.total"}


@dataclass(frozen=True)
class Point:
    """A run of the program, to be repeated."""

    study: str
    case: str
    level: str
    solver: str
    ranks: int
    scene: object  # path below the project, or the scene itself as a map
    settings: dict = field(hash=False)  # scene keys and values, for -set
    options: str
    mesh: str  # arguments of scripts/mesh_network; None for the scene's own mesh
    repeats: int
    time_limit: float  # [s]

    @property
    def key(self):
        return tuple(str(getattr(self, name)) for name in KEY)

    @property
    def name(self):
        return " ".join(part for part in (self.study, self.case, self.level, self.solver, f"{self.ranks} rank{'s' * (self.ranks > 1)}") if part)


@dataclass
class Study:
    """One entry of the table: its points, and how its figures are shown."""

    name: str
    title: str
    note: str
    points: list
    errors: dict  # name: column, or map of column and exact value
    abscissae: list  # columns that errors are drawn against
    size: str  # column that cost and counts are drawn against
    references: list  # figures of others, as rows with the columns of runs.csv
    base: dict  # columns of the point whose seconds others are divided by
    kernels: list  # fields whose kernels of assembly are set against the bounds of the machine

    def columns_of_history(self):
        columns = [entry["column"] if isinstance(entry, dict) else entry for entry in self.errors.values()]
        return [column.removeprefix("history.") for column in columns if column.startswith("history.")]

    def error(self, row, name):
        """An error of a row: a column of it, or its distance from an exact value, relative to that; without one, the value itself."""
        entry = self.errors[name]
        if isinstance(entry, str):
            return row.get(entry)
        value = row.get(entry["column"])
        return abs(value / float(entry["exact"]) - 1) if value is not None and "exact" in entry else value

    def label(self, name):
        return name if isinstance(self.errors[name], dict) and "exact" not in self.errors[name] else f"error of {name}"


class TableError(Exception):
    """The table asks for what cannot be."""


def levels_of(entry, quick):
    """Variables of each level by its label: a map of levels gives several, a number stands for n."""
    levels = entry["levels"]
    named = {str(label): variables for label, variables in levels.items()} if isinstance(levels, dict) else {}
    return {str(label): named.get(str(label), {"n": label}) for label in (entry["quick"] if quick else levels)}


def points_of(name, study, solvers, quick):
    points = []
    for case, own in study["cases"].items():
        entry = {**study, **own, "set": {**study["set"], **own.get("set", {})}}
        for label, variables in levels_of(entry, quick).items():
            fill = lambda text: Template(str(text)).substitute(variables)  # noqa: B023, E731
            settings = {key: fill(value) for key, value in entry["set"].items()}
            mesh = fill(entry["mesh"]) if entry["mesh"] else None
            for solver in entry["solvers"]:
                options = f"{solvers[solver]} {entry['options']}".strip()
                points += [Point(name, str(case), label, solver, ranks, entry["scene"], settings, options, mesh,
                                 entry["quick_repeats" if quick else "repeats"], entry["time_limit"]) for ranks in entry["ranks"]]
    return points


def read_table(file, quick=False):
    """The studies of a table, by name; those without runs are left out."""
    table = yaml.safe_load(file.read_text(encoding="utf-8"))
    solvers = {"built-in": "", **table.get("solvers", {})}
    studies = {}
    for name, given in table["studies"].items():
        entry = {**DEFAULTS, **given}
        if unknown := sorted(set(entry) - set(DEFAULTS) - {"title", "scene"}):
            raise TableError(f'{file}: study {name} has the unknown key "{unknown[0]}".')
        try:
            points = points_of(name, entry, solvers, quick)
        except KeyError as error:
            raise TableError(f"{file}: study {name} needs {error}, which is not there.") from error
        if points:
            studies[name] = Study(name, entry["title"], entry["note"], points, entry["errors"], entry["abscissae"], entry["size"],
                                  entry["references"], entry["base"], entry["kernels"])
    return studies
