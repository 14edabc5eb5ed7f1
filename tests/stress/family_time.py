"""Families of rock and fluid in time: a column consolidates under a load on its drained top (Terzaghi)."""

from catalogue import Case, Family, error_of, errors, history, merged

TERMS = (1, 3, 5, 7, 9, 11, 13, 15)
COLUMN = {
    "name": "stress",
    "study": {"n": 16, "H": 10, "load": 1e6, "E": 1e9, "nu": 0.25, "b": 0.9, "S": 1e-10, "k": 1e-14, "eta": 1e-3, "part": 0.1, "steps": 40,
              "Kv": "E*(1 - nu)/((1 + nu)*(1 - 2*nu))", "c": "k/eta/(S + b^2/Kv)", "end": "part*H^2/c"},
    "mesh": {"box": {"min": [0, 0], "max": [1, "H"], "cells": [2, "n"], "shape": "quads"}},
    "materials": [{"young": "E", "poisson": "nu", "biot": "b", "storage": "S", "permeability": "k"}],
    "mechanics": {"boundary": [{"on": ["left", "right"], "displacement": [0, None]}, {"on": "bottom", "displacement": [0, 0]},
                               {"on": "top", "traction": [0, "-load"]}]},
    "fluid": {"viscosity": "eta"}, "flow": {"boundary": [{"on": "top", "pressure": 0}]}, "initial": {"equilibrium": "false"},
    "time": {"end": "end", "step": "end/steps"}, "output": {"every": 1000},
    # p = p_0 sum 4/(m pi) sin(m s) exp(-m^2 w),  u_y = (-load y + b int_0^y p)/K_v
    "define": {"s": "pi*(H - y)/(2*H)", "w": "pi^2/4*c*t/H^2", "p0": "load*b/Kv/(S + b^2/Kv)",
               "p": "4/pi*p0*(" + " + ".join(f"sin({m}*s)/{m}*exp(-{m * m}*w)" for m in TERMS) + ")",
               "int_p": "8/pi^2*H*p0*(" + " + ".join(f"cos({m}*s)/{m * m}*exp(-{m * m}*w)" for m in TERMS) + ")"},
    "exact": {"displacement": [0, "(b*int_p - load*y)/Kv"], "pressure": "p"}}
UNDRAINED = 1e6 * 0.9 / 1.2e9 / (1e-10 + 0.81 / 1.2e9)  # p_0 [Pa]
STIFF = 1e6 / 0.9                                        # p_0 without storage


def coupling(name, quick=False, measure=errors, **study):
    return Case(name, {"study": study}, measure=measure, bound=0.02, quick=quick)


def one_step(part, shape, bubbles, storage):
    """A step far shorter than a cell drains: the whole column but its top keeps the undrained pressure, which nothing exceeds."""
    undrained = UNDRAINED if storage else STIFF
    return Case(f"first step of {part:g}, {shape}, bubbles on {bubbles} faces, 1/M = {storage:g}",
                {"study": {"part": part, "steps": 1, "S": storage}, "mesh": {"box": {"shape": shape}}, "mechanics": {"bubbles": bubbles},
                 "exact": None}, measure=history(max_pressure=[undrained]), bound=0.02,
                quick=part == 1e-6 and shape == "triangles" and storage == 0)


COUPLINGS = [coupling(f"b = {b:g}", b=b, quick=b == 1) for b in (1e-6, 1e-3, 0.1, 1)]
COUPLINGS += [coupling("b = 0", b=0, measure=error_of("displacement_l2"))]
COUPLINGS += [coupling(f"M = {m:g}", S=1 / m if m else 0, quick=m == 0) for m in (1e6, 1e8, 1e12, 1e18)] + [coupling("M infinite", S=0, quick=True)]
COUPLINGS += [coupling(f"permeability {k:g}", k=k) for k in (1e-25, 1e-8)] + [coupling(f"E = {e:g}", E=e, S=0.1 / e) for e in (1e3, 1e13)]

STEPS = [one_step(part, shape, bubbles, storage)
         for shape in ("quads", "triangles", "polygons") for bubbles in ("fracture", "all") for storage in (1e-10, 0) for part in (1e-6, 1e-3)]
STEPS += [Case(f"one step of {part:g}", {"study": {"part": part, "steps": 1}}, measure=error_of("displacement_l2"), bound=bound, quick=part == 1e6)
          for part, bound in ((0.01, 0.1), (1, 0.2), (1e3, 1e-3), (1e6, 1e-6))]
STEPS += [Case("steps growing from 1e-6 to 1e3", {"study": {"part": 1e3, "steps": 1}, "time": {"step": "end*1e-9", "largest_step": "end"}},
               measure=error_of("displacement_l2"), bound=1e-2)]

# ------------------------------------------------ a block afloat on what is injected: the fluid fills what opens, and nothing leaks

AFLOAT = {
    "name": "stress", "mesh": {"box": {"min": [0, 0], "max": [1, 1], "cells": [4, 4], "shape": "quads"}},
    "fractures": [{"name": "f", "points": [[0, 0.5], [1, 0.5]]}], "contact": {"friction": 0.6},
    "materials": [{"young": 1e9, "poisson": 0.25, "permeability": 1e-25, "biot": 0, "biot_modulus": 1e10}],
    "mechanics": {"boundary": [{"on": "bottom", "displacement": [0, 0]}, {"on": ["left", "right"], "displacement": [0, None]},
                               {"on": "top", "traction": [0, -1e6]}]},
    "fluid": {"viscosity": 1e-3}, "flow": {"fractures": {"contact_aperture": 1e-4}, "sources": [{"fracture": "f", "rate": 1e-5}]},
    "time": {"end": 5, "step": 1}}


def afloat(name, d, bound, quick):
    return Case(name, {"flow": {"fractures": {"contact_aperture": d}}}, bound=bound, quick=quick,
                measure=history(max_opening=[1e-5 * k for k in range(1, 6)]), says="no prescribed displacement holds")


AFLOAT_CASES = [afloat(f"aperture in contact {d:g}", d, 1e-8, d == 1e-4) for d in (1e-7, 1e-6, 1e-5, 1e-4, 1e-3)]
# At 0.1 m the last digit of 1 MPa (1.2e-10 Pa), times d^3/(12 eta) over half a face, is 8e-11 m^2 a second: 8e-6 of what is injected. Four
# digits are left, but not none. At 0.01 m it is 8e-9: whether 1e-8 holds there is left to rounding, as one or two of them remain.
AFLOAT_CASES += [afloat("aperture in contact 0.01", 1e-2, 1e-7, False), afloat("aperture in contact 0.1, in four digits", 1e-1, 1e-4, True)]

# ------------------------------------------------------- undrained rock without storage: a displacement that keeps volumes, and a pressure

UNDRAINED_ROCK = {
    "name": "stress", "mesh": {"box": {"min": [0, 0], "max": [1, 1], "cells": [8, 8], "shape": "quads"}}, "study": {"k": 1e-20},
    "define": {"X": "pi*x + 0.7", "Y": "pi*y - 0.4", "u": "sin(X)*cos(Y)", "v": "-cos(X)*sin(Y)", "p": "x^2 + cos(2*pi*y)"},
    "materials": [{"lame_mu": 1, "lame_lambda": 1, "permeability": "k", "biot": 1, "biot_modulus": "infinity"}],
    "fluid": {"viscosity": 1}, "flow": {"boundary": [{"on": "all", "pressure": "p"}]}, "initial": {"equilibrium": "false"},
    # - div sigma(u) + grad p
    "mechanics": {"body_force": ["2*pi^2*u + 2*x", "2*pi^2*v - 2*pi*sin(2*pi*y)"],
                  "boundary": [{"on": ["left", "bottom", "top"], "displacement": ["u", "v"]},
                               {"on": "right", "traction": ["2*pi*cos(X)*cos(Y) - p", 0]}]},
    "exact": {"displacement": ["u", "v"], "pressure": "p"}}
IN_SPACE = {"mesh": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "cells": [8, 8, 8]}},
            "mechanics": {"body_force": ["2*pi^2*u + 2*x", "2*pi^2*v - 2*pi*sin(2*pi*y)", 0],
                          "boundary": [{"on": ["left", "front", "back", "bottom", "top"], "displacement": ["u", "v", 0]},
                                       {"on": "right", "traction": ["2*pi*cos(X)*cos(Y) - p", 0, 0]}]},
            "exact": {"displacement": ["u", "v", 0]}}


def undrained(shape, bubbles, bound=0.3, **expected):
    space = shape in ("hexahedra", "tets")
    scene = merged(IN_SPACE if space else {}, {"mesh": {"box": {"shape": shape}}, "mechanics": {"bubbles": bubbles}})
    return Case(f"{shape}, bubbles on {bubbles} faces", scene, bound=bound, quick=space, **expected)


ALL = {"says": "mechanics.bubbles: all"}
UNDRAINED_CASES = [undrained("quads", "fracture", **ALL), undrained("polygons", "fracture", **ALL),
                   undrained("triangles", "fracture", expect="refused", **ALL), undrained("hexahedra", "fracture", expect="warned", **ALL),
                   undrained("tets", "fracture", expect="refused", **ALL),
                   *(undrained(shape, "all", 0.5) for shape in ("quads", "polygons", "triangles")), undrained("hexahedra", "all", 0.6),
                   undrained("tets", "all", 1, expect="warned", says="undrained tets are rough")]

FAMILIES = [
    Family("afloat", "a block that injected fluid lifts, by the aperture of its fracture in contact", AFLOAT, AFLOAT_CASES),
    Family("undrained", "no storage and no time to flow: pressures that only the balance of volumes determines", UNDRAINED_ROCK, UNDRAINED_CASES),
    Family("coupling", "b from 0 to 1, M from 1e6 to infinite, permeability and modulus far from the usual; a tenth of the diffusion time",
           COLUMN, COUPLINGS),
    Family("time", "one step of 1e-6 to 1e6 of the diffusion time, the undrained first step", COLUMN, STEPS),
]
