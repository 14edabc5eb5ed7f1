#include "polyslip/spaces/face_weights.hpp"

#include "polyslip/geometry/faces.hpp"
#include "polyslip/spaces/vem_cell.hpp"

namespace polyslip::spaces {

FaceWeights::FaceWeights(const mesh::PolyMesh& mesh) : rows_(mesh.face_nodes), g_(rows_.values.size()) {
  std::vector<Vec3> points;
  for (Index face = 0; face < rows_.rows(); ++face) {
    face_points(mesh, face, points);
    const std::span<Vec3> g = std::span(g_).subspan(static_cast<std::size_t>(rows_.offsets[face]), points.size());
    geometry::vector_weights(mesh.dim, points, g);
    flops_ += geometry::vector_weights_flops(mesh.dim, static_cast<int>(points.size()));
  }
}

}  // namespace polyslip::spaces
