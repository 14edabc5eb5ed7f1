// Slices of a mesh in the native format: contiguous rows of each of its tables, read without the rest (format: native_mesh.cpp).
#pragma once

#include <filesystem>
#include <vector>

#include "polyslip/mesh/face_tools.hpp"
#include "polyslip/mesh/poly_mesh.hpp"
#include "polyslip/mesh/row_range.hpp"

namespace polyslip::mesh {

/// What a slice knows: its own nodes, faces and cells, in the numbers of the file, and all names and lengths of fractures.
struct NativeSlice {
  std::filesystem::path file;
  PolyMesh mesh;  ///< Rows of the slice, their offsets from 0. Faces are not oriented, copies not built.
  RowRange nodes, faces, cells;
  RowRange face_corners, cell_sides;  ///< Entries of face_nodes.values and cell_faces.values.
  bool fractured = false;             ///< Whether the file marks fractures; the slice may have no face.
};

/// Slice `part` of `parts`, equal but for a row. Throws InputError where the file's tables are missing, do not fit together or hold
/// numbers out of range, as far as the slice shows it. Ranks of a parallel run read at once, each on its own.
NativeSlice read_native_slice(const std::filesystem::path& file, Index part, Index parts);

/// Refuses what shows only with the other slices: cells and faces must name each other, and nodes be in use. `sides` are those of
/// the slice's cells, `named` is the number of cells that all faces have, `used` is 0 for each node of the slice that no face has.
void check_native_slice(const NativeSlice& slice, const CellSides& sides, long long named, const std::vector<Index>& used);

/// orient_faces of cells and faces with these numbers in the file.
void orient_native(const std::filesystem::path& file, PolyMesh& mesh, const std::vector<Index>& cells = {},
                   const std::vector<Index>& faces = {});

/// Number of cells that the faces of the slice have.
long long named_sides(const NativeSlice& slice);

}  // namespace polyslip::mesh
