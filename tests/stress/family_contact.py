"""Families of contact over time: a block of constant stress on a fracture, pushed, pulled and sheared from its top, and what it must do."""

from catalogue import Case, Family, both, history

MU = LAMBDA = 4e8             # young 1e9, poisson 0.25
PRESSURE = 1e6                # lam_n of the closed fracture [Pa]
DOWN = PRESSURE / (2 * MU + LAMBDA)   # of the top, on a height of 1 [m]


def table(values):
    """An expression of t that takes the values at t = 1, 2, ..."""
    text = repr(values[-1])
    for k in range(len(values) - 1, 0, -1):
        text = f"t < {k + 0.5} ? {values[k - 1]!r} : ({text})"
    return text


def block(d, cells, across, up, friction):
    """The top at (across, up) at t = 1, 2, ...; sides with the tractions of a constant stress, so that the exact solution is a rigid jump on the
    fracture half way up and a linear displacement above and below it."""
    tau, slip, opening, sealed = respond(across, up, friction)
    stress = [LAMBDA * min(y, 0) for y in up]
    side = {"left": -1, "right": 1}
    rules = [{"on": "bottom", "displacement": [0] * d},
             {"on": "top", "displacement": [table(across), *[0] * (d - 2), table(up)]}]
    rules += [{"on": name, "traction": [f"{sign}*({table(stress)})", *[0] * (d - 2), f"{sign}*({table(tau)})"]} for name, sign in side.items()]
    if d == 3:
        rules += [{"on": ["front", "back"], "displacement": [None, 0, None]}]
    low, high = [0] * d, [1] * d
    corners = [[0, 0.5], [1, 0.5]] if d == 2 else [[0, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0, 1, 0.5]]
    scene = {"mesh": {"box": {"min": low, "max": high, "cells": cells}}, "fractures": [{"name": "f", "points": corners}],
             "mechanics": {"boundary": rules}, "contact": {"friction": friction}, "time": {"end": len(up), "step": 1}}
    return scene, both(history(DOWN, max_slip=slip, max_opening=opening),
                       history(PRESSURE, w_normal=sealed, w_tangential=[abs(t) for t in tau]))


def respond(across, up, friction):
    """Shear stress, slip so far, opening and lam_n at the ends of the steps: a spring of stiffness mu in series with a slider."""
    offset, rows = 0.0, []
    for x, y in zip(across, up):
        bound = friction * PRESSURE * max(-y, 0) / DOWN
        tau = MU * (x - offset)
        if abs(tau) > bound:
            tau = bound if tau > 0 else -bound
            offset = x - tau / MU
        rows.append((tau, abs(offset), max(y, 0), PRESSURE * max(-y, 0) / DOWN))
    return map(list, zip(*rows))


def case(name, across, up, friction, d=2, cells=None, quick=False):
    scene, measure = block(d, cells or ([4, 4] if d == 2 else [3, 3, 4]), across, up, friction)
    return Case(name, scene, measure=measure, bound=1e-7, quick=quick)


BASE = {"name": "stress", "materials": [{"young": 1e9, "poisson": 0.25}], "output": {"every": 1000, "windows": [{"name": "w", "fracture": "f"}]}}
SHEAR = 2 * PRESSURE / MU  # twice what F = 1 can hold
LOOP = [SHEAR * x for x in (0.2, 0.6, 1, 0.5, 0, -0.5, -1, -0.5, 0, 0.5, 1)]
CYCLE = [-DOWN, DOWN, -DOWN, DOWN / 2, DOWN, -2 * DOWN, 1e-3 * DOWN, -DOWN]

FAMILIES = [
    Family("friction", "F from 0 to 100, sheared by twice what F = 1 holds", BASE,
           [case(f"F = {f:g}, {d}D", [SHEAR], [-DOWN], f, d, quick=f in (0, 100) and d == 2)
            for f in (0, 1e-6, 0.01, 0.3, 1, 1.9, 10, 100) for d in (2, 3)]),
    Family("cycles", "histories of load: loops of friction, closing and opening, many faces at once", BASE,
           [case(f"hysteresis loop, F = {f:g}, {d}D", LOOP, [-DOWN] * len(LOOP), f, d, quick=f == 0.6 and d == 2) for f in (0.1, 0.6) for d in (2, 3)]
           + [case("hysteresis loop with changing pressure", LOOP, [-DOWN * (1 + 0.5 * (k % 3)) for k in range(len(LOOP))], 0.3)]
           + [case(f"opening and closing, F = {f:g}, {d}D", [0] * len(CYCLE), CYCLE, f, d, quick=d == 2) for f in (0, 0.6) for d in (2, 3)]
           + [case("sheared while open, then closed", [0, SHEAR, SHEAR, -SHEAR, -SHEAR], [-DOWN, DOWN, -DOWN, DOWN, -DOWN], 0.6)]
           + [case(f"all {n[0]} faces stick, slip, open and close, a step each", [0.1 * SHEAR, SHEAR, SHEAR, SHEAR],
                   [-DOWN, -DOWN, DOWN, -DOWN], 0.5, cells=n)
              for n in ([64, 16], [256, 8])]
           + [Case("a block slides free after its last stick", {
               "mesh": {"box": {"min": [0, 0], "max": [1, 1], "cells": [8, 8]}}, "fractures": [{"name": "f", "points": [[0, 0.5], [1, 0.5]]}],
               "mechanics": {"boundary": [{"on": "bottom", "displacement": [0, 0]}, {"on": "top", "traction": ["1e6*t", -1e6]}]},
               "contact": {"friction": 0.6}, "time": {"end": 1, "step": 0.1, "smallest_step": 0.01}},
               expect="refused", says="free to move along (1, 0, 0)")]),
]
