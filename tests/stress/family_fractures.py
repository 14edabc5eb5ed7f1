"""Families of fracture geometry: a squeeze in which all faces stick, exact, and slips against a finer mesh."""

import math

import meshes
from catalogue import Case, Family, history, refined
from family_meshes import LAMBDA, MU, linear

SQUARE = {"min": [0, 0], "max": [1, 1], "shape": "quads"}
CUBE = {"min": [0, 0, 0], "max": [1, 1, 1], "shape": "hexahedra"}


def fractures(*pieces):
    return [{"name": f"f{i}", "points": points} for i, points in enumerate(pieces)]


def plane(axis, at, low=0, high=1):
    """Corners of a square across an axis of the cube."""
    rest = [(low, low), (high, low), (high, high), (low, high)]
    return [[*pair[:axis], at, *pair[axis:]] for pair in rest]


def sticking(d, box, pieces, normal=None, mesh=None):
    """(scene, mesh): no jump anywhere, so the linear field is exact; and its traction too, where all
    fractures have one normal n^+ (out of the + side, which is on the left of a polyline)."""
    scene = {"name": "stress", **linear(d), "fractures": fractures(*pieces), "contact": {"friction": 1}}
    if box:
        scene["mesh"] = {"box": box}
    if normal:
        gradient = scene["exact"]["gradient"]
        strain = [[(gradient[i][j] + gradient[j][i]) / 2 for j in range(d)] for i in range(d)]
        trace = sum(strain[i][i] for i in range(d))
        traction = [2 * MU * sum(strain[i][j] * normal[j] for j in range(d)) + LAMBDA * trace * normal[i] for i in range(d)]
        pressure = -sum(a * b for a, b in zip(traction, normal))
        scene["exact"] |= {"multiplier_normal": pressure,
                           "multiplier_tangential": [-(a + pressure * b) for a, b in zip(traction, normal)]}
    return scene, mesh


def ray(degrees, radius=1):
    return [radius * math.cos(math.radians(degrees)), radius * math.sin(math.radians(degrees))]


def fan(d, degrees):
    """Two fractures from the middle of a disc to three quarters of its radius, so many degrees apart."""
    ends = [ray(0, 0.75), ray(degrees, 0.75)]
    pieces = [[[0, 0], end] for end in ends] if d == 2 else [[[0, 0, 0], [*end, 0], [*end, 1], [0, 0, 1]] for end in ends]
    return sticking(d, None, pieces, mesh=lambda: meshes.fan(d, degrees))


STICKING = {
    "X of two, four copies of a node": sticking(2, SQUARE | {"cells": [8, 8]}, [[[0.25, 0.5], [0.75, 0.5]], [[0.5, 0.25], [0.5, 0.75]]]),
    "X through the boundary, 2D": sticking(2, SQUARE | {"cells": [8, 8]}, [[[0, 0.5], [1, 0.5]], [[0.5, 0], [0.5, 1]]]),
    "T and L, triangles": sticking(2, SQUARE | {"cells": [8, 8], "shape": "triangles"},
                                   [[[0.25, 0.5], [0.75, 0.5]], [[0.5, 0.5], [0.5, 0.875]], [[0.75, 0.5], [0.75, 0.25]]]),
    "three planes through one point": sticking(3, CUBE | {"cells": [4] * 3}, [plane(axis, 0.5, 0.25, 0.75) for axis in range(3)]),
    "three planes through the cube": sticking(3, CUBE | {"cells": [4] * 3}, [plane(axis, 0.5) for axis in range(3)]),
    "three planes, tets": sticking(3, CUBE | {"cells": [4] * 3, "shape": "tets"}, [plane(axis, 0.5, 0.25, 0.75) for axis in range(3)]),
    **{f"{a:g} degrees apart, {d}D": fan(d, a) for a in (5, 1, 0.1) for d in (2, 3)},
    **{f"needles 1:{a:g}": sticking(3, CUBE | {"max": [1, 1, 4 / a], "cells": [4, 4, 4]},
                                    [[[0, 0.5, 0], [1, 0.5, 0], [1, 0.5, 4 / a], [0, 0.5, 4 / a]]], [0, 1, 0]) for a in (1e2, 1e4)},
    "tips one cell apart": sticking(2, SQUARE | {"cells": [8, 8]}, [[[0.25, 0.5], [0.5, 0.5]], [[0.625, 0.5], [0.875, 0.5]]], [0, -1]),
    "one face only": sticking(2, SQUARE | {"cells": [8, 8]}, [[[0.5, 0.5], [0.625, 0.5]]], [0, -1]),
    "one face only, 3D": sticking(3, CUBE | {"cells": [4] * 3},
                                  [[[0.5, 0.5, 0.5], [0.75, 0.5, 0.5], [0.75, 0.75, 0.5], [0.5, 0.75, 0.5]]], [0, 0, -1]),
    "from side to side": sticking(2, SQUARE | {"cells": [8, 8]}, [[[0, 0.5], [1, 0.5]]], [0, -1]),
    "one cell from the boundary": sticking(2, SQUARE | {"cells": [8, 8]}, [[[0, 0.125], [1, 0.125]]], [0, -1]),
    "on all faces of a mesh": sticking(2, SQUARE | {"cells": [5, 5]}, [[[0, i / 5], [1, i / 5]] for i in range(1, 5)]
                                       + [[[i / 5, 0], [i / 5, 1]] for i in range(1, 5)]),
}
QUICK = ("X of", "three planes through one", "5 degrees apart, 2D", "needles 1:10000", "on all faces")

# Shear on top of a bottom that is held; fractures slip.
SHEARED = {"name": "stress", "materials": [{"young": 1e9, "poisson": 0.25}], "contact": {"friction": 0.2},
           "mechanics": {"boundary": [{"on": "bottom", "displacement": [0, 0]}, {"on": "top", "displacement": [2e-3, -1e-3]}]}}


def slipping(n, finer, pieces):
    return {"scene": {"mesh": {"box": SQUARE | {"cells": [n, n]}}, "fractures": fractures(*pieces)},
            "finer": {"mesh": {"box": SQUARE | {"cells": [finer, finer]}}}}


SLIPPING = {
    "slip, tips one cell apart": slipping(32, 128, [[[0.1875, 0.5], [0.5, 0.5]], [[0.5625, 0.5], [0.8125, 0.5]]]),
    "slip, X": slipping(32, 128, [[[0.1875, 0.5], [0.8125, 0.5]], [[0.5, 0.25], [0.5, 0.75]]]),
    "slip, T at the boundary": slipping(32, 128, [[[0, 0.5], [0.75, 0.5]], [[0.5, 0.5], [0.5, 0.75]]]),
}

# A fracture cuts off a block, and what holds that.
CUT = {"mesh": {"box": SQUARE | {"cells": [8, 8]}}, "fractures": fractures([[0, 0.5], [1, 0.5]]), "contact": {"friction": 0.6}}


def pushed(tangential, normal, **contact):
    """A block on a fracture, with a load on its top."""
    scene = dict(CUT)
    scene["mechanics"] = {"boundary": [{"on": "bottom", "displacement": [0, 0]}, {"on": "top", "traction": [tangential, -normal]}]}
    return scene | ({"contact": {"friction": None} | contact} if contact else {})


BLOCKS = {
    # It sticks all over: no slip at all, relative to the millimetre that the load presses it down.
    "held by friction": dict(scene=pushed(1e5, 1e6), measure=history(1e-3, max_slip=[0]), bound=1e-12,
                             says="no prescribed displacement holds"),
    "pushed beyond friction": dict(scene=pushed(7e5, 1e6), expect="refused", says="free to move along (1, 0, 0)"),
    "pushed without friction": dict(scene=pushed(1, 1e6, law="frictionless"), expect="refused", says="raise contact.friction. Newton stopped"),
    "resting without friction": dict(scene=pushed(0, 1e6, law="frictionless"), expect="refused", says="free to move along (1, 0, 0)"),
    "pulled off": dict(scene=pushed(0, -1e6), expect="refused", says="raise contact.friction. Newton stopped"),
    "a fracture on the boundary": dict(scene=CUT | {"fractures": fractures([[0, 0], [1, 0]]), "mechanics": pushed(0, 1)["mechanics"]},
                                       expect="refused", says="boundary"),
    "held in y only": dict(scene=CUT | {"fractures": None, "contact": None, "mechanics": {"boundary": [
        {"on": "bottom", "displacement": [None, 0]}, {"on": "top", "displacement": [None, 0]}]}},
        expect="refused", says="free to move"),
}

FAMILIES = [
    Family("fractures", "networks that stick in a linear field, that slip, and that cut blocks off", SHEARED,
           [Case(name, {"mechanics": None, "materials": None, "contact": None} | scene, mesh, bound=1e-7, quick=name.startswith(QUICK))
            for name, (scene, mesh) in STICKING.items()]
           + [Case(name, measure=refined("slip_integral"), bound=0.2, reference="refined", **case) for name, case in SLIPPING.items()]
           + [Case(name, quick=case.get("expect") == "refused" and "pushed" in name, **case) for name, case in BLOCKS.items()]),
]
