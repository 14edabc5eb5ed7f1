"""Conforming meshes of fracture networks by Gmsh, for mesh.file of a scene. See scripts/mesh_network.

Fractures are polylines in a rectangle, or planar polygons in a box; they may meet, cross, turn corners and reach the boundary.
No cell crosses an interface between layers (--layer), which has no group and no contact.
The mesh has the physical groups rock (cells), one of each fracture's name (faces) and the sides left, right (x), bottom, top (the last
axis), front, back (y, in 3D), as meshes of boxes have.
"""

import argparse
import csv
import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import gmsh
import yaml

FUNCTIONS = {name: getattr(math, name) for name in ("pi", "sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "sqrt")}


@dataclass
class Network:
    """Fractures by name, each a list of points [m], and the box [m] where it is known."""

    fractures: dict
    low: list = None
    high: list = None


# ------------------------------------------------------------------------------------------------------------- input


def number(text, names):
    """A number of a scene: as such or as a formula of study numbers."""
    if isinstance(text, (int, float)):
        return float(text)
    try:
        return float(eval(text.replace("^", "**"), {"__builtins__": {}}, {**FUNCTIONS, **names}))  # noqa: S307  (the user's own scene)
    except Exception as error:
        raise SystemExit(f"mesh_network: \"{text}\" is not a number: {error}.") from error


def read_scene(file):
    scene = yaml.safe_load(file.read_text(encoding="utf-8"))
    names = {}
    for name, text in (scene.get("study") or {}).items():
        names[name] = number(text, names)
    point = lambda entries: [number(entry, names) for entry in entries]  # noqa: E731
    network = Network({})
    for fracture in scene.get("fractures") or []:
        if "points" not in fracture:
            raise SystemExit(f"mesh_network: {file}: fracture \"{fracture.get('name')}\" has no points, so its place is not known.")
        network.fractures[fracture["name"]] = [point(entries) for entries in fracture["points"]]
    box = (scene.get("mesh") or {}).get("box")
    if box:
        network.low, network.high = point(box["min"]), point(box["max"])
    return network


def read_csv(file):
    """Segments FID,START_X,START_Y,END_X,END_Y, or polylines FID,X,Y whose successive rows share the FID; each FID is a fracture."""
    fractures = {}
    for row in csv.reader(file.read_text(encoding="utf-8").splitlines()):
        try:
            name, values = f"fracture_{row[0].strip()}", [float(value) for value in row[1:]]
        except (ValueError, IndexError):
            continue  # a header or an empty line
        if len(values) not in (2, 4):
            raise SystemExit(f"mesh_network: {file}: the row {','.join(row)} is neither FID,X1,Y1,X2,Y2 nor FID,X,Y.")
        fractures.setdefault(name, []).extend([values[at : at + 2] for at in range(0, len(values), 2)])
    return Network(fractures)


def read_network(arguments):
    file, box = arguments.network, arguments.box
    network = read_csv(file) if file.suffix == ".csv" else read_scene(file)
    if box:
        network.low, network.high = box[: len(box) // 2], box[len(box) // 2 :]
    if network.low is None:
        raise SystemExit(f"mesh_network: {file} has no mesh.box. Give --box XMIN YMIN XMAX YMAX.")
    dim = len(network.low)
    for level, size in arguments.layer.items():
        if not network.low[-1] < level < network.high[-1] or (size is not None and not size > 0):
            raise SystemExit(f"mesh_network: --layer {level:g}: it must lie in the box, and its size be positive.")
    least = 2 if dim == 2 else 3
    if "" in arguments.fine:  # of all that are not named
        arguments.fine = dict.fromkeys(network.fractures, arguments.fine.pop("")) | arguments.fine
    if unknown := [name for name in arguments.fine if name not in network.fractures]:
        raise SystemExit(f"mesh_network: --fine {unknown[0]}: there is no such fracture; there are {', '.join(network.fractures)}.")
    for name, points in network.fractures.items():
        if any(len(point) != dim for point in points) or len(points) < least:
            raise SystemExit(f"mesh_network: fracture \"{name}\" must have {least} or more points of {dim} coordinates in this box.")
    return network


# ----------------------------------------------------------------------------------------------------------- geometry


def add_box(low, high):
    sizes = [b - a for a, b in zip(low, high)]
    if len(low) == 2:
        return [(2, gmsh.model.occ.addRectangle(*low, 0, *sizes))]
    return [(3, gmsh.model.occ.addBox(*low, *sizes))]


def add_fracture(points):
    """Segments (2D) or a polygon (3D)."""
    occ = gmsh.model.occ
    corners = [occ.addPoint(*point, *[0] * (3 - len(point))) for point in points]
    if len(points[0]) == 2:
        return [(1, occ.addLine(a, b)) for a, b in zip(corners, corners[1:])]
    edges = [occ.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1])]
    return [(2, occ.addPlaneSurface([occ.addCurveLoop(edges)]))]


def add_interface(network, level):
    """The level of the last axis from side to side."""
    (x, *y, _), (x_end, *y_end, _) = network.low, network.high
    if not y:
        return add_fracture([[x, level], [x_end, level]])
    return add_fracture([[x, *y, level], [x_end, *y, level], [x_end, *y_end, level], [x, *y_end, level]])


def fragment(network, levels):
    """Cuts the box along the fractures and the levels; returns the pieces of each of both and the cells' pieces."""
    occ = gmsh.model.occ
    box = add_box(network.low, network.high)
    tools, owners = [], []
    for name, points in network.fractures.items():
        inside, _ = occ.intersect(add_fracture(points), box, removeObject=True, removeTool=False)
        if not inside:
            raise SystemExit(f"mesh_network: fracture \"{name}\" lies outside the box.")
        tools += inside
        owners += [name] * len(inside)
    for level in levels:
        tools += add_interface(network, level)
        owners.append(level)
    rock, pieces = box, [box]
    if tools:
        rock, pieces = occ.fragment(box, tools)
    occ.synchronize()
    dim = len(network.low)
    parts, interfaces = {name: [] for name in network.fractures}, {level: [] for level in levels}
    for owner, entities in zip(owners, pieces[1:]):
        (parts if owner in parts else interfaces)[owner] += [tag for _, tag in entities]
    return parts, interfaces, [tag for entity, tag in rock if entity == dim]


def side_of(entity, network):
    """Name of a side of the box in which an entity lies, or None."""
    dim = len(network.low)
    names = [("left", "right"), ("bottom", "top")] if dim == 2 else [("left", "right"), ("front", "back"), ("bottom", "top")]
    bounds = gmsh.model.getBoundingBox(*entity)
    for axis, (lower, upper) in enumerate(names):
        slack = 1e-5 * (network.high[axis] - network.low[axis])
        for name, level in ((lower, network.low[axis]), (upper, network.high[axis])):
            if abs(bounds[axis] - level) < slack and abs(bounds[axis + 3] - level) < slack:
                return name
    return None


def name_groups(network, parts, rock):
    dim = len(network.low)
    groups = {}
    for entity in gmsh.model.getBoundary([(dim, tag) for tag in rock], combined=True, oriented=False):
        groups.setdefault(side_of(entity, network), []).append(entity[1])
    outer = {tag for name, tags in groups.items() if name for tag in tags}
    for name, tags in parts.items():
        if outer.intersection(tags):
            raise SystemExit(f"mesh_network: fracture \"{name}\" lies in the boundary; a fracture has rock on both sides.")
    groups.pop(None, None)
    for name, tags in {**groups, **parts}.items():
        gmsh.model.addPhysicalGroup(dim - 1, sorted(set(tags)), name=name)
    gmsh.model.addPhysicalGroup(dim, rock, name="rock")


# ---------------------------------------------------------------------------------------------------------------- mesh


def tips(parts, network):
    """Points (2D) or edges (3D) inside the box that belong to one piece of fracture only, by fracture. Layers do not count."""
    dim = len(network.low)
    ends = {name: Counter() for name in parts}
    for name, tags in parts.items():
        ends[name].update(end[1] for tag in set(tags) for end in gmsh.model.getBoundary([(dim - 1, tag)], combined=False, oriented=False))
    count = sum(ends.values(), Counter())
    return {name: [tag for tag in own if count[tag] == 1 and side_of((dim - 2, tag), network) is None] for name, own in ends.items()}


def size_near(entities, dim, formula):
    """A size field, the formula with F for the distance from points (dimension 0), curves (1) or surfaces (2)."""
    field = gmsh.model.mesh.field
    distance = field.add("Distance")
    field.setNumbers(distance, ("PointsList", "CurvesList", "SurfacesList")[dim], entities)
    field.setNumber(distance, "Sampling", 200)
    size = field.add("MathEval")
    field.setString(size, "F", formula.replace("F", f"F{distance}"))
    return size


def set_sizes(parts, interfaces, network, arguments):
    """Sizes at points, which Gmsh carries along curves and from these into the rock, and smaller ones near tips and on fine fractures."""
    dim, mesh = len(network.low), gmsh.model.mesh
    sizes = {name: arguments.fine.get(name, arguments.size) for name in parts}
    mesh.setSize(gmsh.model.getEntities(0), arguments.far or arguments.size)
    surfaces = [(arguments.layer[level] or arguments.far or arguments.size, tags) for level, tags in interfaces.items()]
    surfaces += [(sizes[name], parts[name]) for name in sorted(parts, key=sizes.get, reverse=True)]
    for size, tags in surfaces:
        ends = gmsh.model.getBoundary([(dim - 1, tag) for tag in tags], combined=False, oriented=False, recursive=True)
        mesh.setSize([entity for entity in ends if entity[0] == 0], size)
    fields = [size_near(parts[name], dim - 1, f"{size} + 0.2*F") for name, size in arguments.fine.items()]
    for name, entities in tips(parts, network).items():
        if arguments.grade and entities:
            least = sizes[name]**2 / arguments.grade
            formula = f"{sizes[name]}*sqrt(sqrt(F^2 + {least}^2)/{arguments.grade})"
            if name in arguments.fine:
                formula += f"*(1 + (F/{arguments.grade})^2)"  # back to the size of the others
            fields.append(size_near(entities, dim - 2, formula))
    if not fields:
        return
    smallest = mesh.field.add("Min")
    mesh.field.setNumbers(smallest, "FieldsList", fields)
    mesh.field.setAsBackgroundMesh(smallest)
    gmsh.option.setNumber("Mesh.MeshSizeMax", arguments.far or arguments.size)
    if arguments.grade:
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)  # small cells at tips would spread


def generate(network, arguments):
    dim = len(network.low)
    parts, interfaces, rock = fragment(network, arguments.layer)
    name_groups(network, parts, rock)
    set_sizes(parts, interfaces, network, arguments)
    if arguments.quads:
        gmsh.option.setNumber("Mesh.RecombineAll", 1)
    gmsh.model.mesh.generate(dim)
    for _ in range(arguments.refine):
        gmsh.model.mesh.refine()
    return sum(len(tags) for tags in gmsh.model.mesh.getElements(dim)[1])


def named_size(text):
    name, _, value = text.rpartition("=")
    try:
        size = float(value)
    except ValueError:
        size = math.nan
    if not size > 0 or text.startswith("="):
        raise argparse.ArgumentTypeError(f"{text} is neither H nor NAME=H with a positive size.")
    return name, size


def layer(text):
    """Z or Z=H: the level and the size, None when not given."""
    level, _, size = text.partition("=")
    try:
        return float(level), float(size) if size else None
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text} is neither Z nor Z=H.") from None


def parse():
    parser = argparse.ArgumentParser(prog="scripts/mesh_network", description=__doc__.split("\n")[0])
    parser.add_argument("network", type=Path, metavar="SCENE.yaml|SEGMENTS.csv",
                        help="fractures by points, and the box if the scene has mesh.box; or rows FID,X1,Y1,X2,Y2 or FID,X,Y")
    parser.add_argument("-o", dest="output", type=Path, required=True, metavar="MESH.msh", help="mesh to write (msh 4.1, text)")
    parser.add_argument("--size", type=float, required=True, help="cell size on fractures [m]")
    parser.add_argument("--far", type=float, help="cell size at the corners of the box [m] (default: --size)")
    parser.add_argument("--grade", type=float, metavar="R",
                        help="make cells smaller towards tips [m]: size sqrt(d/R) at the distance d, down to size^2/R (default: no)")
    parser.add_argument("--fine", type=named_size, action="append", default=[], metavar="[NAME=]H",
                        help="cell size on one fracture, or on all [m], from which cells grow by a fifth of the distance; may be repeated")
    parser.add_argument("--layer", type=layer, action="append", default=[], metavar="Z[=H]",
                        help="interface between layers at the level Z of the last axis, cells on it of size H [m] (default: --far); may be repeated")
    parser.add_argument("--box", type=float, nargs="+", help="XMIN YMIN XMAX YMAX, or six numbers in 3D [m] (default: mesh.box)")
    parser.add_argument("--refine", type=int, default=0, metavar="N", help="halve all edges N times, for meshes that are nested")
    parser.add_argument("--quads", action="store_true", help="pair triangles into quadrilaterals where it can be done well")
    arguments = parser.parse_args()
    for name in ("size", "far", "grade"):
        value = getattr(arguments, name)
        if value is not None and not value > 0:
            parser.error(f"--{name} is {value}; it must be positive.")
    if arguments.box and len(arguments.box) not in (4, 6):
        parser.error(f"--box has {len(arguments.box)} numbers; give 4 (2D) or 6 (3D).")
    if not arguments.network.exists():
        parser.error(f"{arguments.network} does not exist.")
    arguments.fine, arguments.layer = dict(arguments.fine), dict(arguments.layer)
    return arguments


def main():
    arguments = parse()
    network = read_network(arguments)
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Verbosity", 2)  # errors and warnings
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    try:
        cells = generate(network, arguments)
        gmsh.write(str(arguments.output))
    except Exception as error:  # Gmsh throws nothing more special.
        raise SystemExit(f"mesh_network: Gmsh says: {error}.") from error
    gmsh.finalize()
    print(f"wrote {arguments.output}: {cells} cells, {len(network.fractures)} fractures")


if __name__ == "__main__":
    main()
