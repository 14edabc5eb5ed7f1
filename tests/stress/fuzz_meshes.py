#!/usr/bin/env python3
"""Valid meshes, damaged: each is read or refused in one sentence with place and remedy, and never crashes or holds up the program.

usage: fuzz_meshes.py [--cases 1000] [--seed 1] [--keep FOLDER]
Gmsh files of versions 2.2 and 4.1, as text and binary, and native files, in 2D and 3D; a mesh that is read is also set up for rock and fluid.
"""

import argparse
import os
import random
import re
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

from hdf5_tables import Tables
from input_reader import judge
from line_edits import repeat_line, swap_lines

CRACK = Path(__file__).resolve().parents[2] / "examples/sneddon/crack_0.04.msh"
SCENE = """name: damaged
mesh: {{file: mesh}}
materials: [{{young: 1e9, poisson: 0.25, permeability: 1e-14}}]
mechanics: {{boundary: [{{on: all, displacement: [{zeros}]}}]}}
{contact}flow: {{boundary: [{{on: all, pressure: 0}}]}}
"""
BOX = """name: whole
mesh: {{box: {{min: [{zeros}], max: [{ones}], cells: [{counts}], shape: {shape}}}, write: mesh.h5}}
fractures: [{{name: crack, points: {points}}}]
materials: [{{young: 1e9, poisson: 0.25}}]
mechanics: {{boundary: [{{on: all, displacement: [{zeros}]}}]}}
contact: {{law: frictionless}}
"""
NATIVE = [(2, "polygons", "4, 4", "[[0.25, 0.5], [0.75, 0.5]]"), (2, "triangles", "4, 4", "[[0.25, 0.5], [0.75, 0.5]]"),
          (3, "tets", "2, 2, 2", "[[0, 0, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0.5], [0, 0.5, 0.5]]"),
          (3, "hexahedra", "2, 2, 2", "[[0, 0, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0.5], [0, 0.5, 0.5]]")]
TABLES = ["/nodes", "/face_nodes/offsets", "/face_nodes/values", "/cell_faces/offsets", "/cell_faces/values", "/face_cells", "/cell_region",
          "/face_tag", "/face_fracture", "/fracture_length", "/face_tip_distance"]
REALS = [float("nan"), float("inf"), -float("inf"), 1e308, -1e308, 1e-320, 0.0, -1.0, 1e9]
INTEGERS = [-1, -2, 0, 1, 7, 2**31 - 1, -2**31, 1000000]
TOKENS = ["nan", "inf", "-1", "0", "2147483648", "4294967297", "9" * 25, "1e308", "x", "", "1.5", "-0", "16", "2000000000", "$End"]


def grid(dim):
    """Nodes and elements (type, group, nodes) of a small grid: quadrilaterals and triangles, or hexahedra and prisms."""
    n = 3
    sizes = (n + 1,) * dim
    number = {}
    nodes = []
    for k in range(sizes[2] if dim == 3 else 1):
        for j in range(sizes[1]):
            for i in range(sizes[0]):
                number[i, j, k] = len(nodes) + 1
                nodes.append((i / n, j / n, k / n))
    elements = []
    for k in range(n if dim == 3 else 1):
        for j in range(n):
            for i in range(n):
                low = [number[p] for p in ((i, j, k), (i + 1, j, k), (i + 1, j + 1, k), (i, j + 1, k))]
                up = [number[p] for p in ((i, j, k + 1), (i + 1, j, k + 1), (i + 1, j + 1, k + 1), (i, j + 1, k + 1))] if dim == 3 else []
                halves = ((0, 1, 2), (0, 2, 3))
                if i == 0:
                    elements += [(6 if up else 2, 1, [row[c] for row in (low, up) if row for c in half]) for half in halves]
                else:
                    elements.append((5 if up else 3, 1, low + up))
    bottom = [(1, 2, [number[i, 0, 0], number[i + 1, 0, 0]]) for i in range(n)]
    elements += bottom if dim == 2 else [(3, 2, [number[p] for p in ((1, j, 0), (2, j, 0), (2, j + 1, 0), (1, j + 1, 0))]) for j in range(n)]
    return nodes, elements


def names(dim):
    return f'$PhysicalNames\n2\n{dim - 1} 2 "bottom"\n{dim} 1 "rock"\n$EndPhysicalNames\n'


def gmsh_22(dim):
    nodes, elements = grid(dim)
    lines = [f"{i} {x} {y} {z}" for i, (x, y, z) in enumerate(nodes, 1)]
    rows = [f"{i} {kind} 2 {group} 1 {' '.join(map(str, corners))}" for i, (kind, group, corners) in enumerate(elements, 1)]
    text = "\n".join(["$MeshFormat", "2.2 0 8", "$EndMeshFormat", names(dim) + "$Nodes", str(len(nodes)), *lines, "$EndNodes",
                      "$Elements", str(len(rows)), *rows, "$EndElements", ""])
    return text.encode()


def gmsh_22_binary(dim):
    nodes, elements = grid(dim)
    raw = b"$MeshFormat\n2.2 1 8\n" + struct.pack("i", 1) + b"\n$EndMeshFormat\n" + names(dim).encode() + b"$Nodes\n%d\n" % len(nodes)
    raw += b"".join(struct.pack("=i3d", i, *x) for i, x in enumerate(nodes, 1)) + b"\n$EndNodes\n$Elements\n%d\n" % len(elements)
    for i, (kind, group, corners) in enumerate(elements, 1):
        raw += struct.pack(f"=3i3i{len(corners)}i", kind, 1, 2, i, group, 1, *corners)
    return raw + b"\n$EndElements\n"


def gmsh_41_binary(dim):
    nodes, elements = grid(dim)
    low, high = (0.0,) * 3, (1.0, 1.0, float(dim == 3))
    entity = struct.pack("=i6dQiQ", 1, *low, *high, 1, 1, 0), struct.pack("=i6dQiQ", 1, *low, *high, 1, 2, 0)
    counts = [0, 0, 0, 0]
    counts[dim - 1] = counts[dim] = 1
    raw = b"$MeshFormat\n4.1 1 8\n" + struct.pack("i", 1) + b"\n$EndMeshFormat\n" + names(dim).encode()
    raw += b"$Entities\n" + struct.pack("=4Q", *counts) + entity[1] + entity[0] + b"\n$EndEntities\n"
    raw += b"$Nodes\n" + struct.pack("=4Q3iQ", 1, len(nodes), 1, len(nodes), dim, 1, 0, len(nodes))
    raw += struct.pack(f"={len(nodes)}Q", *range(1, len(nodes) + 1)) + b"".join(struct.pack("=3d", *x) for x in nodes) + b"\n$EndNodes\n"
    blocks = {}
    for i, (kind, group, corners) in enumerate(elements, 1):
        blocks.setdefault((dim if group == 1 else dim - 1, kind), []).append((i, *corners))
    raw += b"$Elements\n" + struct.pack("=4Q", len(blocks), len(elements), 1, len(elements))
    for (of, kind), rows in blocks.items():
        raw += struct.pack("=3iQ", of, 1, kind, len(rows)) + b"".join(struct.pack(f"={len(row)}Q", *row) for row in rows)
    return raw + b"\n$EndElements\n"


# What is done to the bytes of any file


def cut(dice, raw):
    return raw[:dice.choice((0, 1, dice.randrange(len(raw)), dice.randrange(len(raw)), len(raw) - 1))]


def overwrite(dice, raw):
    raw = bytearray(raw)
    for _ in range(dice.choice((1, 4, 32))):
        raw[dice.randrange(len(raw))] = dice.choice((0, 255, 128, dice.randrange(256)))
    return bytes(raw)


def blank(dice, raw):
    first, length = dice.randrange(len(raw)), dice.choice((4, 64, 1024))
    return raw[:first] + bytes(len(raw[first:first + length])) + raw[first + length:]


def repeat(dice, raw):
    first, length = dice.randrange(len(raw)), dice.choice((4, 16, 256))
    return raw[:first] + raw[first:first + length] + raw[first:]


def integer(dice, raw):
    """A number that may be a count, an index or part of a coordinate."""
    first = dice.randrange(max(1, len(raw) - 8))
    new = struct.pack(*dice.choice((("=i", dice.choice(INTEGERS)), ("=q", dice.choice((-1, 2**31, 2**32 + 1, 2**62))), ("=d", dice.choice(REALS)))))
    return raw[:first] + new + raw[first + len(new):]


BYTES = [cut, cut, overwrite, overwrite, blank, repeat, integer]

# What is done to the lines of a text


def lines_of(edit):
    def mutate(dice, raw):
        lines = raw.decode("latin1").split("\n")
        for _ in range(dice.choice((1, 1, 1, 3))):
            edit(dice, lines)
        return "\n".join(lines).encode("latin1")
    return mutate


def drop(dice, lines):
    del lines[dice.randrange(len(lines) - 1)]


def copy_over(dice, lines):
    """Two nodes in one place, two elements with the same nodes."""
    i, j = dice.randrange(len(lines)), dice.randrange(len(lines))
    lines[i] = lines[j] if " " not in lines[i] else lines[i].split(" ", 1)[0] + " " + lines[j].split(" ", 1)[-1]


def token(dice, lines):
    i = dice.choice([i for i, line in enumerate(lines) if line])
    words = lines[i].split(" ")
    words[dice.randrange(len(words))] = dice.choice(TOKENS)
    lines[i] = " ".join(words)


def turn(dice, lines):
    """An element with its nodes in another order, a node with its coordinates exchanged."""
    i = dice.choice([i for i, line in enumerate(lines) if line.count(" ") >= 2])
    words = lines[i].split(" ")
    head, tail = words[:dice.choice((0, 1, 5))], words[dice.choice((0, 1, 5)):]
    dice.shuffle(tail)
    lines[i] = " ".join(head + (tail if dice.random() < 0.7 else tail[::-1]))


LINES = [lines_of(edit) for edit in (drop, repeat_line, swap_lines, copy_over, token, token, token, turn, turn)]

# What is done to the tables of a native file


def table(dice, raw, tables):
    """A few entries of a table: other numbers, or exchanged."""
    name, (first, length) = dice.choice(tables)
    real = name in ("/nodes", "/fracture_length", "/face_tip_distance")
    size, form = (8, "=d") if real else (4, "=i")
    raw = bytearray(raw)
    for _ in range(dice.choice((1, 1, 2, 5))):
        at, other = (first + size * dice.randrange(length // size) for _ in range(2))
        new = bytes(raw[other:other + size]) if dice.random() < 0.5 else struct.pack(form, dice.choice(REALS if real else INTEGERS))
        raw[at:at + size] = new
    return bytes(raw)


def native_bases(folder):
    bases = []
    for dim, shape, counts, points in NATIVE:
        scene, out = folder / f"whole_{dim}_{shape}.yaml", folder / f"whole_{dim}_{shape}"
        scene.write_text(BOX.format(zeros=", ".join("0" * dim), ones=", ".join("1" * dim), counts=counts, shape=shape, points=points))
        subprocess.run([os.environ["POLYSLIP"], scene, "-o", out], check=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        with Tables(out / "mesh.h5") as file:
            places = [(name, file.bytes_of(name)) for name in TABLES]
        bases.append((dim, "h5", (out / "mesh.h5").read_bytes(), [table_edit(places)] * 6))
    return bases


def table_edit(places):
    return lambda dice, raw: table(dice, raw, places)


def all_bases(folder):
    """(dimension, ending, bytes, mutations besides those of any bytes)"""
    bases = [(2, "msh", CRACK.read_bytes(), LINES)]
    for dim in (2, 3):
        bases += [(dim, "msh", gmsh_22(dim), LINES), (dim, "msh", gmsh_22_binary(dim), []), (dim, "msh", gmsh_41_binary(dim), [])]
    return bases + native_bases(folder)


def mutant(seed, number, bases):
    dice = random.Random(f"{seed}/{number}")
    dim, ending, raw, own = bases[number % len(bases)]
    for _ in range(dice.choice((1, 1, 2))):
        raw = dice.choice(own if own and dice.random() < 0.75 else BYTES)(dice, raw) if len(raw) > 8 else raw
    return dim, ending, raw


def job(folder, name, dim, ending, raw):
    mesh = folder / f"{name}.{ending}"
    mesh.write_bytes(raw)
    return name, f"{folder}/scene_{dim}_{ending}.yaml\tmesh.file={mesh}"


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--cases", type=int, default=1000)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--keep", type=Path)
    chosen = arguments.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = chosen.keep or Path(temporary)
        folder.mkdir(exist_ok=True)
        for dim in (2, 3):
            for ending, contact in (("msh", ""), ("h5", "contact: {law: frictionless}\n")):
                (folder / f"scene_{dim}_{ending}.yaml").write_text(SCENE.format(zeros=", ".join("0" * dim), contact=contact))
        bases = all_bases(folder)
        faults, ends = judge([job(folder, f"base_{i}", *base[:3]) for i, base in enumerate(bases)], "(?!)", folder)
        if faults or set(ends) != {"accepted"}:
            sys.exit("the meshes to be damaged are not valid")
        jobs = [job(folder, f"mesh_{i}", *mutant(chosen.seed, i, bases)) for i in range(chosen.cases)]
        place = (rf"({re.escape(str(folder))}/mesh_\d+\.(msh|h5)|-set mesh\.file=\S+ \(mesh.file\))"
                 r"(, (section|dataset) [^:\n]+|(:|,) cells? [^:\n]+)?: ")
        faults, ends = judge(jobs, place, folder)
    print(f"{chosen.cases} damaged meshes: " + ", ".join(f"{count} {end}" for end, count in ends.most_common()) + f"; {faults} faults")
    sys.exit(faults > 0)


main()
