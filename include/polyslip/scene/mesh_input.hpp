// The mesh of a scene, from its file or box to the parts of the ranks.
#pragma once

#include <filesystem>
#include <optional>

#include "polyslip/mesh/sliced_mesh.hpp"
#include "polyslip/scene/scene.hpp"

namespace polyslip::scene {

/// A mesh that is not yet distributed: whole on rank 0, or in slices.
struct MeshInput {
  mesh::PolyMesh whole;
  std::optional<mesh::SlicedMesh> slices;
};

/// The mesh, checked against the scene. Several ranks read a native file in slices, unless the scene marks fractures in it or writes it
/// again (into `directory`): then, as Gmsh files and boxes, it passes through rank 0 (build_serial_mesh). Throws InputError on all ranks
/// alike.
MeshInput read_mesh(MPI_Comm comm, const Scene& scene, const std::filesystem::path& directory);

/// The parts, with what the unknowns of the scene need.
mesh::DistributedMesh distribute(MPI_Comm comm, MeshInput&& input, const Scene& scene);

}  // namespace polyslip::scene
