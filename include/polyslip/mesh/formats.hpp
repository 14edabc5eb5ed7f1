// One reader a file format; read_mesh (readers.hpp) chooses.
#pragma once

#include <filesystem>

#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::mesh {

/// Throws InputError where there is no such file.
void require_file(const std::filesystem::path& file);

/// Gmsh msh 2.2 or 4.1, text or binary, first order: triangles and quadrilaterals (in the plane z = 0), or tetrahedra,
/// hexahedra, prisms and pyramids, mixed or not. The first physical group of an element of the highest dimension is the region of
/// its cell, that of an element one dimension lower the tag of its face, inside or on the boundary. Groups without a name are
/// called "dim:number".
PolyMesh read_gmsh(const std::filesystem::path& file);

/// Checks counts and references of nodes, elements and entities of a Gmsh file; PETSc's reader takes them on trust and steps out of
/// its arrays where they are wrong. Throws InputError with section and element, also for other versions.
void check_gmsh(const std::filesystem::path& file);

/// The native format, as write_native leaves it.
PolyMesh read_native(const std::filesystem::path& file);

}  // namespace polyslip::mesh
