"""Medians of the rows of scripts/bench, and its Markdown report."""

import os
import platform
import statistics
from pathlib import Path

import numpy as np

from bench_roofline import BANDWIDTH, PEAK, kernel_lines
from bench_studies import KEY

PHASES = ("read", "partition", "assemble", "condense", "solve", "write")
RATIOS = {"seconds": "seconds.total", "memory": "memory_mb", "Newton": "newton.total", "Krylov": "krylov.total"}


def derived(row):
    """A row with what its columns give: the rest of the time, counts a step and an iteration, shares."""
    row = dict(row)
    total = row.get("seconds.total")
    if total:
        row["seconds.other"] = max(0, total - sum(row[f"seconds.{phase}"] for phase in PHASES))
        row["seconds.computing"] = total - sum(row[f"seconds.{phase}"] for phase in ("read", "partition", "write"))
        row["serial_share"] = 100 * (row["seconds.read"] + row["seconds.partition"]) / total
        row["assembly_share"] = 100 * (row["seconds.assemble"] + row["seconds.condense"]) / total
    if row.get("steps.accepted"):
        row["newton_per_step"] = row["newton.total"] / row["steps.accepted"]
    if row.get("newton.total"):
        row["krylov_per_newton"] = row["krylov.total"] / row["newton.total"]
    return row


def medians(rows):
    """The median row of the finished runs of each point, by key, with `runs` and the spread of their seconds."""
    groups = {}
    for row in rows:
        if row["status"] == "finished":
            groups.setdefault(tuple(row[name] for name in KEY), []).append(derived(row))
    result = {}
    for key, group in groups.items():
        numbers = {name for row in group for name, value in row.items() if isinstance(value, (int, float))}
        middle = {name: statistics.median(row[name] for row in group if name in row) for name in numbers}
        seconds = [row["seconds.total"] for row in group]
        result[key] = {**dict(zip(KEY, key)), **middle, "runs": len(group), "spread": (max(seconds) - min(seconds)) / statistics.median(seconds)}
    return result


def series(study, middle):
    """Median rows by level of each (case, solver, ranks), by a name of what tells them apart."""
    lines = {}
    for point in study.points:
        if point.key in middle:
            lines.setdefault((point.case, point.solver, point.ranks), []).append(middle[point.key])
    differ = [len({key[at] for key in lines}) > 1 for at in range(3)]

    def name(case, solver, ranks):
        return ", ".join(text for text, told in zip((case, solver, f"{ranks} ranks"), differ) if told) or case or study.name

    return {name(*key): line for key, line in lines.items()}


def exponent(rows, size, column="seconds.total"):
    """x of column ~ size^x by least squares of the logarithms; None for one size only."""
    pairs = [(row[size], row[column]) for row in rows if row.get(size) and row.get(column)]
    if len({number for number, _ in pairs}) < 2:
        return None
    return float(np.polyfit(*np.log(pairs).T, 1)[0])


# --------------------------------------------------------------------------------------------------------------- tables


def table(header, lines):
    return "\n".join(["| " + " | ".join(header) + " |", "|" + "---|" * len(header), *("| " + " | ".join(line) + " |" for line in lines)])


def shown(value, pattern):
    return "" if value is None else format(value, pattern)


COLUMNS = [("cells", "mesh.cells", ".0f"), ("unknowns", "dofs.total", ".0f"), ("s", "seconds.total", ".3g"), ("spread", "spread", ".0%"),
           ("CPU s", "cpu", ".3g"), ("MB", "memory_mb", ".0f"), ("bytes/unknown", "bytes_per_unknown", ".0f"),
           ("assembly + condensation %", "assembly_share", ".1f"), ("reading + partition %", "serial_share", ".1f"),
           *((f"imbalance, {name}", f"imbalance.{name}", ".3f") for name in ("cells", "unknowns", "assembly")),
           ("Newton/step", "newton_per_step", ".3g"),
           ("Krylov/Newton", "krylov_per_newton", ".3g"), ("most Krylov", "krylov.max_per_solve", ".0f"), ("set-ups", "setups.preconditioner", ".0f")]


def base_of(study, row, middle):
    """The median row that this one is compared with, within its study."""
    replaced = {**{name: row[name] for name in KEY}, **{name: str(value) for name, value in study.base.items()}}
    return middle.get(tuple(replaced[name] for name in KEY))


def base_ratios(study, row, middle):
    base = base_of(study, row, middle)
    return [shown(row[column] / base[column] if base and base.get(column) else None, ".3g") for column in ("seconds.total", "seconds.computing")]


def study_table(study, middle):
    header = [*KEY[1:], "runs", *(name for name, _, _ in COLUMNS), *map(study.label, study.errors)]
    if study.base:
        text = ", ".join(f"{value}" if name == "case" else f"{value} {name}" for name, value in study.base.items())
        header += [f"s over {text}", "the same, computing"]
    lines = []
    for point in study.points:
        if row := middle.get(point.key):
            line = [*(row[name] for name in KEY[1:]), str(row["runs"]), *(shown(row.get(column), pattern) for _, column, pattern in COLUMNS)]
            line += [shown(study.error(row, name), ".3e") for name in study.errors]
            lines.append(line + (base_ratios(study, row, middle) if study.base else []))
    return table(header, lines)


def growth_text(study, middle):
    found = {name: exponent(rows, study.size) for name, rows in series(study, middle).items()}
    parts = [f"{name} N^{x:.2f}" for name, x in found.items() if x is not None]
    return f"Seconds grow with N {'cells' if study.size == 'mesh.cells' else 'unknowns'} as {', '.join(parts)}." if parts else ""


def kernel_table(study, middle):
    """Kernels of assembly against the roofline, where the study asks for it."""
    lines = []
    for point in study.points:
        row = middle.get(point.key, {})
        for field, kernel, *figures in kernel_lines(row, study.kernels) if PEAK in row else ():
            bounds = [shown(1e-9 * row[column], ".3g") for column in (PEAK, BANDWIDTH)]
            lines.append([*(row[name] for name in KEY[1:]), f"{field}: {kernel}", *(shown(value, ".3g") for value in figures), *bounds])
    header = [*KEY[1:], "kernel", "s", "ns a cell", "Gflop/s", "GB/s", "% of the bound", "peak Gflop/s", "peak GB/s"]
    return table(header, lines) if lines else ""


def reference_table(reference):
    names = list(dict.fromkeys(name for row in reference["rows"] for name in row))
    lines = [[str(row.get(name, "")) for name in names] for row in reference["rows"]]
    return f"{reference['name']} ({reference['source']}):\n\n" + table(names, lines)


def failure_table(rows):
    lines = [[*(row[name] for name in KEY), f"{row['repeat']:.0f}", row["status"], str(row["reason"]).replace("|", "/")] for row in rows]
    return table([*KEY, "repeat", "status", "reason"], lines)


def against_table(middle, earlier):
    """Ratios of the medians, this report over an earlier one, for the points of both."""
    lines = []
    for key, row in middle.items():
        if other := earlier.get(key):
            ratios = [row[column] / other[column] if row.get(column) is not None and other.get(column) else None for column in RATIOS.values()]
            lines.append([*key, *(shown(ratio, ".3f") for ratio in ratios)])
    return table([*KEY, *RATIOS], lines) if lines else "No run of this report is in the earlier one."


# --------------------------------------------------------------------------------------------------------------- report


def processor():
    info = Path("/proc/cpuinfo")
    names = [line.split(":")[1].strip() for line in info.read_text().splitlines() if line.startswith("model name")] if info.exists() else []
    return f"{names[0] if names else platform.machine()}, {os.cpu_count()} cores"


def circumstances(rows):
    """Machine, load and build of the runs."""
    builds = sorted({f"polyslip {row['version']}, PETSc {row['build.petsc']}, {row['build.type']}" for row in rows if row.get("build.petsc")})
    loads = [row["load"] for row in rows]
    load = f"load before runs {min(loads):.2f} to {max(loads):.2f}, median {statistics.median(loads):.2f}" if loads else "no runs yet"
    return f"{processor()}; {load}; {'; '.join(builds) or 'build not known'}. Figures are medians of repeats, seconds are of the clock."


def study_section(study, middle, pictures):
    parts = [f"## {study.name}: {study.title}", study.note, study_table(study, middle), kernel_table(study, middle), growth_text(study, middle)]
    parts += [reference_table(reference) for reference in study.references]
    return [*parts, *(f"![{picture}]({picture})" for picture in pictures)]


def write_report(studies, rows, output, earlier=None, pictures=()):
    """report.md of all rows so far; `earlier` are the rows of another report, `pictures` the names of the plots by study."""
    middle = medians(rows)
    text = ["# Bench", circumstances(rows)]
    failures = [row for row in rows if row["status"] != "finished"]
    if failures:
        text += [f"## Failures: {len(failures)} of {len(rows)} runs", failure_table(failures)]
    for study in studies.values():
        if any(point.key in middle for point in study.points):
            text += study_section(study, middle, dict(pictures).get(study.name, []))
    if earlier is not None:
        text += ["## Over the earlier report", against_table(middle, medians(earlier))]
    (output / "report.md").write_text("\n\n".join(filter(None, text)) + "\n", encoding="utf-8")
