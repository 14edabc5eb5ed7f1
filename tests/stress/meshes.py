"""Ugly meshes of the unit square and cube, as functions that return a Mesh; `eps` is the size of what is tiny in them."""

import math
from itertools import permutations, product

from native_mesh import Mesh

# Polygons are lists of corners in turn, polyhedra lists of such faces.


def squares(n, m=None):
    m = m or n
    for i, j in product(range(n), range(m)):
        yield [(i / n, j / m), ((i + 1) / n, j / m), ((i + 1) / n, (j + 1) / m), (i / n, (j + 1) / m)]


def prism(polygon, low, high):
    down, up = ([(*p, z) for p in polygon] for z in (low, high))
    return [down, up, *([down[i - 1], down[i], up[i], up[i - 1]] for i in range(len(polygon)))]


def mesh_of(d, polygons, layers=2, top=1):
    """The polygons themselves, or prisms over them."""
    polygons = list(polygons)
    if d == 2:
        return Mesh.of_cells(2, polygons)
    return Mesh.of_cells(3, [prism(p, top * k / layers, top * (k + 1) / layers) for p in polygons for k in range(layers)])


def middle(p, q):
    return tuple((a + b) / 2 for a, b in zip(p, q))


def split_edges(d, n, eps):
    """Squares with a second node eps cells behind the start of each inner vertical edge."""
    def polygons():
        for square in squares(n):
            (x0, y0), (x1, _) = square[0], square[1]
            right = [(x1, y0 + eps / n)] if x1 < 1 else []
            left = [(x0, y0 + eps / n)] if x0 > 0 else []
            yield [*square[:2], *right, *square[2:], *left]
    return mesh_of(d, polygons())


def cut_corners(d, n, eps):
    """Squares without the corners that eps cells cut off, and a tiny diamond between every four of them."""
    def corner(p, q, r):
        """What is left of the corner q between p and r."""
        if not all(0 < x < 1 for x in q):
            return [q]
        return [tuple(a + eps * (b - a) for a, b in zip(q, other)) for other in (p, r)]

    def polygons():
        for s in squares(n):
            yield [x for i in range(4) for x in corner(s[i - 1], s[i], s[(i + 1) % 4])]
        for i, j in product(range(1, n), repeat=2):
            q, neighbours = (i / n, j / n), [((i + 1) / n, j / n), (i / n, (j + 1) / n), ((i - 1) / n, j / n), (i / n, (j - 1) / n)]
            yield [tuple(a + eps * (b - a) for a, b in zip(q, p)) for p in neighbours]
    return mesh_of(d, polygons())


def chevrons(d, n, depth):
    """Squares whose inner vertical edges are bent by `depth` cells: not convex."""
    def polygons():
        for s in squares(n):
            (x0, y0), (x1, y1) = s[0], s[2]
            right, left = ([(x + depth / n, (y0 + y1) / 2)] if 0 < x < 1 else [] for x in (x1, x0))
            yield [*s[:2], *right, *s[2:], *left]
    return mesh_of(d, polygons())


def hanging(d, n):
    """Squares or cubes, those with x > 1/2 half as large: nodes hang in the faces between."""
    if d == 2:
        def polygons():
            for s in squares(n):
                if s[0][0] >= 0.5:
                    centre = middle(s[0], s[2])
                    yield from ([middle(s[i - 1], s[i]), s[i], middle(s[i], s[(i + 1) % 4]), centre] for i in range(4))
                else:
                    yield [*s[:2], *([middle(s[1], s[2])] if s[1][0] == 0.5 else []), *s[2:]]
        return mesh_of(2, polygons())
    coarse, fine = list(cubes(n)), list(cubes(2 * n))
    cells = [[part for face in cube for part in (quarters(face) if all(p[0] == 0.5 for p in face) else [face])]
             for cube in coarse if all(p[0] <= 0.5 for face in cube for p in face)]
    cells += [cube for cube in fine if all(p[0] >= 0.5 for face in cube for p in face)]
    return Mesh.of_cells(3, with_hanging_nodes(cells))


def cubes(n):
    for square in squares(n):
        for k in range(n):
            yield prism(square, k / n, (k + 1) / n)


def quarters(face):
    centre = middle(face[0], face[2])
    return [[middle(face[i - 1], face[i]), face[i], middle(face[i], face[(i + 1) % 4]), centre] for i in range(4)]


def with_hanging_nodes(cells):
    """Faces take up the nodes that lie inside their edges."""
    points = sorted({p for cell in cells for face in cell for p in face})

    def on_edge(p, q):
        length = math.dist(p, q)
        inside = [(math.dist(p, x), x) for x in points if x not in (p, q) and math.dist(p, x) + math.dist(x, q) < length * (1 + 1e-12)]
        return [x for _, x in sorted(inside)]

    edges = {}
    for corners in {(face[i - 1], face[i]) for cell in cells for face in cell for i in range(len(face))}:
        edges[corners] = on_edge(*corners)
    return [[[x for i in range(len(face)) for x in (*edges[face[i - 1], face[i]], face[i])] for face in cell] for cell in cells]


def ring(d, faces):
    """A cell of so many sides within as many trapezia; its boundary is no box."""
    angles = [2 * math.pi * k / faces for k in range(faces)]
    inner, outer = ([(0.5 + r * math.cos(a), 0.5 + r * math.sin(a)) for a in angles] for r in (0.25, 0.5))
    return mesh_of(d, [inner, *([inner[i - 1], outer[i - 1], outer[i], inner[i]] for i in range(faces))])


def slivers(n, eps):
    """Kuhn's tetrahedra of n cubes a side, each cut in four by a point that lies eps off the middle of its first edge."""
    cells = []
    for corner in product(range(n), repeat=3):
        for axes in permutations(range(3)):
            tet = [corner]
            for axis in axes:
                tet.append(tuple(x + (axis == k) for k, x in enumerate(tet[-1])))
            tet = [tuple(x / n for x in p) for p in tet]
            weights = (0.5 - eps, 0.5 - eps, eps, eps)
            inside = tuple(sum(w * p[k] for w, p in zip(weights, tet)) for k in range(3))
            for left_out in range(4):
                four = [p for i, p in enumerate(tet) if i != left_out] + [inside]
                cells.append([[p for j, p in enumerate(four) if j != i] for i in range(4)])
    return Mesh.of_cells(3, cells, digits=15)


def fan(d, degrees, rings=4):
    """Sectors about the middle of a disc, with rays at 0 and `degrees`; triangles where they meet."""
    angles = [0, degrees] + [degrees + (360 - degrees) * k / 12 for k in range(1, 12)]
    rays = [[(r / rings * math.cos(math.radians(a)), r / rings * math.sin(math.radians(a))) for r in range(rings + 1)] for a in angles]
    polygons = []
    for left, right in zip(rays, rays[1:] + rays[:1]):
        polygons.append([left[0], left[1], right[1]])
        polygons += [[left[r], left[r + 1], right[r + 1], right[r]] for r in range(1, rings)]
    return mesh_of(d, polygons)


def stretched(mesh, *factors):
    return mesh.moved(lambda x: [a * b for a, b in zip(x, factors)])
