"""Pictures of a run: matrix.h5 and fractures.h5 (2D, by matplotlib) or matrix.xdmf and fractures.xdmf (3D, by pyvista). See scripts/plot."""

import argparse
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (after the choice of backend)
from matplotlib.collections import LineCollection, PolyCollection  # noqa: E402
from matplotlib.colors import to_hex  # noqa: E402
from matplotlib.lines import Line2D  # noqa: E402
from plot_time import draw_over_time  # noqa: E402
from results import LABELS, STATES, Series, magnitude  # noqa: E402


def fracture_panels(fields):
    """Scalars to draw on fractures, by field name: vectors by magnitude, and 0 for what is round-off beside fields of the same unit."""
    scalars = {name: fields[name] if fields[name].ndim == 1 else magnitude(fields[name]) for name in LABELS if name in fields}
    unit = {name: LABELS[name].split("[")[-1] for name in scalars}
    largest = {}
    for name, values in scalars.items():
        largest[unit[name]] = max(largest.get(unit[name], 0), np.abs(values).max(initial=0))
    return {name: np.where(np.abs(values) > 1e-12 * largest[unit[name]], values, 0) for name, values in scalars.items()}


# ---------------------------------------------------------------------------------------------------------------- 2D


def view(matrix, fractures):
    """The box to draw: the domain, or the surroundings of the fractures where these are small in it."""
    low, high = matrix.points.min(axis=0)[:2], matrix.points.max(axis=0)[:2]
    if fractures is not None:
        inner_low, inner_high = fractures.points.min(axis=0)[:2], fractures.points.max(axis=0)[:2]
        size = (inner_high - inner_low).max()
        if size < 0.3 * (high - low).max():
            low, high = np.maximum(low, inner_low - 0.6 * size), np.minimum(high, inner_high + 0.6 * size)
    return low, high


def draw_displacement(axes, matrix, fractures):
    """Displacement magnitude on the deformed cells; the motion that all have in common is not drawn."""
    low, high = view(matrix, fractures)
    margin = 0.1 * (high - low)
    inside = np.all((matrix.points[:, :2] > low - margin) & (matrix.points[:, :2] < high + margin), axis=1)
    u = matrix.fields["displacement"][:, :2]
    relative = u - u[inside].mean(axis=0)
    largest = magnitude(relative[inside]).max()
    scale = 0.04 * (high - low).max() / largest if largest > 0 else 0
    deformed = matrix.points[:, :2] + scale * relative
    cells = [corners for corners in matrix.corners() if inside[corners].all()]
    draw_cells(axes, [deformed[corners] for corners in cells], [magnitude(u[corners]).mean() for corners in cells], "displacement [m]")
    if inside.all():
        low, high = np.minimum(low, deformed.min(axis=0)), np.maximum(high, deformed.max(axis=0))
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set_title(f"t = {matrix.time:g} s, displacement x {scale:.3g}", loc="left")


def draw_pressure(axes, matrix, _):
    draw_cells(axes, [matrix.points[corners, :2] for corners in matrix.corners()], matrix.fields["pressure"], "pressure [Pa]")
    axes.set_title(f"t = {matrix.time:g} s", loc="left")


def draw_cells(axes, polygons, values, label):
    """Polygons coloured by values; a few extreme ones do not spoil the scale."""
    values = np.asarray(values)
    collection = PolyCollection(polygons, array=values, edgecolor="face", linewidth=0.2)
    low, high = np.percentile(values, (0.5, 99.5))
    extend = "neither"
    if low < high < low + 0.5 * np.ptp(values):
        collection.set_clim(low, high)
        extend = "both"
    axes.add_collection(collection)
    axes.figure.colorbar(collection, ax=axes, label=label, extend=extend, shrink=0.8)


def draw_domain(figure, matrix, fractures):
    """Displacement and pressure side by side, as far as they are computed, with the contact states."""
    low, high = view(matrix, fractures)
    draws = [draw for name, draw in (("displacement", draw_displacement), ("pressure", draw_pressure)) if name in matrix.fields]
    for axes, draw in zip(figure.subplots(1, len(draws), squeeze=False).ravel(), draws):
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x [m]", ylabel="y [m]")
        draw(axes, matrix, fractures)
        if fractures is not None:
            draw_states(axes, fractures)


def draw_states(axes, fractures):
    lines = [fractures.points[corners, :2] for corners in fractures.corners()]
    states = fractures.fields.get("friction_state", np.ones(len(lines))).astype(int)
    axes.add_collection(LineCollection(lines, colors=[STATES[state][1] for state in states], linewidth=1.5))
    handles = [Line2D([], [], color=STATES[state][1], label=STATES[state][0]) for state in np.unique(states)]
    axes.legend(handles=handles, loc="lower right", bbox_to_anchor=(1, 1), ncols=3, frameon=False)


def chains(nodes):
    """Faces of a fracture in turn along it, each connected part from an end (or from anywhere where it closes); nodes[face] = two keys."""
    faces_at = {}
    for face, pair in enumerate(nodes):
        for node in pair:
            faces_at.setdefault(node, set()).add(face)
    left, parts = set(range(len(nodes))), []
    while left:
        tips = [(face, node) for face in sorted(left) for node in nodes[face] if len(faces_at[node] & left) == 1]
        face, node = tips[0] if tips else (min(left), nodes[min(left)][0])
        parts.append([])
        while face is not None:
            left.remove(face)
            parts[-1].append(face)
            node = nodes[face][1] if nodes[face][0] == node else nodes[face][0]
            face = next(iter(faces_at[node] & left), None)
    return parts


def arc_lengths(fractures, faces):
    """Parts of a fracture: (faces in turn, arc length at their centres)."""
    size = np.ptp(fractures.points, axis=0).max()
    corners = fractures.corners()
    lines = [fractures.points[corners[face]] for face in faces]
    nodes = [[tuple(np.round(end / size, 9)) for end in line] for line in lines]
    parts, start = [], 0.0
    for part in chains(nodes):
        lengths = np.array([np.linalg.norm(lines[face][1] - lines[face][0]) for face in part])
        parts.append((faces[part], start + np.cumsum(lengths) - lengths / 2))
        start += lengths.sum()
    return parts


def curves(fractures):
    """(label, values, exact values or None) of what is drawn over the arc length."""
    panels = fracture_panels(fractures.fields)
    exact = fracture_panels({name.removesuffix("_exact"): values for name, values in fractures.fields.items() if name.endswith("_exact")})
    return [(LABELS[name], values, exact.get(name)) for name, values in panels.items() if np.any(values) or np.any(exact.get(name, 0))]


def draw_curves(axes_row, fractures, number, quantities):
    of_face = fractures.fields.get("fracture", np.zeros(len(fractures.corners())))
    parts = arc_lengths(fractures, np.flatnonzero(of_face == number))
    for axes, (label, values, exact) in zip(axes_row, quantities):
        for faces, s in parts:
            computed = axes.plot(s, values[faces], ".-", color="tab:blue", markersize=3, linewidth=0.8)
            if exact is not None:
                reference = axes.plot(s, exact[faces], "--", color="black", linewidth=1)
                axes.legend(handles=computed + reference, labels=["computed", "exact"])
        axes.set(xlabel="arc length [m]", ylabel=label, title=f"fracture {number:g}")


def draw_2d(matrix, fractures, png):
    quantities = curves(fractures) if fractures is not None else []
    numbers = np.unique(fractures.fields.get("fracture", 0)) if quantities else []
    columns = min(3, len(quantities)) if len(numbers) < 3 else len(quantities)  # a network: a row each
    rows = -(-len(quantities) // columns) if columns else 0
    width = max(12, 4 * columns)
    low, high = view(matrix, fractures)
    across = 0.45 if {"displacement", "pressure"} <= set(matrix.fields) else 0.8
    height = min(width / 2, across * width * (high - low)[1] / (high - low)[0] + 1)
    figure = plt.figure(figsize=(width, height + 3 * rows * len(numbers)), layout="constrained")
    upper, *lower = np.atleast_1d(figure.subfigures(1 + len(numbers), 1, height_ratios=[height / 3] + [rows] * len(numbers)))
    draw_domain(upper, matrix, fractures)
    for number, part in zip(numbers, lower):
        grid = part.subplots(rows, columns, squeeze=False).ravel()
        for unused in grid[len(quantities) :]:
            unused.set_axis_off()
        draw_curves(grid, fractures, number, quantities)
    figure.savefig(png, dpi=130)


# ---------------------------------------------------------------------------------------------------------------- 3D


def read_with_vtk(xdmf, time):
    import pyvista

    reader = pyvista.get_reader(xdmf)
    reader.reader.UpdateTimeStep(time)
    return pyvista.wrap(reader.reader.GetOutputDataObject(0))


def panels_3d(matrix, fractures):
    """(title, mesh, field, further options) of each picture."""
    u = matrix["displacement"]
    largest = magnitude(u).max()
    scale = 0.05 * matrix.length / largest if largest > 0 else 0
    matrix["displacement [m]"] = magnitude(u)
    half = matrix.warp_by_vector("displacement", factor=scale).clip(normal="y", crinkle=True)
    panels = [(f"displacement [m], deformed x {scale:.3g}", half, "displacement [m]", {})]
    if fractures is None:
        return panels
    if "friction_state" in fractures.array_names:
        colours = [to_hex(colour) for _, colour in STATES.values()]
        names = {state: name for state, (name, _) in STATES.items()}
        panels.append(("friction state", fractures, "friction_state", {"cmap": colours, "clim": (-0.5, 2.5), "annotations": names}))
    for name, values in fracture_panels(fractures.cell_data).items():
        if np.any(values):
            fractures[LABELS[name]] = values
            panels.append((LABELS[name], fractures, LABELS[name], {}))
    return panels


def draw_3d(directory, matrix, fractures, png):
    import pyvista

    grids = [read_with_vtk(directory / f"{name}.xdmf", series.time) if series is not None else None
             for name, series in (("matrix", matrix), ("fractures", fractures))]
    panels = panels_3d(*grids)
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    plotter = pyvista.Plotter(off_screen=True, shape=(rows, columns), window_size=(640 * columns, 600 * rows), border=False)
    for place, (title, mesh, field, options) in enumerate(panels):
        plotter.subplot(*divmod(place, columns))
        bar = {"title": " " * (place + 1), "n_labels": 0 if "annotations" in options else 4, "position_x": 0.2, "position_y": 0.05,
               "label_font_size": 16}
        plotter.add_mesh(mesh.copy(), scalars=field, lighting=mesh is not grids[1], show_edges=True, line_width=0.3,
                         scalar_bar_args=bar, **options)
        plotter.add_mesh(grids[0].outline(), color="black")
        plotter.add_text(title, position="upper_edge", font_size=11)
        plotter.view_isometric()
        plotter.camera.zoom(0.85)
    plotter.subplot(0, 0)
    plotter.add_text(f"t = {matrix.time:g} s", position="lower_left", font_size=9)
    plotter.screenshot(png)


def main():
    parser = argparse.ArgumentParser(prog="scripts/plot", description="Draws displacement and fracture fields of a run.")
    parser.add_argument("directory", type=Path, metavar="RESULT_DIR")
    parser.add_argument("-o", dest="png", type=Path, help="picture to write (default: RESULT_DIR/fields.png)")
    parser.add_argument("-step", type=int, default=-1, help="output step, from 0 (default: the last)")
    parser.add_argument("-time", nargs="*", type=int, metavar="STEP",
                        help="draw what the fractures do over time instead, at these output steps (default: some of all), with Mohr paths "
                             "and curves, to RESULT_DIR/over_time.png")
    parser.add_argument("-fracture", metavar="NAME", help="with -time, the fracture to draw (default: that with the largest slip)")
    arguments = parser.parse_args()
    if arguments.time is not None:
        png = arguments.png or arguments.directory / "over_time.png"
        draw_over_time(arguments.directory, png, arguments.time, arguments.fracture)
        print(f"wrote {png}")
        return
    png = arguments.png or arguments.directory / "fields.png"
    files = [arguments.directory / name for name in ("matrix.h5", "fractures.h5")]
    if not files[0].exists():
        raise SystemExit(f"{files[0]} does not exist. Give the directory of a run (its option -o).")
    matrix, fractures = [Series(file, arguments.step) if file.exists() else None for file in files]
    if matrix.is_planar():
        draw_2d(matrix, fractures, png)
    else:
        draw_3d(arguments.directory, matrix, fractures, png)
    print(f"wrote {png}")


if __name__ == "__main__":
    main()
