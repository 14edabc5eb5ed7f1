"""Families of rock and fluid: moduli, permeabilities, couplings and apertures from one end of their range to the other."""

from catalogue import Case, Family, both, errors, history, merged
from family_meshes import darcy

SQUARE = {"min": [0, 0], "max": [1, 1], "cells": [8, 8], "shape": "quads"}
CUBE = {"min": [0, 0, 0], "max": [1, 1, 1], "cells": [4, 4, 4], "shape": "hexahedra"}

# ------------------------------------------------------------------------------ Poisson's ratio: a displacement that keeps volumes

VOLUME_KEEPING = {
    "name": "stress", "mesh": {"box": SQUARE | {"cells": [16, 16]}},
    "study": {"nu": 0.25}, "define": {"X": "pi*x + 0.7", "Y": "pi*y - 0.4", "u": "sin(X)*cos(Y)", "v": "-cos(X)*sin(Y)"},
    "materials": [{"young": "2*(1 + nu)", "poisson": "nu"}],
    "mechanics": {"body_force": ["2*pi^2*u", "2*pi^2*v"],
                  "boundary": [{"on": ["left", "bottom", "top"], "displacement": ["u", "v"]},
                               {"on": "right", "traction": ["2*pi*cos(X)*cos(Y)", 0]}]},
    "exact": {"displacement": ["u", "v"]}}


# The same displacement in a cube that its front and back (z: bottom and top) hold.
IN_SPACE = {"mesh": {"box": {"min": [0, 0, 0], "max": [1, 1, 1], "cells": [8, 8, 4]}},
            "mechanics": {"body_force": ["2*pi^2*u", "2*pi^2*v", 0],
                          "boundary": [{"on": ["left", "front", "back"], "displacement": ["u", "v", 0]},
                                       {"on": ["bottom", "top"], "displacement": [None, None, 0]},
                                       {"on": "right", "traction": ["2*pi*cos(X)*cos(Y)", 0, 0]}]},
            "exact": {"displacement": ["u", "v", 0]}}
SIMPLICES = ("triangles", "tets")


def poisson_case(nu, shape, bubbles):
    locks = nu > 0.48 and shape in SIMPLICES and bubbles == "fracture"
    scene = merged(IN_SPACE if shape in ("hexahedra", "tets") else {},
                   {"study": {"nu": nu}, "mesh": {"box": {"shape": shape}}, "mechanics": {"bubbles": bubbles}})
    return Case(f"nu = {nu:g}, {shape}, bubbles on {bubbles} faces", scene, bound=0.1 if shape in ("hexahedra", "tets") else 0.02,
                expect="warned" if locks else "holds", says="nearly incompressible" if locks else "", quick=nu == 0.4999 and shape == "triangles")


POISSON = [poisson_case(nu, shape, bubbles) for shape in ("quads", "triangles", "polygons", "hexahedra", "tets") for bubbles in ("fracture", "all")
           for nu in (0, 0.25, 0.49, 0.4999, 0.49999)]

# -------------------------------------------------------------------------------------------- layers in series under a load on top

LAYERS = {"name": "stress", "mesh": {"box": SQUARE}, "study": {"ratio": 1, "K1": 1, "K2": "ratio"},
          # K: modulus of uniaxial strain, E for nu = 0
          "materials": [{"young": "K1", "poisson": 0}, {"where": "y > 0.5", "young": "K2", "poisson": 0}]}
COLUMN = {"mechanics": {"boundary": [{"on": ["left", "right"], "displacement": [0, None]}, {"on": "bottom", "displacement": [0, 0]},
                                     {"on": "top", "traction": [0, -1e-3]}]},
          "exact": {"displacement": [0, "y < 0.5 ? -1e-3*y/K1 : -1e-3*(0.5/K1 + (y - 0.5)/K2)"]}}
SERIES = {"materials": [{"permeability": "K1"}, {"where": "y > 0.5", "permeability": "K2"}],
          "fluid": {"viscosity": 1},
          "flow": {"stationary": "true", "boundary": [{"on": "bottom", "pressure": 0, "name": "out"}, {"on": "top", "pressure": 1}]},
          "define": {"V": "1/(0.5/K1 + 0.5/K2)"},
          "exact": {"pressure": "y < 0.5 ? V*y/K1 : V*(0.5/K1 + (y - 0.5)/K2)"}}
RATIOS = {"stiffness": (COLUMN, (1e-6, 1e-3, 1e3, 1e6)), "permeability": (SERIES, (1e-12, 1e-6, 1e6, 1e12))}


def contrast(what, ratio, shape):
    scene, _ = RATIOS[what]
    outflow = history(out_outflow=[2 / (1 + 1 / ratio)])
    return Case(f"{what} contrast {ratio:g}, {shape}", scene | {"study": {"ratio": ratio}, "mesh": {"box": {"shape": shape}}},
                measure=both(errors, outflow) if what == "permeability" else errors, bound=1e-7,
                says="times more permeable" if what == "permeability" and ratio in (1e-12, 1e12) else "",
                quick=shape == "triangles" and ratio in (1e6, 1e12))


CONTRASTS = [contrast(what, ratio, shape) for what, (_, ratios) in RATIOS.items() for ratio in ratios for shape in ("quads", "triangles")]

# ------------------------------------------------------------------------------------------- anisotropy, turned by 30 degrees


def turned(ratio):
    c, s = 3 ** 0.5 / 2, 0.5
    return [[c * c + ratio * s * s, (ratio - 1) * c * s], [(ratio - 1) * c * s, s * s + ratio * c * c]]


def anisotropic(ratio, shape, field):
    """K = 1 along w = (cos 30, -sin 30) and `ratio` across it. Pressures: a linear one; one that varies along w alone;
    and sin(pi x) sin(pi y), which varies across it too. Flux along the larger permeability must balance to one part in their ratio."""
    K = turned(ratio)
    c, s = 3 ** 0.5 / 2, 0.5
    pressure, source = {"linear": ("1 + 2*x - 3*y", 0), "balanced": (f"sin(pi*({c!r}*x - {s!r}*y))", f"pi^2*sin(pi*({c!r}*x - {s!r}*y))"),
                        "unbalanced": ("sin(pi*x)*sin(pi*y)",
                                       f"pi^2*({K[0][0] + K[1][1]!r}*sin(pi*x)*sin(pi*y) - {2 * K[0][1]!r}*cos(pi*x)*cos(pi*y))")}[field]
    scene = darcy(2) | {"name": "stress", "mesh": {"box": SQUARE | {"shape": shape, "cells": [16, 16]}}, "materials": [{"permeability": K}],
                        "exact": {"pressure": pressure},
                        "flow": {"stationary": "true", "boundary": [{"on": "all", "pressure": pressure}], "sources": [{"rate": source}]}}
    beyond = shape == "triangles" and (ratio < 1e-2 and field != "linear" or ratio > 1e2 and field == "unbalanced")
    return Case(f"anisotropy {ratio:g}, {shape}, {field}", scene, bound=1e-8 if field == "linear" else 0.1,
                expect="warned" if beyond else "holds", says="anisotropic" if beyond else "", quick=ratio == 1e6 and shape == "triangles")


ANISOTROPY = [anisotropic(ratio, shape, field) for field in ("linear", "balanced", "unbalanced") for shape in ("quads", "triangles", "polygons")
              for ratio in (1e-6, 1e-3, 1, 1e3, 1e6)]

# --------------------------------------------------------------------------------------------------- a fracture across the flow

ACROSS = {"name": "stress", "mesh": {"box": SQUARE}, "fractures": [{"name": "f", "points": [[0, 0.5], [1, 0.5]]}],
          "study": {"d": 1e-3, "Kn": 1e-8, "K": 1}, "materials": [{"permeability": "K"}], "fluid": {"viscosity": 1},
          # two drops V/T_f, T_f = 2 K_fn/d, beside those in the rock
          "define": {"V": "1/(1/K + d/Kn)"},
          "flow": {"stationary": "true", "fractures": {"contact_aperture": "d", "permeability": 1e-30, "normal_permeability": "Kn"},
                   "boundary": [{"on": "bottom", "pressure": 0, "name": "out"}, {"on": "top", "pressure": 1}]},
          "exact": {"pressure": "y < 0.5 ? V*y/K : 1 - V*(1 - y)/K"}}
ALONG = {"flow": {"fractures": {"permeability": None, "normal_permeability": None},
                  "boundary": [{"on": "left", "pressure": 0, "name": "out"}, {"on": "right", "pressure": 1}]},
         "exact": {"pressure": "x"}}
# What leaves is compared with what the rock alone lets through across, K; and along, with K + C_f.
APERTURES = [Case(f"across, aperture {d:g}, K_fn {kn:g}", {"study": {"d": d, "Kn": kn, "K": 1}}, bound=1e-8, quick=d == 1e-3,
                  measure=both(errors, history(1, out_outflow=[1 / (1 + d / kn)])))
             for d in (1e-7, 1e-3, 1e-1) for kn in (1e-30, 1e-12, 1e-6, 1, 1e12)]
APERTURES += [Case(f"along, aperture {d:g}, rock {k:g}", ALONG | {"study": {"d": d, "K": k}}, bound=1e-8, quick=k == 1e-18,
                   measure=both(errors, history(out_outflow=[k + d**3 / 12])))
              for d in (1e-7, 1e-4, 1e-1) for k in (1e-18, 1e-12)]

FAMILIES = [
    Family("poisson", "nu from 0 to .49999: a displacement that keeps volumes", VOLUME_KEEPING, POISSON),
    Family("contrasts", "stiffness and permeability of two layers in series", LAYERS, CONTRASTS),
    Family("anisotropy", "permeability by direction, turned by 30 degrees", {}, ANISOTROPY),
    Family("apertures", "flow across and along a fracture, from tight to open", ACROSS, APERTURES),
]
