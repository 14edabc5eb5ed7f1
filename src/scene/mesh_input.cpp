#include "polyslip/scene/mesh_input.hpp"

#include <array>
#include <utility>

#include "polyslip/common/mpi.hpp"
#include "polyslip/scene/checks.hpp"
#include "polyslip/scene/prepare.hpp"

namespace polyslip::scene {

namespace {

bool is_read_in_slices(MPI_Comm comm, const Scene& scene) {
  return mpi::size(comm) > 1 && !scene.mesh.box && scene.mesh.file.extension() == ".h5" && scene.fractures.empty() &&
         scene.mesh.write.empty();
}

/// Names of the whole mesh, and the box around the nodes of all slices.
MeshNames names_over_ranks(const mesh::SlicedMesh& mesh) {
  MeshNames names = names_of(mesh.slice().mesh);
  std::array<double, 6> ends;
  for (int i = 0; i < 3; ++i) {
    ends[i] = names.low[i];
    ends[3 + i] = -names.high[i];
  }
  mpi::min_in_place(mesh.comm(), ends);
  for (int i = 0; i < 3; ++i) {
    names.low[i] = ends[i];
    names.high[i] = -ends[3 + i];
  }
  return names;
}

}  // namespace

MeshInput read_mesh(MPI_Comm comm, const Scene& scene, const std::filesystem::path& directory) {
  MeshInput input;
  if (is_read_in_slices(comm, scene)) {
    input.slices.emplace(mesh::read_sliced(comm, scene.mesh.file));
    check_names(scene, names_over_ranks(*input.slices));
  } else {
    input.whole = build_serial_mesh(comm, scene, directory);
  }
  return input;
}

mesh::DistributedMesh distribute(MPI_Comm comm, MeshInput&& input, const Scene& scene) {
  if (input.slices) return mesh::distribute(*std::exchange(input.slices, std::nullopt), partition_options(scene));
  return mesh::distribute(comm, std::move(input.whole), partition_options(scene));
}

}  // namespace polyslip::scene
