"""Pictures of scripts/bench: errors, growth of the cost, time by phase, counts of iterations."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (after the choice of the backend)
from matplotlib.ticker import LogLocator, NullFormatter  # noqa: E402

from bench_report import PHASES, exponent, medians, series  # noqa: E402

LABELS = {"seconds.total": "seconds", "memory_mb": "peak memory [MB]", "dofs.total": "unknowns", "mesh.fracture_faces": "fracture faces",
          "mesh.cells": "cells", "newton_per_step": "Newton iterations a step",
          "krylov_per_newton": "Krylov iterations a Newton iteration"}


def grid(rows, columns):
    return plt.subplots(rows, columns, figsize=(5 * columns, 3.8 * rows), squeeze=False, layout="constrained")


def draw(axes, pairs, **style):
    """A line through those pairs that are there."""
    if pairs := sorted(pair for pair in pairs if None not in pair):
        axes.plot(*zip(*pairs), **style)


def draw_all(axes, study, lines, column, value, name=lambda label, rows: label):
    """value(row) against a column: lines of this report, and dashed the figures of others."""
    for label, rows in lines.items():
        draw(axes, [(row.get(column), value(row)) for row in rows], marker="o", label=name(label, rows))
    for reference in study.references:
        draw(axes, [(row.get(column), value(row)) for row in reference["rows"]], marker="s", linestyle="--", color="black", label=reference["name"])


def tick_digits(low, high):
    """Leading digits of the labels of a logarithmic axis: the fewer the longer it is."""
    return (1,) if high > 200 * low else (1, 2, 5) if high > 4 * low else tuple(range(1, 10))


def finish(axes, x, y, scales=("log", "log")):
    axes.set(xlabel=LABELS.get(x, x), ylabel=LABELS.get(y, y), xscale=scales[0], yscale=scales[1])
    for axis, scale in zip((axes.xaxis, axes.yaxis), scales):
        if scale == "log":
            axis.set_major_locator(LogLocator(subs=tick_digits(*axis.get_view_interval())))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())
    axes.grid(True, alpha=0.3)
    if axes.lines:
        axes.legend(fontsize=8)


def errors(study, lines):
    """Each error against each abscissa."""
    figure, axes = grid(len(study.errors), len(study.abscissae))
    for name, row_of_axes in zip(study.errors, axes):
        for column, axis in zip(study.abscissae, row_of_axes):
            draw_all(axis, study, lines, column, lambda row: study.error(row, name))  # noqa: B023
            finish(axis, column, study.label(name))
    return figure


def growth(study, lines):
    """Seconds and memory against the size, with the exponents."""

    def fitted(label, rows):
        x = exponent(rows, study.size, column)
        return label if x is None else f"{label}: N^{x:.2f}"

    figure, axes = grid(1, 2)
    for axis, column in zip(axes[0], ("seconds.total", "memory_mb")):
        draw_all(axis, study, lines, study.size, lambda row: row.get(column), fitted)  # noqa: B023
        finish(axis, study.size, column)
    return figure


def phases(study, lines):
    """Seconds of each phase by a million unknowns, so that sizes can be compared."""
    bars = [(f"{label} {row['level']}", row) for label, rows in lines.items() for row in rows]
    figure, axes = plt.subplots(figsize=(9, 1.2 + 0.28 * len(bars)), layout="constrained")
    left = [0.0] * len(bars)
    for phase in (*PHASES, "other"):
        widths = [1e6 * row[f"seconds.{phase}"] / row["dofs.total"] for _, row in bars]
        axes.barh(range(len(bars)), widths, left=left, label=phase)
        left = [a + b for a, b in zip(left, widths)]
    axes.set_yticks(range(len(bars)), [name for name, _ in bars], fontsize=8)
    axes.invert_yaxis()
    axes.set_xlabel("seconds by a million unknowns")
    axes.legend(fontsize=8)
    return figure


def counts(study, lines):
    """Iterations against the size."""
    figure, axes = grid(1, 2)
    for axis, column in zip(axes[0], ("newton_per_step", "krylov_per_newton")):
        draw_all(axis, study, lines, study.size, lambda row: row.get(column))  # noqa: B023
        finish(axis, study.size, column, ("log", "linear"))
        axis.set_ylim(bottom=0)
    return figure


def draw_studies(studies, rows, output):
    """Writes the pictures; their file names by study."""
    middle, names = medians(rows), {}
    for study in studies.values():
        lines = series(study, middle)
        for kind in (errors, growth, phases, counts):
            if lines and (study.errors or kind is not errors):
                figure = kind(study, lines)
                name = f"{study.name}_{kind.__name__}.png"
                figure.savefig(output / name, dpi=110)
                plt.close(figure)
                names.setdefault(study.name, []).append(name)
    return names
