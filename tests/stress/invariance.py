"""One coupled contact problem with friction in 2D and one in 3D: the same answer on any number of ranks, for any order of cells, faces and nodes, and
in other coordinates and units."""

import json
import math
import random
import tempfile
import unittest
from dataclasses import dataclass, replace
from pathlib import Path

import meshes
from native_mesh import Mesh
from scene_runs import Run

TIGHT = ("-snes_rtol", "1e-11")


def matrix_times(matrix, x):
    return [sum(a * b for a, b in zip(row, x)) for row in matrix]


@dataclass(frozen=True)
class View:
    """Coordinates and units in which a problem is stated: x' = length (turn x + shift), stresses times `stress`."""

    turn: tuple
    shift: tuple
    length: float = 1
    stress: float = 1

    def point(self, x):
        return [self.length * (a + b) for a, b in zip(matrix_times(self.turn, x), self.shift)]

    def vector(self, x, scale=1.0):
        return [scale * a for a in matrix_times(self.turn, x)]

    def back(self, x):
        return [sum(self.turn[i][j] * x[i] for i in range(len(x))) for j in range(len(x))]


def rotation(d, degrees):
    """About the z axis in 2D, and then about the x axis too in 3D."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    about_z = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
    if d == 2:
        return tuple(tuple(row[:2]) for row in about_z[:2])
    about_x = [[1, 0, 0], [0, c, -s], [0, s, c]]
    return tuple(tuple(sum(about_x[i][k] * about_z[k][j] for k in range(3)) for j in range(3)) for i in range(3))


def as_it_is(d):
    return View(tuple(tuple(float(i == j) for j in range(d)) for i in range(d)), (0.0,) * d)


def mirrored(d):
    view = as_it_is(d)
    return replace(view, turn=tuple(tuple(-a if i == 0 else a for a in row) for i, row in enumerate(view.turn)))


def triangles(n):
    return Mesh.of_cells(2, [part for s in meshes.squares(n) for part in ([s[0], s[1], s[2]], [s[0], s[2], s[3]])])


@dataclass(frozen=True)
class Problem:
    """Rock squeezed and sheared from its top, with fluid from its left side; fractures cross, slip and open."""

    d: int
    mesh: object
    fractures: tuple
    probes: tuple
    friction: float

    def scene(self, view):
        d, stress = self.d, view.stress
        pieces = [piece[::-1] if view.turn[0][0] < 0 else piece for piece in self.fractures]  # a mirror would swap the sides
        top, push, weight = ([0] * d for _ in range(3))
        top[0], top[-1], push[0], weight[-1] = 2e-3, -5e-4, 4e5, -2e4

        def times(vector, factor):
            return [f"({a!r})*{factor}" for a in vector]

        side = {"left": 1, "right": -1}
        return {
            "name": "invariance", "mesh": {"file": "mesh.h5"},
            "fractures": [{"name": f"f{i}", "points": [view.point(x) for x in piece]} for i, piece in enumerate(pieces)],
            "materials": [{"young": 1e9 * stress, "poisson": 0.2, "biot": 0.8, "biot_modulus": 5e9 * stress,
                           "permeability": 1e-13 * view.length ** 2}],
            "mechanics": {"body_force": view.vector(weight, stress / view.length),
                          "boundary": [{"on": "bottom", "displacement": [0] * d},
                                       {"on": "top", "displacement": times(view.vector(top, view.length), "t")},
                                       *({"on": name, "traction": times(view.vector(push, sign * stress), "t")} for name, sign in side.items())]},
            "contact": {"friction": self.friction},
            "fluid": {"viscosity": 1e-3 * stress},
            "flow": {"fractures": {"contact_aperture": 1e-4 * view.length},
                     "boundary": [{"on": "left", "pressure": 6e5 * stress}, {"on": "right", "pressure": 0}]},
            "initial": {"equilibrium": "false"}, "time": {"end": 3, "step": 1},
            "output": {"every": 1000, "probes": [{"name": f"p{i}", "at": view.point(x)} for i, x in enumerate(self.probes)]}}

    def answer(self, view, ranks=1, mesh=None):
        """Columns by name in the coordinates and units of the problem itself."""
        with tempfile.TemporaryDirectory() as folder:
            (mesh or self.mesh).moved(view.point).write(Path(folder) / "mesh.h5")
            scene = Path(folder) / "scene.yaml"
            scene.write_text(json.dumps(self.scene(view)), encoding="utf-8")
            run = Run(scene, ranks=ranks, options=TIGHT)
        h, columns = run.history, {}
        columns["counts"] = h["open"] + h["stick"] + h["slip"]
        columns["jumps"] = [x / view.length for x in h["max_slip"] + h["max_opening"]]
        columns["integrals"] = [x / view.length ** self.d for x in h["slip_integral"] + h["opening_integral"]]
        columns["displacements"], columns["pressures"] = [], []
        for i in range(len(self.probes)):
            columns["pressures"] += [x / view.stress for x in h[f"p{i}_p"]]
            for u in zip(*(h[f"p{i}_u{axis}"] for axis in "xyz"[:self.d])):
                columns["displacements"] += [x / view.length for x in view.back(u)]
        columns["stored"] = [x / view.length ** self.d for x in h["stored_volume"]]
        columns["energy"] = [x / view.length ** self.d / view.stress for x in h["elastic_energy"] + h["contact_work"]]
        return columns


PLANE = Problem(2, triangles(8), (((0.25, 0.25), (0.75, 0.75)), ((0.25, 0.625), (0.875, 0.625))),
                ((0.31, 0.37), (0.53, 0.83), (0.71, 0.46)), 0.3)
SOLID = Problem(3, Mesh.of_cells(3, list(meshes.cubes(4))),
                (((0.25, 0.25, 0.5), (0.75, 0.25, 0.5), (0.75, 0.75, 0.5), (0.25, 0.75, 0.5)),
                 ((0.5, 0.25, 0.25), (0.5, 0.75, 0.25), (0.5, 0.75, 0.75), (0.5, 0.25, 0.75))),
                ((0.31, 0.37, 0.41), (0.53, 0.83, 0.61), (0.71, 0.46, 0.87)), 2.0)


class Invariance(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.reference = {problem: problem.answer(as_it_is(problem.d)) for problem in (PLANE, SOLID)}

    def assert_invariant(self, change, changed_problem=lambda problem: problem, tolerance=1e-8):
        """`change` makes (view, ranks, mesh) of a problem."""
        for problem, expected in self.reference.items():
            found = changed_problem(problem).answer(*change(problem))
            for name, values in expected.items():
                size = max(map(abs, values))
                error = max(abs(a - b) for a, b in zip(found[name], values)) / size
                print(f"{self._testMethodName}, {problem.d}D, {name}: {error:.1e}")
                with self.subTest(dimension=problem.d, column=name):
                    self.assertGreater(size, 0)
                    self.assertLessEqual(error, tolerance)

    def test_all_states_of_contact_occur(self):
        for problem, expected in self.reference.items():
            n = len(expected["counts"]) // 3
            for k, state in enumerate(("open", "stick", "slip")):
                with self.subTest(dimension=problem.d, state=state):
                    self.assertGreater(max(expected["counts"][k * n:(k + 1) * n]), 0)

    def test_number_of_ranks(self):
        for ranks in (2, 3, 4):
            self.assert_invariant(lambda problem, n=ranks: (as_it_is(problem.d), n))

    def test_order_of_cells_faces_and_nodes(self):
        self.assert_invariant(lambda problem: (as_it_is(problem.d), 1, problem.mesh.shuffled(random.Random(1))))

    def test_coordinates_turned_and_shifted(self):
        self.assert_invariant(lambda problem: (View(rotation(problem.d, 33), (5.0, -3.0, 2.0)[:problem.d]),))

    def test_mirror(self):
        self.assert_invariant(lambda problem: (mirrored(problem.d),))

    def test_sides_swapped_but_for_the_error_of_the_scheme(self):
        """Bubbles are on the + sides, so the discrete problems differ; their contact states do not."""
        self.assert_invariant(lambda problem: (as_it_is(problem.d),),
                              lambda problem: replace(problem, fractures=tuple(piece[::-1] for piece in problem.fractures)), 0.03)

    def test_kilometres_and_gigapascals(self):
        self.assert_invariant(lambda problem: (replace(as_it_is(problem.d), length=1e-3, stress=1e-9),))


if __name__ == "__main__":
    unittest.main()
