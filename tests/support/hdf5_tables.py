"""Tables of HDF5 files, read through the library that the program itself uses: tests need no package for it."""

import ctypes
import ctypes.util

identifier = ctypes.c_int64
# PyDLL: one call at a time, as this build of HDF5 is not made for threads (scripts/stress --jobs).
library = ctypes.PyDLL(ctypes.util.find_library("hdf5_openmpi") or "libhdf5_openmpi.so")
for name, arguments in {
    "H5Fopen": (ctypes.c_char_p, ctypes.c_uint, identifier),
    "H5Fclose": (identifier,),
    "H5Dopen2": (identifier, ctypes.c_char_p, identifier),
    "H5Dclose": (identifier,),
    "H5Dget_space": (identifier,),
    "H5Sclose": (identifier,),
    "H5Sget_simple_extent_npoints": (identifier,),
    "H5Dread": (identifier, identifier, identifier, identifier, identifier, ctypes.c_void_p),
    "H5Lexists": (identifier, ctypes.c_char_p, identifier),
    "H5Dget_offset": (identifier,),
    "H5Dget_storage_size": (identifier,),
}.items():
    function = getattr(library, name)
    function.argtypes, function.restype = arguments, identifier
library.H5open()
DOUBLE = identifier.in_dll(library, "H5T_NATIVE_DOUBLE_g")


class Tables:
    """An HDF5 file open for reading, in a with statement."""

    def __init__(self, path):
        self.path = str(path)

    def __enter__(self):
        self.file = library.H5Fopen(self.path.encode(), 0, 0)
        if self.file < 0:
            raise OSError(f"{self.path} cannot be opened")
        return self

    def __exit__(self, *_):
        library.H5Fclose(self.file)

    def has(self, table):
        """Whether the last part of a path exists; the others must."""
        return library.H5Lexists(self.file, table.encode(), 0) > 0

    def bytes_of(self, table):
        """(first, number) of the bytes of the file that hold the numbers of a table."""
        data = library.H5Dopen2(self.file, table.encode(), 0)
        place = library.H5Dget_offset(data), library.H5Dget_storage_size(data)
        library.H5Dclose(data)
        return place

    def __getitem__(self, table):
        """All numbers of a table, row by row."""
        data = library.H5Dopen2(self.file, table.encode(), 0)
        if data < 0:
            raise KeyError(f"{self.path} has no table {table}")
        space = library.H5Dget_space(data)
        values = (ctypes.c_double * library.H5Sget_simple_extent_npoints(space))()
        read = library.H5Dread(data, DOUBLE, 0, 0, 0, values)
        library.H5Sclose(space)
        library.H5Dclose(data)
        if read < 0:
            raise OSError(f"{self.path}: {table} cannot be read")
        return list(values)
