"""Pictures of a run over time: fields of a planar fracture (3D), Mohr paths of the windows, curves of history.csv. See scripts/plot."""

import csv

import matplotlib.pyplot as plt
import numpy as np
import yaml
from matplotlib.collections import PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from results import STATES, Series, count_steps, magnitude

MOST = 8  # output steps side by side
UNITS = ((3600, 1, "s"), (3 * 86400, 3600, "h"), (5 * 365.25 * 86400, 86400, "days"))  # up to [s], length [s], name
MARKS = (Line2D([], [], color="grey", linestyle="--", label="nearest face, until it slips (x)"), Line2D([], [], color="grey", label="mean"))


class Clock:
    """Times in a unit that fits the run."""

    def __init__(self, duration):
        self.length, self.name = next(((length, name) for most, length, name in UNITS if duration <= most), (365.25 * 86400, "years"))

    def __call__(self, seconds):
        return np.asarray(seconds) / self.length

    def text(self, seconds):
        return f"{round(float(self(seconds)), 2):g} {self.name}"


def read_history(directory):
    with open(directory / "history.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        raise SystemExit(f"{directory / 'history.csv'}: no step has been accepted.")
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def window_names(history):
    return [name.removesuffix("_nearest_normal") for name in history if name.endswith("_nearest_normal")]


# ------------------------------------------------------------------------------------------------------------- fields


class Plane:
    """A planar fracture seen along its normal: strike to the right, dip upwards."""

    def __init__(self, fractures, number):
        self.faces = np.flatnonzero(fractures.fields["fracture"] == number)
        corners = fractures.corners()
        points = [fractures.points[corners[face]] for face in self.faces]
        centre = np.concatenate(points).mean(axis=0)
        _, extent, axes = np.linalg.svd(np.concatenate(points) - centre, full_matrices=False)
        self.is_planar = extent[2] < 1e-6 * extent[0]
        strike = np.cross([0, 0, 1.0], axes[2])
        if magnitude(strike[None])[0] < 1e-6:
            strike = np.array([1.0, 0, 0])  # a level fracture: x to the right
        strike *= np.sign(strike[np.argmax(np.abs(strike))]) / np.linalg.norm(strike)
        up = np.cross(axes[2], strike)
        up *= np.sign(up[2]) if abs(up[2]) > 1e-6 else np.sign(up[1])
        self.polygons = [np.stack([(p - centre) @ strike, (p - centre) @ up], axis=1) for p in points]
        self.size = np.ptp(np.concatenate(self.polygons), axis=0)


def slip_of(fractures):
    return fractures.fields["slip"] if "slip" in fractures.fields else magnitude(fractures.fields["jump_tangential"])


def chosen_fracture(directory, fractures, name):
    """Number and name of the fracture: the one asked for, or that with the largest slip."""
    scene = yaml.safe_load((directory / "scene.resolved.yaml").read_text(encoding="utf-8"))
    names = [entry["name"] for entry in scene.get("fractures") or []]
    if name is None:
        number = int(fractures.fields["fracture"][np.argmax(slip_of(fractures))])
        return number, names[number] if number < len(names) else str(number)
    if name not in names:
        raise SystemExit(f"{directory}: there is no fracture {name}; there are {', '.join(names)}.")
    return names.index(name), name


def field_rows(first, series, faces):
    """(label, values by time, colours) of each row; pressure as its change from the first output."""
    rows = [("slip [mm]", [1e3 * slip_of(one)[faces] for one in series], "magma_r")]
    if "pressure" in first.fields:
        start = first.fields["pressure"][faces]
        rows.append(("pressure change [MPa]", [1e-6 * (one.fields["pressure"][faces] - start) for one in series], "viridis"))
    if "aperture" in series[0].fields:
        rows.append(("log10 of aperture [m]", [np.log10(np.maximum(one.fields["aperture"][faces], 1e-12)) for one in series], "cividis"))
    return rows


def draw_row(axes_row, plane, values, colours, norm=None):
    low, high = min(v.min() for v in values), max(v.max() for v in values)
    for axes, v in zip(axes_row, values):
        collection = PolyCollection(plane.polygons, array=v, cmap=colours, edgecolor="face", linewidth=0.3, norm=norm)
        if norm is None:
            collection.set_clim(low, high if high > low else low + 1)
        axes.add_collection(collection)
        axes.autoscale_view()
        axes.set(aspect="equal", xticks=[], yticks=[])
    return collection


def draw_fields(figure, series, rows, plane, name, clock):
    grid = figure.subplots(1 + len(rows), len(series), squeeze=False)
    for axes, one in zip(grid[0], series):
        axes.set_title(clock.text(one.time), fontsize=10)
    states = [one.fields["friction_state"][plane.faces] for one in series]
    names, colours = zip(*STATES.values())
    bar = figure.colorbar(draw_row(grid[0], plane, states, ListedColormap(colours), BoundaryNorm([-0.5, 0.5, 1.5, 2.5], 3)),
                          ax=list(grid[0]), ticks=list(STATES), aspect=8, pad=0.01)
    bar.set_ticklabels(names)
    for axes_row, (label, values, colours) in zip(grid[1:], rows):
        figure.colorbar(draw_row(axes_row, plane, values, colours), ax=list(axes_row), label=label, aspect=8, pad=0.01)
    grid[-1][0].set(xlabel=f"strike, {plane.size[0]:.4g} m", ylabel=f"dip, {plane.size[1]:.4g} m")
    figure.suptitle(f"{name}, seen along its normal", x=0.01, ha="left", fontsize=11)


# ------------------------------------------------------------------------------------------------------------- curves


def colour_of(number):
    return f"C{number}"


def draw_mohr(axes, history, names, friction):
    """Paths of (lam_n, |lam_t|), a circle where they begin and a cross where the nearest face first slips."""
    for number, name in enumerate(names):
        mean = 1e-6 * np.array([history[f"{name}_normal"], history[f"{name}_tangential"]])
        nearest = 1e-6 * np.array([history[f"{name}_nearest_normal"], history[f"{name}_nearest_tangential"]])
        slides = np.flatnonzero(history[f"{name}_ratio"] > 1 - 1e-6)
        last = slides[0] if slides.size else len(history["time"]) - 1  # then it is another face in each step
        axes.plot(*mean, color=colour_of(number), linewidth=1.2, label=name)
        axes.plot(*nearest[:, : last + 1], "--", color=colour_of(number), linewidth=1)
        axes.plot(*mean[:, 0], "o", color=colour_of(number), markersize=4)
        axes.plot(*nearest[:, 0], "o", color=colour_of(number), markersize=4)
        if slides.size:
            axes.plot(*nearest[:, last], "x", color=colour_of(number), markersize=7)
    if friction is not None:
        reach = np.array([axes.get_xlim()[0], axes.get_xlim()[1]])
        axes.plot(reach, friction * reach, color="black", linewidth=1, label=f"Coulomb, F = {friction:g}")
    own = axes.legend(fontsize=8, loc="upper left")
    axes.add_artist(own)
    axes.legend(handles=MARKS, fontsize=8, loc="lower right")
    axes.set(xlabel="effective normal traction [MPa]", ylabel="shear traction [MPa]", title="Mohr paths")


def draw_windows(axes, clock, history, names, column, scale, label):
    for number, name in enumerate(names):
        axes.plot(clock(history["time"]), scale(history[f"{name}_{column}"]), color=colour_of(number), marker=".", markersize=3,
                  label=name)
    axes.set(xlabel=f"time [{clock.name}]", ylabel=label)
    axes.legend(fontsize=8)


def draw_patch(axes, clock, history, area_unit, moment_unit):
    """Slipped area, and the seismic moment on the right; of a metre of depth in 2D."""
    time = clock(history["time"])
    area = axes.plot(time, history["slipped_area"], color="tab:blue", marker=".", markersize=3, label="slipped area")
    right = axes.twinx()
    moment = right.plot(time, history["seismic_moment"], color="tab:red", marker=".", markersize=3, label="seismic moment")
    axes.set(xlabel=f"time [{clock.name}]", ylabel=f"slipped area [{area_unit}]")
    axes.ticklabel_format(axis="y", scilimits=(-2, 4))
    right.set_ylabel(f"seismic moment [{moment_unit}]")
    largest = history["seismic_moment"].max()
    size = f", Mw {2 / 3 * (np.log10(largest) - 9.1):.2f}" if largest > 1e9 and area_unit == "m2" else ""
    axes.set_title(f"M0 = {largest:.3g} {moment_unit}{size}", fontsize=10)
    axes.legend(handles=area + moment, fontsize=8, loc="lower right")


def draw_curves(figure, history, friction, clock, units):
    names = window_names(history)
    with_fluid = names and any(np.any(history[f"{name}_aperture"]) for name in names)
    panels = [lambda axes: draw_patch(axes, clock, history, *units)]
    if with_fluid:
        pressure_change = lambda p: 1e-6 * (p - p[0])  # noqa: E731
        panels.insert(0, lambda axes: draw_windows(axes, clock, history, names, "aperture", lambda d: 1e3 * d, "mean aperture [mm]"))
        panels.insert(0, lambda axes: draw_windows(axes, clock, history, names, "pressure", pressure_change,
                                                   "mean pressure change [MPa]"))
    if names:
        panels.insert(0, lambda axes: draw_mohr(axes, history, names, friction))
    for axes, draw in zip(figure.subplots(1, len(panels), squeeze=False).ravel(), panels):
        draw(axes)


def only_value(values):
    """What all values are, or None."""
    return float(values[0]) if len(values) and np.ptp(values) == 0 else None


def output_steps(file, asked):
    count = count_steps(file)
    return asked or sorted(set(np.linspace(0, count - 1, min(count, MOST)).round().astype(int)))


def draw_over_time(directory, png, asked_steps, fracture):
    """`asked_steps`: output steps, or none for some evenly spread ones; `fracture`: a name, or None."""
    file = directory / "fractures.h5"
    if not file.exists():
        raise SystemExit(f"{file} does not exist: without fractures nothing slips.")
    history = read_history(directory)
    series = [Series(file, step) for step in output_steps(file, asked_steps)]
    if "friction_state" not in series[-1].fields:
        raise SystemExit(f"{directory}: the run has no contact.")
    clock = Clock(history["time"][-1] - history["time"][0])
    number, name = chosen_fracture(directory, series[-1], fracture)
    friction = only_value(series[-1].fields["friction_coefficient"])
    plane = None if series[-1].is_line() else Plane(series[-1], number)
    if plane is None or not plane.is_planar:
        figure = plt.figure(figsize=(18 if window_names(history) else 6, 4.2), layout="constrained")
        draw_curves(figure, history, friction, clock, ("m", "N") if plane is None else ("m2", "N m"))
    else:
        rows = field_rows(Series(file, 0), series, plane.faces)
        height = min(2.6, 15.5 / len(series) * plane.size[1] / plane.size[0])
        heights = [(1 + len(rows)) * (height + 0.35), 4]
        figure = plt.figure(figsize=(18, sum(heights)), layout="constrained")
        upper, lower = figure.subfigures(2, 1, height_ratios=heights)
        draw_fields(upper, series, rows, plane, name, clock)
        draw_curves(lower, history, friction, clock, ("m2", "N m"))
    figure.savefig(png, dpi=110)
