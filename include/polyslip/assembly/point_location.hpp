// The owned cell or fracture face that a point belongs to, the same on any number of ranks.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "polyslip/mesh/distributed_mesh.hpp"

namespace polyslip::assembly {

/// What a search over all ranks has found.
struct Located {
  Index local = -1;     ///< Owned cell, or owned fracture face; -1 on all ranks but one.
  double distance = 0;  ///< How far the point lies away from it [m]; about 0 inside. The same on all ranks.
  bool found = false;   ///< Whether there was anything to be found; the same on all ranks.
};

/// The cell that holds a point or comes closest to it, by the planes of its faces. Of several equally near, that with the lowest
/// number in the serial mesh. Collective.
std::vector<Located> locate_in_cells(const mesh::DistributedMesh& mesh, std::span<const Vec3> points);
Located locate_in_cells(const mesh::DistributedMesh& mesh, const Vec3& at);

/// The face of a fracture (its name) that is nearest to a point; likewise. Collective.
Located locate_on_fracture(const mesh::DistributedMesh& mesh, const std::string& fracture, const Vec3& at);

}  // namespace polyslip::assembly
