"""The cells and fractures of polyslip's box meshes in whole numbers: which faces a fracture takes, which blocks a network cuts free.

A lattice point is a tuple of d whole numbers between 0 and the cell counts; a cell is a list of its faces, a face the sorted tuple of its
corners. Shaken boxes and Voronoi cells have other faces, but fractures cut them into the same blocks as the plain lattice.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations, product


def unit(d, *axes):
    return tuple(int(axis in axes) for axis in range(d))


def add(p, q):
    return tuple(a + b for a, b in zip(p, q))


def scaled(factor, p):
    return tuple(factor * a for a in p)


@dataclass(frozen=True)
class Piece:
    """A straight (2D) or parallelogram (3D) fracture: the points origin + sum of t_i length_i direction_i with t_i in [0, 1].

    Directions have entries 0 and 1; each has an axis of its own, its pivot, along which no other one runs.
    """

    origin: tuple
    directions: tuple
    lengths: tuple

    def corners(self):
        """Ends (2D), or corners in turn (3D)."""
        spans = [scaled(length, direction) for length, direction in zip(self.lengths, self.directions)]
        if len(spans) == 1:
            return [self.origin, add(self.origin, spans[0])]
        return [self.origin, add(self.origin, spans[0]), add(add(self.origin, spans[0]), spans[1]), add(self.origin, spans[1])]

    def holds(self, p):
        offset = tuple(a - b for a, b in zip(p, self.origin))
        here = tuple(0 for _ in p)
        for direction, length in zip(self.directions, self.lengths):
            t = offset[direction.index(1)]
            if not 0 <= t <= length:
                return False
            here = add(here, scaled(t, direction))
        return here == offset


def cuboid_faces(p, d):
    """Faces of the small box at p."""
    for axis in range(d):
        others = [unit(d, other) for other in range(d) if other != axis]
        for low in (p, add(p, unit(d, axis))):
            corners = [low]
            for e in others:
                corners += [add(corner, e) for corner in corners]
            yield tuple(sorted(corners))


def kuhn_paths(p, d):
    """Corners of Kuhn's simplices in the small box at p."""
    for axes in permutations(range(d)):
        path = [p]
        for axis in axes:
            path.append(add(path[-1], unit(d, axis)))
        yield path


def simplex_faces(corners):
    return [tuple(sorted(corners[:i] + corners[i + 1:])) for i in range(len(corners))]


def prism_faces(triangle):
    up = [add(corner, (0, 0, 1)) for corner in triangle]
    sides = [(triangle[i], triangle[i - 1], up[i], up[i - 1]) for i in range(3)]
    return [tuple(sorted(face)) for face in (triangle, up, *sides)]


@lru_cache(maxsize=4)
def cells(shape, counts):
    """All cells of a box; shapes other than simplices and prisms count as small boxes."""
    d = len(counts)
    result = []
    for p in product(*map(range, counts)):
        if shape in ("triangles", "tets"):
            result += [simplex_faces(path) for path in kuhn_paths(p, d)]
        elif shape == "prisms":
            result += [prism_faces([add(p, (*corner, 0)) for corner in path]) for path in kuhn_paths((0, 0), 2)]
        else:
            result.append(list(cuboid_faces(p, d)))
    return result


@lru_cache(maxsize=4)
def faces(shape, counts):
    return sorted({face for cell in cells(shape, counts) for face in cell})


def faces_of(piece, shape, counts):
    """Faces inside the box that the piece takes."""
    low = [min(c[axis] for c in piece.corners()) for axis in range(len(counts))]
    high = [max(c[axis] for c in piece.corners()) for axis in range(len(counts))]
    near = (face for face in faces(shape, counts) if all(a <= x <= b for a, x, b in zip(low, face[0], high)))
    return {face for face in near if all(piece.holds(corner) for corner in face)}


def held_faces(shape, counts):
    """Faces on the lower and upper side of the last axis."""
    return {face for face in faces(shape, counts) for side in (0, counts[-1]) if all(corner[-1] == side for corner in face)}


def has_free_block(cells_of_mesh, blocked, held):
    """True if some cells, joined by faces that are not `blocked`, have no face among `held`.

    Such a block would float: cells that share a face share enough nodes to move as one, and a held face takes all rigid motions.
    """
    parent = list(range(len(cells_of_mesh)))

    def find(i):
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    first_cell, held_cells = {}, []
    for number, cell in enumerate(cells_of_mesh):
        for face in cell:
            if face in held:
                held_cells.append(number)
            if face in blocked:
                continue
            neighbour = first_cell.setdefault(face, number)
            parent[find(number)] = find(neighbour)
    anchored = {find(number) for number in held_cells}
    return any(find(number) not in anchored for number in range(len(cells_of_mesh)))
