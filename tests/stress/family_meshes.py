"""Families of meshes: a linear and a curved displacement, and a linear pressure in anisotropic rock, all exact, on each ugly mesh."""

from pathlib import Path

import meshes
from catalogue import Case, Family, merged

AXES = "xyz"
SQUEEZE = {2: ["-1e-3*x + 2e-4*y", "1e-4*x - 1.1e-3*y"],
           3: ["-1e-3*x + 2e-4*y", "1e-4*x - 1.1e-3*y + 5e-5*z", "1e-4*x - 9e-4*z"]}
SQUEEZE_GRADIENT = {2: [[-1e-3, 2e-4], [1e-4, -1.1e-3]], 3: [[-1e-3, 2e-4, 0], [1e-4, -1.1e-3, 5e-5], [1e-4, 0, -9e-4]]}
MU = LAMBDA = 4e8  # young 1e9, poisson 0.25


def linear(d):
    """A squeeze in which every fracture with friction 1 sticks."""
    return {"materials": [{"young": 1e9, "poisson": 0.25}], "mechanics": {"boundary": [{"on": "all", "displacement": SQUEEZE[d]}]},
            "exact": {"displacement": SQUEEZE[d], "gradient": SQUEEZE_GRADIENT[d]}}


def curved(d):
    """u = 1e-3 (x^2 + y^2, x y): div sigma = mu lap u + (mu + lambda) grad div u is constant, with div u = 3e-3 x."""
    u = ["1e-3*(x^2 + y^2)", "1e-3*x*y", "0"][:d]
    force = [-1e-3 * (4 * MU + 3 * (MU + LAMBDA)), 0, 0][:d]
    gradient = [["2e-3*x", "2e-3*y", 0], ["1e-3*y", "1e-3*x", 0], [0, 0, 0]]
    return {"materials": [{"young": 1e9, "poisson": 0.25}],
            "mechanics": {"body_force": force, "boundary": [{"on": "all", "displacement": u}]},
            "exact": {"displacement": u, "gradient": [row[:d] for row in gradient[:d]]}}


def darcy(d):
    """p = 1 + 2x - 3y (+ z) in rock of the permeability K: V = -K grad p, eta = 1."""
    K = [[4, 1, 0], [1, 2, 0.5], [0, 0.5, 3]]
    K = [row[:d] for row in K[:d]]
    slope = [2, -3, 1][:d]
    p = "1 + 2*x - 3*y" + (" + z" if d == 3 else "")
    return {"materials": [{"permeability": K}], "fluid": {"viscosity": 1},
            "flow": {"stationary": "true", "boundary": [{"on": "all", "pressure": p}]},
            "exact": {"pressure": p, "flux": [-sum(k * g for k, g in zip(row, slope)) for row in K]}}


PROBLEMS = {"linear": (linear, 1e-8), "curved": (curved, 0.25), "fluid": (darcy, 1e-8)}


def box(shape, n, **more):
    d = 2 if shape in ("quads", "triangles", "polygons") else 3
    return {"shape": shape, "min": [0] * d, "max": [1] * d, "cells": [n] * d} | more


# name: (dimension, mesh, what differs by problem); a mesh is a function, or a box of the program's own.
BENT = {"fluid": {"expect": "refused", "says": "flow needs planar faces"}}
NOT_STAR_SHAPED = {"fluid": {"expect": "refused", "says": "star-shaped"}}
FLAT = {"fluid": {"bound": 1e-6}}
COARSE = {"linear": {"bound": 1e-7}, "curved": {"bound": 0.3}, "fluid": {"bound": 1e-6}}
MESHES = {
    **{f"aspect ratio {a:g}, {shape}": (d, box(shape, 4, max=[1, 1 / a, 1][:d]), FLAT if a > 1e3 else {})
       for a in (1, 1e2, 1e4) for d, shape in ((2, "quads"), (2, "triangles"), (3, "hexahedra"), (3, "tets"))},
    "aspect ratio 10000, not convex": (2, lambda: meshes.stretched(meshes.chevrons(2, 4, 0.3), 1, 1e-4), {}),
    **{f"slivers, eps {e:g}": (3, lambda e=e: meshes.slivers(2, e), COARSE) for e in (1e-2, 1e-4, 1e-6)},
    **{f"edges {e:g} of the cell, {d}D": (d, lambda d=d, e=e: meshes.split_edges(d, 4, e), {}) for e in (1e-3, 1e-6) for d in (2, 3)},
    **{f"corners cut by {e:g}, {d}D": (d, lambda d=d, e=e: meshes.cut_corners(d, 4, e), {}) for e in (1e-3, 1e-6) for d in (2, 3)},
    **{f"warped by {s:g}": (3, box("warped", 5, shake=s), BENT) for s in (0.1, 0.3, 0.45)},
    **{f"warped by {s:g}, cut": (3, box("cut", 5, shake=s), NOT_STAR_SHAPED if s > 0.4 else {}) for s in (0.1, 0.3, 0.45)},
    **{f"hanging nodes, {d}D": (d, lambda d=d: meshes.hanging(d, 4), {}) for d in (2, 3)},
    **{f"not convex, depth {b:g}, {d}D": (d, lambda d=d, b=b: meshes.chevrons(d, 4, b), NOT_STAR_SHAPED if b > 0.7 else {})
       for b in (0.2, 0.45, 0.8) for d in (2, 3)},
    **{f"a cell of {n + 2 * (d == 3)} faces, {d}D": (d, lambda d=d, n=n: meshes.ring(d, n), {}) for d, n in ((2, 40), (3, 38), (2, 400))},
}
QUICK = ("aspect ratio 10000, t", "slivers, eps 1e-06", "corners cut by 1e-06", "warped by 0.3", "hanging", "not convex, depth 0.45", "a cell of 40")


def mesh_case(name, problem):
    d, mesh, differs = MESHES[name]
    make, bound = PROBLEMS[problem]
    scene = {"name": "stress", **make(d)}
    if isinstance(mesh, dict):
        scene["mesh"] = {"box": mesh}
    return Case(f"{name}: {problem}", scene, mesh if callable(mesh) else None, quick=name.startswith(QUICK) and problem != "curved",
                **{"bound": bound} | differs.get(problem, {}))


# The same linear field by multigrid: 12 cells a side, where coarse levels matter. What counts is the number of iterations.
AMG = ("-options_file", str(Path(__file__).resolve().parents[2] / "options/amg.opts"))


def multigrid_case(name, mesh, **overrides):
    return Case(name, merged({"name": "stress", **linear(3), "mesh": {"box": mesh}}, overrides), bound=1e-6, options=AMG)


MULTIGRID = [multigrid_case(f"{shape}, aspect ratio {a:g}", box(shape, 12, max=[1, 1, 1 / a]))
             for shape in ("hexahedra", "tets") for a in (1, 10, 100, 1000)]
MULTIGRID += [multigrid_case(f"warped by {s:g}", box("warped", 12, shake=s)) for s in (0.1, 0.45)]
MULTIGRID += [multigrid_case("polyhedra", box("polyhedra", 10)), multigrid_case("prisms", box("prisms", 12))]
MULTIGRID += [multigrid_case(f"hexahedra, nu = {nu:g}", box("hexahedra", 12), materials=[{"young": 1e9, "poisson": nu}])
              for nu in (0.25, 0.49, 0.4999)]

FAMILIES = [Family("multigrid", "a linear displacement by multigrid (options/amg.opts), 12 cells a side", {}, MULTIGRID),
            Family("meshes", "ugly cells", {}, [mesh_case(name, problem) for name in MESHES for problem in PROBLEMS])]
