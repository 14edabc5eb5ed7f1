"""Polygonal and polyhedral meshes as lists of cells, written in the program's native format (src/mesh/native_mesh.cpp)."""

import ctypes

from hdf5_tables import DOUBLE, identifier, library

SIDES = {2: (("left", "right"), ("bottom", "top")), 3: (("left", "right"), ("front", "back"), ("bottom", "top"))}

for name, arguments in {
    "H5Fcreate": (ctypes.c_char_p, ctypes.c_uint, identifier, identifier),
    "H5Gcreate2": (identifier, ctypes.c_char_p, identifier, identifier, identifier),
    "H5Gclose": (identifier,),
    "H5Screate": (ctypes.c_int,),
    "H5Screate_simple": (ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p),
    "H5Dcreate2": (identifier, ctypes.c_char_p, identifier, identifier, identifier, identifier, identifier),
    "H5Dwrite": (identifier, identifier, identifier, identifier, identifier, ctypes.c_void_p),
    "H5Acreate2": (identifier, ctypes.c_char_p, identifier, identifier, identifier, identifier),
    "H5Awrite": (identifier, identifier, ctypes.c_void_p),
    "H5Aclose": (identifier,),
    "H5Tcopy": (identifier,),
    "H5Tset_size": (identifier, ctypes.c_size_t),
    "H5Tset_cset": (identifier, ctypes.c_int),
    "H5Tclose": (identifier,),
}.items():
    function = getattr(library, name)
    function.argtypes, function.restype = arguments, identifier
INTEGER = identifier.in_dll(library, "H5T_NATIVE_INT_g")
REPLACE, SCALAR, UTF8, VARIABLE = 2, 0, 1, ctypes.c_size_t(-1).value


class NewTables:
    """An HDF5 file open for writing, in a with statement."""

    def __init__(self, path):
        self.path = str(path)

    def __enter__(self):
        self.file = library.H5Fcreate(self.path.encode(), REPLACE, 0, 0)
        if self.file < 0:
            raise OSError(f"{self.path} cannot be written")
        self.text = library.H5Tcopy(identifier.in_dll(library, "H5T_C_S1_g"))
        library.H5Tset_size(self.text, VARIABLE)
        library.H5Tset_cset(self.text, UTF8)
        return self

    def __exit__(self, *_):
        library.H5Tclose(self.text)
        library.H5Fclose(self.file)

    def attribute(self, name, value):
        space = library.H5Screate(SCALAR)
        attribute = library.H5Acreate2(self.file, name.encode(), INTEGER, space, 0, 0)
        library.H5Awrite(attribute, INTEGER, ctypes.byref(ctypes.c_int(value)))
        library.H5Aclose(attribute)
        library.H5Sclose(space)

    def _write(self, table, kind, data, shape):
        extent = (ctypes.c_uint64 * len(shape))(*shape)
        space = library.H5Screate_simple(len(shape), extent, None)
        data_set = library.H5Dcreate2(self.file, table.encode(), kind, space, 0, 0, 0)
        if data_set < 0 or (shape[0] and library.H5Dwrite(data_set, kind, 0, 0, 0, data) < 0):
            raise OSError(f"{self.path}: {table} cannot be written")
        library.H5Dclose(data_set)
        library.H5Sclose(space)

    def numbers(self, table, values, kind=INTEGER):
        """A list of numbers, or of rows of numbers."""
        columns = len(values[0]) if values and isinstance(values[0], (list, tuple)) else 0
        flat = [x for row in values for x in row] if columns else values
        data = ((ctypes.c_int if kind is INTEGER else ctypes.c_double) * len(flat))(*flat)
        self._write(table, kind, data, (len(values), columns) if columns else (len(values),))

    def texts(self, table, values):
        self._write(table, self.text, (ctypes.c_char_p * len(values))(*(value.encode() for value in values)), (len(values),))

    def rows(self, group, rows):
        library.H5Gclose(library.H5Gcreate2(self.file, group.encode(), 0, 0, 0))
        offsets = [0]
        for row in rows:
            offsets.append(offsets[-1] + len(row))
        self.numbers(group + "/offsets", offsets)
        self.numbers(group + "/values", [x for row in rows for x in row])


class Mesh:
    """Nodes, faces (tuples of nodes: the ends in 2D, corners in turn in 3D) and cells (lists of faces).

    Boundary faces have the tags of a generated box where they lie on a side of the bounding box, and "outside" elsewhere; a mesh that is moved
    keeps its tags. Fractures are left to the scene.
    """

    def __init__(self, dim, nodes, faces, cells, tags=None):
        self.dim, self.nodes, self.faces, self.cells = dim, nodes, faces, cells
        self.tags = tags or list(self._find_tags())

    @classmethod
    def of_cells(cls, dim, cells, digits=13):
        """Cells given by points: polygons as lists of corners in turn (2D), polyhedra as lists of such faces (3D). Points that agree to
        `digits` decimals are one node."""
        numbers, nodes = {}, []

        def node(point):
            key = tuple(round(x, digits) + 0.0 for x in point)
            if key not in numbers:
                numbers[key] = len(nodes)
                nodes.append([*point, 0.0][:3])
            return numbers[key]

        return cls.of_nodes(dim, nodes, [[node(p) for p in cell] if dim == 2 else [[node(p) for p in face] for face in cell] for cell in cells])

    @classmethod
    def of_nodes(cls, dim, nodes, cells):
        """The same with corners given by their numbers. Faces with the same nodes are one face."""
        numbers, faces, cell_faces = {}, [], []

        def face(corners):
            key = tuple(sorted(corners))
            if key not in numbers:
                numbers[key] = len(faces)
                faces.append(tuple(corners))
            return numbers[key]

        for cell in cells:
            cell_faces.append([face(part) for part in ([[cell[i - 1], cell[i]] for i in range(len(cell))] if dim == 2 else cell)])
        return cls(dim, nodes, faces, cell_faces)

    def face_cells(self):
        sides = [[] for _ in self.faces]
        for number, cell in enumerate(self.cells):
            for face in cell:
                sides[face].append(number)
        return sides

    def _find_tags(self):
        low = [min(x[axis] for x in self.nodes) for axis in range(self.dim)]
        high = [max(x[axis] for x in self.nodes) for axis in range(self.dim)]
        near = 1e-12 * max(b - a for a, b in zip(low, high))
        for face, cells in zip(self.faces, self.face_cells()):
            tag = None if len(cells) == 2 else "outside"
            for axis in range(self.dim):
                for end, name in zip((low, high), SIDES[self.dim][axis]):
                    if tag and all(abs(self.nodes[s][axis] - end[axis]) <= near for s in face):
                        tag = name
            yield tag

    def moved(self, place):
        """The same mesh with its nodes at place(x)."""
        return Mesh(self.dim, [[*place(x[:self.dim]), 0.0][:3] for x in self.nodes], self.faces, self.cells, self.tags)

    def shuffled(self, dice):
        """The same mesh with nodes, faces and cells in another order, and faces that start at another node and turn the other way."""
        node, face, cell = ([*range(len(part))] for part in (self.nodes, self.faces, self.cells))
        for order in (node, face, cell):
            dice.shuffle(order)
        new_node, new_face = ({old: new for new, old in enumerate(order)} for order in (node, face))

        def turned(corners):
            k = dice.randrange(len(corners))
            return tuple([*corners[k:], *corners[:k]][::dice.choice((1, -1))])

        return Mesh(self.dim, [self.nodes[s] for s in node], [turned([new_node[s] for s in self.faces[f]]) for f in face],
                    [dice.sample([new_face[f] for f in self.cells[c]], len(self.cells[c])) for c in cell], [self.tags[f] for f in face])

    def write(self, path):
        names = sorted(set(filter(None, self.tags)))
        with NewTables(path) as tables:
            tables.attribute("polyslip_mesh_version", 1)
            tables.attribute("dim", self.dim)
            tables.numbers("/nodes", self.nodes, DOUBLE)
            tables.rows("/face_nodes", self.faces)
            tables.rows("/cell_faces", self.cells)
            tables.numbers("/face_cells", [[*cells, -1][:2] for cells in self.face_cells()])
            tables.numbers("/cell_region", [0] * len(self.cells))
            tables.texts("/region_names", ["rock"])
            tables.numbers("/face_tag", [names.index(tag) if tag else -1 for tag in self.tags])
            tables.texts("/tag_names", names)
