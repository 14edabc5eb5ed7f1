"""Random fracture networks whose blocks are all held: segments at any angle meshed by scripts/mesh_network, and pieces of lattice planes.

Every function draws one network and returns None where it will not do; the caller draws again.
"""

import math
import subprocess
from pathlib import Path

import lattice

MESH_NETWORK = Path(__file__).resolve().parents[2] / "scripts" / "mesh_network"

CLEARANCE = 0.04  # of features of a segment network that do not touch [m]
SMALLEST_ANGLE = math.radians(15)


# Segments at any angle


def distance_to_segment(p, a, b):
    ab = (b[0] - a[0], b[1] - a[1])
    t = ((p[0] - a[0]) * ab[0] + (p[1] - a[1]) * ab[1]) / (ab[0] ** 2 + ab[1] ** 2)
    t = min(1.0, max(0.0, t))
    return math.dist(p, (a[0] + t * ab[0], a[1] + t * ab[1]))


def crossing(first, second):
    """Place of the crossing of two segments along each, both in (0, 1), or None."""
    (a, b), (c, d) = first, second
    u, v, w = (b[0] - a[0], b[1] - a[1]), (d[0] - c[0], d[1] - c[1]), (c[0] - a[0], c[1] - a[1])
    area = u[0] * v[1] - u[1] * v[0]
    if abs(area) < 1e-12:
        return None
    s, t = (w[0] * v[1] - w[1] * v[0]) / area, (w[0] * u[1] - w[1] * u[0]) / area
    return (s, t) if 0 < s < 1 and 0 < t < 1 else None


def angle_between(first, second):
    """In [0, pi/2]."""
    angles = [math.atan2(b[1] - a[1], b[0] - a[0]) for a, b in (first, second)]
    turn = abs(angles[0] - angles[1]) % math.pi
    return min(turn, math.pi - turn)


def fits(segment, other):
    """Two segments keep clear of one another, or meet at a clear angle; the first end of `segment` may lie on `other`."""
    joined = distance_to_segment(segment[0], *other) < 1e-9
    ends = [distance_to_segment(segment[1], *other), *(distance_to_segment(p, *segment) for p in other)]
    if joined:
        ends = [distance for distance, p in zip(ends, (None, *other)) if p is None or math.dist(p, segment[0]) > 1e-9]
    else:
        ends.append(distance_to_segment(segment[0], *other))
    if min(ends) < CLEARANCE:
        return False
    return not (joined or crossing(segment, other)) or angle_between(segment, other) >= SMALLEST_ANGLE


def clip(start, direction, length, width, height):
    """End of the segment, on the boundary where it would leave the box; the box is [0, width] x [0, height]."""
    for x, u, size in zip(start, direction, (width, height)):
        if u:
            length = min(length, ((size if u > 0 else 0) - x) / u)
    end = [min(size, max(0.0, x + length * u)) for x, u, size in zip(start, direction, (width, height))]
    return tuple(size if abs(x - size) < 1e-9 else 0.0 if abs(x) < 1e-9 else x for x, size in zip(end, (width, height)))


def boundary_gaps(p, width, height):
    """Distances to the four sides."""
    return [p[0], width - p[0], p[1], height - p[1]]


def keeps_off_boundary(segment, width, height):
    """Ends lie on one side clear of its corners, or clear of all sides; no segment creeps along a side."""
    gaps = [sorted(boundary_gaps(p, width, height)) for p in segment]
    ends_clear = all(gap[1] > 2 * CLEARANCE and (gap[0] == 0 or gap[0] > CLEARANCE) for gap in gaps)
    sides = [((0, 0), (width, 0)), ((0, height), (width, height)), ((0, 0), (0, height)), ((width, 0), (width, height))]
    steep = all(angle_between(segment, side) > SMALLEST_ANGLE
                for side in sides for p in segment if distance_to_segment(p, *side) < 1e-9)
    return ends_clear and steep


def draw_segment(dice, segments, longest, width, height):
    """A free segment, or one that starts on an earlier one (T) or at an end of it (L)."""
    start = (dice.uniform(0.05, 0.95) * width, dice.uniform(0.05, 0.95) * height)
    kind = dice.random()
    if segments and kind < 0.35:
        a, b = dice.choice(segments)
        t = dice.choice((0.0, 1.0)) if kind < 0.12 else dice.uniform(0.2, 0.8)
        start = (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]))
    angle = dice.uniform(0, 2 * math.pi)
    return start, clip(start, (math.cos(angle), math.sin(angle)), dice.uniform(0.12, longest), width, height)


def segment_network(dice, count, width, height):
    """`count` segments, shorter where there are many, or None."""
    longest, segments = 0.8 if count < 7 else 0.5, []
    for _ in range(200):
        segment = draw_segment(dice, segments, longest, width, height)
        if math.dist(*segment) > 0.1 and keeps_off_boundary(segment, width, height) and all(fits(segment, s) for s in segments):
            segments.append(segment)
        if len(segments) == count:
            return segments
    return None


def mesh_segments(segments, width, height, size, folder):
    """Lets scripts/mesh_network write mesh.msh with edges on all segments; False if a block would float."""
    rows = [",".join(map(repr, (number, *a, *b))) for number, (a, b) in enumerate(segments)]
    (folder / "segments.csv").write_text("FID,START_X,START_Y,END_X,END_Y\n" + "\n".join(rows) + "\n", encoding="utf-8")
    box = ["--box", "0", "0", str(width), str(height)]
    mesh = [MESH_NETWORK, folder / "segments.csv", "-o", folder / "mesh.msh", "--size", f"{size:.4f}", *box]
    done = subprocess.run(mesh, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"scripts/mesh_network failed in {folder}: {done.stderr.strip()}")
    return not lattice.has_free_block(*read_triangles(folder / "mesh.msh"))


def read_triangles(file):
    """(cells, blocked, held) for has_free_block, of a Gmsh 4.1 text file with the groups fracture_0 .., bottom and top."""
    sections, rows = {}, []
    for line in file.read_text(encoding="utf-8").splitlines():
        if line.startswith("$"):
            rows = sections.setdefault(line[1:], [])
        else:
            rows.append(line.split())
    names = {tag: name.strip('"') for dim, tag, name in sections["PhysicalNames"][1:] if dim == "1"}
    points, curves = map(int, sections["Entities"][0][:2])
    groups = {row[0]: [names[tag] for tag in row[8:8 + int(row[7])]] for row in sections["Entities"][1 + points:1 + points + curves]}
    cells, blocked, held = [], set(), set()
    elements = iter(sections["Elements"][1:])
    for dim, entity, _, count in elements:
        for nodes in (next(elements)[1:] for _ in range(int(count))):
            if dim == "2":
                cells.append([tuple(sorted((nodes[i], nodes[i - 1]))) for i in range(len(nodes))])
            for group in groups.get(entity, []) if dim == "1" else []:
                (held if group in ("bottom", "top") else blocked).add(tuple(sorted(nodes)))
    return cells, blocked, held


# Pieces of lattice planes


def directions_of(shape, d):
    """Sets of directions that span a plane of mesh faces."""
    axes = [lattice.unit(d, axis) for axis in range(d)]
    if d == 2:
        return [(axes[0],), (axes[1],)] + ([((1, 1),)] if shape == "triangles" else [])
    planes = [(axes[0], axes[1]), (axes[1], axes[2]), (axes[2], axes[0])]
    if shape in ("tets", "prisms"):
        planes.append(((1, 1, 0), axes[2]))
    if shape == "tets":
        planes += [((0, 1, 1), axes[0]), ((1, 0, 1), axes[1])]
    return planes


def interval(dice, size, focus, at_most):
    """A random part of 0 .. size that holds `focus` most times and reaches an end now and then."""
    low, high = sorted(dice.sample(range(size + 1), 2))
    if dice.random() < 0.8:
        low, high = min(low, focus), max(high, focus)
    if dice.random() < 0.2:
        low = 0
    if dice.random() < 0.2:
        high = size
    return low, max(2, min(high - low, at_most))


def draw_piece(dice, shape, counts, focus):
    """A piece through, or near, the point `focus`, which all pieces of a 3D network and some of a 2D one share."""
    directions = dice.choice(directions_of(shape, len(counts)))
    origin, lengths = list(focus), []
    for direction in directions:
        pivot = direction.index(1)
        low, length = interval(dice, counts[pivot], focus[pivot], (3 * max(counts)) // 4)
        for axis, step in enumerate(direction):
            origin[axis] += step * (low - focus[pivot])
        lengths.append(length)
    return cut_to_box(lattice.Piece(tuple(origin), directions, tuple(lengths)), counts)


def cut_to_box(piece, counts):
    """The part of the piece inside the box, or None."""
    origin, lengths = piece.origin, []
    for direction, length in zip(piece.directions, piece.lengths):
        along = [axis for axis, step in enumerate(direction) if step]
        first = max(0, *(-origin[axis] for axis in along))
        last = min(length, *(counts[axis] - origin[axis] for axis in along))
        origin = lattice.add(origin, lattice.scaled(first, direction))
        lengths.append(last - first)
    inside = all(0 <= x <= n for x, n in zip(origin, counts))
    return lattice.Piece(origin, piece.directions, tuple(lengths)) if inside and min(lengths) >= 2 else None


def free_piece(dice, shape, counts, pieces, focus):
    """A piece anywhere on the lattice, for shapes whose nodes are lattice points."""
    point = focus
    if len(counts) == 3:  # triple points, and crossings close to them
        point = tuple(min(n - 1, max(1, x + dice.choice((-1, 0, 0, 0, 1)))) for x, n in zip(focus, counts))
    elif dice.random() < 0.7:  # elsewhere, or on an earlier piece: T, L and X
        point = tuple(dice.randint(1, n - 1) for n in counts)
        if pieces and dice.random() < 0.6:
            piece = dice.choice(pieces)
            t = dice.choice((0, piece.lengths[0], dice.randint(0, piece.lengths[0])))
            point = lattice.add(piece.origin, lattice.scaled(t, piece.directions[0]))
    return draw_piece(dice, shape, counts, point)


def plane_piece(dice, counts, planes):
    """A piece that begins and ends on the given planes of each axis or on the boundary."""
    d = len(counts)
    axis = dice.randrange(d)
    origin, lengths, directions = [0] * d, [], []
    origin[axis] = dice.choice(planes[axis])
    for other in ((axis + k) % d for k in range(1, d)):
        low, high = sorted(dice.sample([0, *planes[other], counts[other]], 2))
        origin[other] = low
        directions.append(lattice.unit(d, other))
        lengths.append(high - low)
    return lattice.Piece(tuple(origin), tuple(directions), tuple(lengths))


def ends_are_kept(pieces, counts):
    """Every side of every piece lies on the plane of a piece or on the boundary, as shaken nodes and Voronoi cells keep only these."""
    def normal(piece):
        return next(axis for axis in range(len(counts)) if all(direction[axis] == 0 for direction in piece.directions))

    kept = {(normal(piece), piece.origin[normal(piece)]) for piece in pieces}
    kept |= {(axis, side) for axis, n in enumerate(counts) for side in (0, n)}
    ends = ((direction.index(1), piece.origin[direction.index(1)] + t) for piece in pieces
            for direction, length in zip(piece.directions, piece.lengths) for t in (0, length))
    return all(end in kept for end in ends)


def lies_on_boundary(piece, counts):
    return any({corner[axis] for corner in piece.corners()} in ({0}, {n}) for axis, n in enumerate(counts))


def lattice_network(dice, shape, counts, number):
    """Pieces added one by one, each so that no face is taken twice and all blocks stay held, or None."""
    on_planes = shape in ("polygons", "polyhedra", "warped", "cut")
    planes = [dice.sample(range(2, n - 1), dice.randint(2, 4) if len(counts) == 2 else dice.randint(1, 2)) for n in counts]
    focus = tuple(dice.randint(n // 3, n - n // 3) for n in counts)
    cells, held = lattice.cells(shape, counts), lattice.held_faces(shape, counts)
    pieces, blocked = [], set()
    for _ in range(20 * number):
        piece = plane_piece(dice, counts, planes) if on_planes else free_piece(dice, shape, counts, pieces, focus)
        if piece is None or lies_on_boundary(piece, counts):
            continue
        faces = lattice.faces_of(piece, shape, counts)
        if blocked & faces or lattice.has_free_block(cells, blocked | faces, held):
            continue
        pieces.append(piece)
        blocked |= faces
        if len(pieces) == number:
            return pieces if not on_planes or ends_are_kept(pieces, counts) else None
    return None
