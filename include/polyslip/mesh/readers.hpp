// Meshes from files: Gmsh msh 2.2 and 4.1 through PETSc's reader, and the native HDF5 polytopal format, read and written.
#pragma once

#include <filesystem>

#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::mesh {

/// Serial mesh from `file` by its ending: .msh (Gmsh) or .h5 (native). Call on one rank. Copies are not built; fractures are
/// marked only where a native file has them. Boundary faces that a Gmsh file leaves without group are tagged left, right, ... (as
/// generated boxes are) where they lie on a side of the bounding box.
/// Throws InputError: missing file, unknown format, non-manifold face, degenerate cell, ... each with file, place and remedy.
PolyMesh read_mesh(const std::filesystem::path& file);

/// Writes topology, coordinates, regions, tags and fractures in the native format (documented in native_mesh.cpp).
void write_native(const PolyMesh& mesh, const std::filesystem::path& file);

}  // namespace polyslip::mesh
