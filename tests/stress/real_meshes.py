"""Readers of the meshes that others have published, for tests: typ2 (2D polygons), RF .node/.ele and FVCA6 .msh (polyhedra), VTK and VTU,
corner-point grids (GRDECL). Each returns a Mesh; numbers in the formats start at 0 (RF, VTK) or 1."""

import base64
import lzma
import re
import struct
import xml.etree.ElementTree
import zlib
from itertools import product

from native_mesh import Mesh


def tokens(path):
    return path.read_text(errors="replace").split()


def typ2(path):
    words = iter(tokens(path))
    assert next(words).lower() == "vertices"
    nodes = [[float(next(words)), float(next(words)), 0.0] for _ in range(int(next(words)))]
    assert next(words).lower() == "cells"
    cells = [[int(next(words)) - 1 for _ in range(int(next(words)))] for _ in range(int(next(words)))]
    return Mesh.of_nodes(2, nodes, cells)


def rf(path):
    """`path` is the .ele file; the .node file is beside it."""
    def words(file):
        return iter(re.sub(r"#.*", "", file.read_text()).split())

    node = words(path.with_suffix(".node"))
    count = int(next(node))
    for _ in range(3):
        next(node)
    nodes = {int(next(node)): [float(next(node)) for _ in range(3)] for _ in range(count)}
    names = {name: k for k, name in enumerate(nodes)}
    cells, element = [], words(path)
    for _ in (range(int(next(element))), next(element))[0]:
        next(element)
        faces = []
        for _ in range(int(next(element))):
            next(element)
            faces.append([names[int(next(element))] for _ in range(int(next(element)))])
        cells.append(faces)
    return Mesh.of_nodes(3, list(nodes.values()), cells)


def fvca6(path):
    """Sections "Name count"; those of nodes, faces by nodes and cells by faces suffice."""
    sections, current = {}, None
    for line in path.read_text(errors="replace").splitlines():
        heading = re.match(r"\s*([A-Za-z][^\d]*?)\s+(\d+)\s*$", line)
        if heading:
            current = sections.setdefault(heading[1].lower(), [int(heading[2])])
        elif re.match(r"\s*[A-Za-z]", line):
            current = None
        elif current is not None:
            current += line.split()

    def rows(name):
        count, *numbers = sections[name]
        numbers = iter(numbers)
        return [[int(next(numbers)) - 1 for _ in range(int(next(numbers)))] for _ in range(count)]

    count, *x = sections["vertices"]
    nodes = [[float(a) for a in x[3 * k:3 * k + 3]] for k in range(count)]
    return Mesh(3, nodes, [tuple(face) for face in rows("faces->vertices")], rows("volumes->faces"))


# Faces of VTK's cells by their corners.
PRISM = {12: 4, 13: 3, 15: 5, 16: 6}  # hexahedron, wedge, pentagonal, hexagonal prism: corners of a base
PLANE = (5, 7, 9)


def vtk_faces(kind, corners):
    if kind == 10:
        return [[p for j, p in enumerate(corners) if j != i] for i in range(4)]
    if kind == 14:
        return [corners[:4], *([corners[i - 1], corners[i], corners[4]] for i in range(4))]
    n = PRISM[kind]
    low, high = corners[:n], corners[n:]
    return [low, high, *([low[i - 1], low[i], high[i], high[i - 1]] for i in range(n))]


def vtk_mesh(points, cells):
    """`cells` are (type, corners, faces of a polyhedron or nothing); lines and points are left out, and surfaces beside solids."""
    solid = [faces or vtk_faces(kind, list(corners)) for kind, corners, faces in cells if kind == 42 or kind in (10, 14, *PRISM)]
    number = {}
    same = [number.setdefault(tuple(x), len(number)) for x in points]  # split nodes of fractures are joined again
    nodes = [list(x) for x in number]
    if solid:
        return Mesh.of_nodes(3, nodes, [[[same[s] for s in face] for face in cell] for cell in solid])
    return Mesh.of_nodes(2, nodes, [[same[s] for s in corners] for kind, corners, _ in cells if kind in PLANE])


def vtk(path):
    words = iter(tokens(path))
    for word in words:
        if word == "POINTS":
            points = [[float(next(words)) for _ in range(3)] for _ in range([int(next(words)), next(words)][0])]
        elif word == "CELLS":
            corners = [[int(next(words)) for _ in range(int(next(words)))] for _ in range([int(next(words)), next(words)][0])]
        elif word == "CELL_TYPES":
            kinds = [int(next(words)) for _ in range(int(next(words)))]
    return vtk_mesh(points, [(kind, c, None) for kind, c in zip(kinds, corners)])


class Vtu:
    LETTER = {"Float32": "f", "Float64": "d", "Int8": "b", "UInt8": "B", "Int32": "i", "UInt32": "I", "Int64": "q", "UInt64": "Q"}
    UNPACK = {"vtkZLibDataCompressor": zlib.decompress, "vtkLZMADataCompressor": lzma.decompress}

    def __init__(self, path):
        text = path.read_bytes()
        self.appended, self.encoding = b"", "base64"
        if (begin := text.find(b"<AppendedData")) >= 0:
            start = text.index(b"_", text.index(b">", begin)) + 1
            self.encoding = "raw" if b'"raw"' in text[begin:start] else "base64"
            self.appended, text = text[start:text.rindex(b"</AppendedData")], text[:begin] + b"</VTKFile>"
        self.root = xml.etree.ElementTree.fromstring(text)
        self.unpack = self.UNPACK.get(self.root.get("compressor"))
        self.header = self.LETTER[self.root.get("header_type", "UInt32")]

    def block(self, data):
        """The bytes of one array; header and data are encoded one after the other."""
        size = struct.calcsize(self.header)

        def integers(count):
            length = count * size
            raw = base64.b64decode(data[:4 * -(-length // 3)]) if self.encoding == "base64" else data
            return struct.unpack(f"<{count}{self.header}", raw[:length])

        def behind(count):
            length = count * size
            return base64.b64decode(data[4 * -(-length // 3):].split(b"=")[0] + b"==") if self.encoding == "base64" else data[length:]

        if not self.unpack:
            length, = integers(1)
            if self.encoding == "base64":  # header and data are one text
                return base64.b64decode(data[:4 * -(-(size + length) // 3)])[size:size + length]
            return behind(1)[:length]
        blocks = integers(1)[0]
        lengths = integers(3 + blocks)[3:]
        encoded, parts = behind(3 + blocks), []
        for length in lengths:
            parts.append(self.unpack(encoded[:length]))
            encoded = encoded[length:]
        return b"".join(parts)

    def array(self, section, name=None):
        for entry in self.root.find(f".//{section}").iter("DataArray"):
            if name and entry.get("Name") != name:
                continue
            letter = self.LETTER[entry.get("type")]
            if entry.get("format") == "ascii":
                return [float(x) if letter in "fd" else int(x) for x in entry.text.split()]
            data = self.appended[int(entry.get("offset")):] if entry.get("format") == "appended" else (entry.text or "").strip().encode()
            if entry.get("format") == "binary":
                self.encoding = "base64"
            values = self.block(data)
            return list(struct.unpack(f"<{len(values) // struct.calcsize(letter)}{letter}", values))
        return []

    def mesh(self):
        x = self.array("Points")
        points = [x[i:i + 3] for i in range(0, len(x), 3)]
        corners, ends, kinds = (self.array("Cells", name) for name in ("connectivity", "offsets", "types"))
        faces, face_ends = self.array("Cells", "faces"), self.array("Cells", "faceoffsets")
        cells, start = [], 0
        for k, (kind, end) in enumerate(zip(kinds, ends)):
            polyhedron = None
            if kind == 42:
                stream = iter(faces[max([e for e in face_ends[:k] if e >= 0], default=0):face_ends[k]])
                polyhedron = [[next(stream) for _ in range(next(stream))] for _ in range(next(stream))]
            cells.append((kind, corners[start:end], polyhedron))
            start = end
        return vtk_mesh(points, cells)


def vtu(path):
    return Vtu(path).mesh()


# ------------------------------------------------------------------------------------------------------ corner-point grids


def keyword(text, name, kind=float):
    """Values of a keyword, repeats "n*v" written out; nothing where it is missing."""
    found = re.search(rf"^\s*{name}\s*$(.*?)/", text, re.MULTILINE | re.DOTALL)
    if not found:
        return []
    values = []
    for word in found[1].split():
        if not re.match(r"[-+.\d]", word):
            continue
        count, _, value = word.rpartition("*")
        values += [kind(value)] * (int(count) if count else 1)
    return values


def corner_point(path):
    """Each active cell with its own corners: faces are shared where all corners agree; those of faults and gaps are boundary."""
    text = re.sub(r"--.*", "", path.read_text(errors="replace"))
    nx, ny, nz = (keyword(text, "SPECGRID", int) or keyword(text, "DIMENS", int))[:3]
    coord, zcorn = keyword(text, "COORD"), keyword(text, "ZCORN")
    active = keyword(text, "ACTNUM", int) or [1] * (nx * ny * nz)

    def corner(i, j, k, a, b, c):
        x0, y0, z0, x1, y1, z1 = coord[6 * ((j + b) * (nx + 1) + i + a):][:6]
        z = zcorn[((2 * k + c) * 2 * ny + 2 * j + b) * 2 * nx + 2 * i + a]
        part = (z - z0) / (z1 - z0) if z1 != z0 else 0
        return (x0 + part * (x1 - x0), y0 + part * (y1 - y0), z)

    def faces(corners):
        for axis in range(3):
            for end in (0, 1):
                ring = []
                for p, q in ((0, 0), (1, 0), (1, 1), (0, 1)):
                    at = [p, q]
                    at.insert(axis, end)
                    ring.append(corners[tuple(at)])
                ring = [p for n, p in enumerate(ring) if p != ring[n - 1]]
                if len(set(ring)) >= 3:
                    yield ring

    cells = []
    for k, j, i in product(range(nz), range(ny), range(nx)):
        if active[(k * ny + j) * nx + i]:
            corners = {abc: corner(i, j, k, *abc) for abc in product((0, 1), repeat=3)}
            if any(corners[a, b, 0][2] != corners[a, b, 1][2] for a in (0, 1) for b in (0, 1)):
                cells.append(list(faces(corners)))
    return Mesh.of_cells(3, cells, digits=6)


READERS = {".typ2": typ2, ".ele": rf, ".vtk": vtk, ".vtu": vtu, ".grdecl": corner_point, ".DATA": corner_point, ".GRDECL": corner_point}


def read(path):
    """The mesh of a file, or nothing where the program reads it itself (Gmsh)."""
    if path.suffix == ".msh":
        return None if path.read_bytes().startswith(b"$MeshFormat") else fvca6(path)
    return READERS[path.suffix](path)


def files(folder):
    return sorted(file for file in folder.rglob("*") if file.suffix in READERS or file.suffix == ".msh")
