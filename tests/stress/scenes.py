"""The random scenes of scripts/stress: case (dimension, number) of a seed always is the same scene.

Most cases take their whole load in one step from zero; the load does not depend on time there, so that the step cannot be cut. The
others take three steps with the load turned round in the second.
"""

import json
import random
from dataclasses import dataclass, field

import networks

SHAPES = {2: ("network", "quads", "triangles", "network", "polygons"),
          3: ("hexahedra", "tets", "prisms", "polyhedra", "warped", "tets", "cut")}
COUNTS = {"quads": (22, 44), "triangles": (16, 32), "polygons": (20, 36), "hexahedra": (8, 11), "tets": (5, 8), "prisms": (7, 11),
          "polyhedra": (7, 8), "warped": (7, 10), "cut": (7, 9)}
SHAKEN = ("polygons", "polyhedra", "warped", "cut")
SIDES = {2: ("left", "right"), 3: ("left", "right", "front", "back")}


@dataclass
class Case:
    name: str
    shape: str
    scene: dict
    frictions: list = field(default_factory=list)
    steps: int = 1
    draws: int = 1  # networks drawn until all blocks were held

    @property
    def fractures(self):
        return len(self.scene["fractures"])

    @property
    def friction_text(self):
        low, high = min(self.frictions), max(self.frictions)
        return f"{low:.2f}" if low == high else f"{low:.2f}-{high:.2f}"


def short(x):
    """Four digits are random enough."""
    return float(f"{x:.4g}")


def log_uniform(dice, low, high):
    return short(low * (high / low) ** dice.random())


def signed(dice, low, high):
    return dice.choice((-1, 1)) * log_uniform(dice, low, high)


# Geometry


def segments_scene(dice, number, folder, size):
    """Mesh and fractures of segments at any angle; the mesh file goes to `folder`."""
    segments = networks.segment_network(dice, number, *size)
    h = dice.uniform(0.03, 0.045) * size[0] ** 0.5
    if segments is None or not networks.mesh_segments(segments, *size, h, folder):
        return None
    names = [f"fracture_{i}" for i in range(number)]
    return {"mesh": {"file": "mesh.msh"}, "fractures": [{"name": name, "group": name} for name in names]}


def lattice_scene(dice, shape, d, number, size):
    n = dice.randint(*COUNTS[shape])
    counts = tuple(round(n * x / max(size) ** 0.5) for x in size)
    pieces = networks.lattice_network(dice, shape, counts, number)
    if pieces is None:
        return None

    def place(p):
        return [x * i / m for x, i, m in zip(size, p, counts)]

    box = {"min": [0] * d, "max": size, "cells": counts, "shape": shape}
    if shape in SHAKEN:
        box |= {"shake": round(dice.uniform(0.05, 0.2), 3), "seed": dice.randint(1, 10**6)}
    fractures = [{"name": f"fracture_{i}", "points": [place(p) for p in piece.corners()]} for i, piece in enumerate(pieces)]
    return {"mesh": {"box": box}, "fractures": fractures}


def draw_geometry(dice, shape, d, folder):
    """(scene, size of the box, networks drawn)"""
    number = dice.randint(3, 12) if d == 2 else dice.randint(2, 4)
    for draw in range(1, 1001):
        size = (dice.choice((1, 1, 2)), 1) if d == 2 else (1, 1, 1)
        network = shape == "network"
        scene = segments_scene(dice, number, folder, size) if network else lattice_scene(dice, shape, d, number, size)
        if scene is not None:
            return scene, size, draw
    raise RuntimeError(f"No network of {number} fractures on {shape} with all blocks held in 1000 draws.")


# Loads


def top_displacement(dice, d, size):
    """Linear fields on the top side: pressed or pulled with shear, or turned."""
    kind = dice.choices(("press", "pull", "turn"), (5, 2, 3))[0]
    normal = log_uniform(dice, 1e-4, 3e-3) * (1 if kind == "pull" else -1)
    field_ = [f"{signed(dice, 1e-4, 4e-3):g}" for _ in range(d - 1)] + [f"{normal:g}"]
    if kind == "turn":
        x = f"(x - {size[0] / 2:g})"
        field_[-1] += f" + {signed(dice, 5e-4, 5e-3):g}*{x}"
        if d == 3:  # torsion
            twist = signed(dice, 5e-4, 8e-3)
            field_[0] += f" - {twist:g}*(y - 0.5)"
            field_[1] += f" + {twist:g}*{x}"
    return [f"load*({u})" for u in field_]


def boundary(dice, d, size, stress):
    rules = [{"on": "bottom", "displacement": [0] * d}, {"on": "top", "displacement": top_displacement(dice, d, size)}]
    if dice.random() < 0.4:
        for side in SIDES[d]:
            if dice.random() < 0.7:
                rules.append({"on": side, "traction": [f"load*{short(stress * dice.uniform(-1, 1)):g}" for _ in range(d)]})
    return rules


def load_factor(dice, steps):
    """1, or a saw tooth with ends at t = 1, 2, 3."""
    if steps == 1:
        return "1"
    second, third = -round(dice.uniform(0.3, 1.0), 2), round(dice.uniform(0.3, 1.2), 2)
    return f"t <= 1 ? t : t <= 2 ? 1 + ({second} - 1)*(t - 1) : {second} + ({third} - {second})*(t - 2)"


def contact(dice, fractures):
    """(section, coefficients): one friction coefficient, or in a third of the cases one for each fracture."""
    if dice.random() < 2 / 3:
        friction = log_uniform(dice, 0.2, 5)
        return {"friction": friction}, [friction]
    frictions = [log_uniform(dice, 0.2, 5) for _ in fractures]
    return {"fractures": [{"name": f["name"], "friction": c} for f, c in zip(fractures, frictions)]}, frictions


def make_case(seed, d, number, folder):
    """The case, its scene as a tree; a mesh file, where it needs one, is written to `folder`."""
    dice = random.Random(f"{seed}/{d}/{number}")
    shape = SHAPES[d][number % len(SHAPES[d])]
    scene, size, draws = draw_geometry(dice, shape, d, folder)
    steps = 3 if dice.random() < 0.25 else 1
    young, poisson = log_uniform(dice, 1e9, 50e9), round(dice.uniform(0, 0.45), 3)
    stress = young * 1e-3
    section, frictions = contact(dice, scene["fractures"])
    if dice.random() < 0.15:
        section["fracture_pressure"] = f"load*{short(stress * dice.uniform(0, 0.5)):g}"
    scene["materials"] = [{"young": young, "poisson": poisson}]
    scene["define"] = {"load": load_factor(dice, steps)}
    scene["mechanics"] = {"boundary": boundary(dice, d, size, stress)}
    if dice.random() < 0.25:
        scene["mechanics"]["body_force"] = [short(stress * dice.uniform(-1, 1)) for _ in range(d)]
    scene["contact"] = section
    scene["time"] = {"end": steps, "step": 1}
    return Case(f"{d}d_{number}", shape, scene, frictions, steps, draws)


def yaml_text(case, seed):
    """The scene as YAML: a key, or an entry of a list, a line; JSON inside."""
    d, number = case.name.split("_")
    lines = [f"# scripts/stress --seed {seed} --only {d}:{number}", f"name: stress_{case.name}",
             f"description: Random network of {case.fractures} fractures on {case.shape}, friction {case.friction_text}"]
    for key, value in case.scene.items():
        lines += ["", f"{key}:"]
        if isinstance(value, list):
            lines += [f"  - {json.dumps(entry)}" for entry in value]
            continue
        for name, entry in value.items():
            nested = isinstance(entry, list) and entry and isinstance(entry[0], dict)
            lines += [f"  {name}:", *(f"    - {json.dumps(e)}" for e in entry)] if nested else [f"  {name}: {json.dumps(entry)}"]
    return "\n".join(lines) + "\n"
