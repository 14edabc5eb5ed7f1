#include "polyslip/spaces/face_weights.hpp"

#include <algorithm>

#include "polyslip/geometry/faces.hpp"
#include "polyslip/spaces/vem_cell.hpp"

namespace polyslip::spaces {

FaceWeights::FaceWeights(const mesh::PolyMesh& mesh) {
  const auto simplex = static_cast<Index>(mesh.dim);  // nodes
  first_.reserve(static_cast<std::size_t>(mesh.n_faces()) + 1);
  for (Index face = 0; face < mesh.n_faces(); ++face) {
    const Index nodes = mesh.face_nodes.row_size(face);
    first_.push_back(first_.back() + (nodes == simplex ? 1 : nodes));
  }
  g_.resize(static_cast<std::size_t>(first_.back()));
  std::vector<Vec3> points, g;
  for (Index face = 0; face < mesh.n_faces(); ++face) {
    face_points(mesh, face, points);
    g.resize(points.size());
    geometry::vector_weights(mesh.dim, points, g);
    const auto begin = static_cast<std::size_t>(first_[face]), end = static_cast<std::size_t>(first_[face + 1]);
    std::copy_n(g.begin(), end - begin, g_.begin() + static_cast<std::ptrdiff_t>(begin));
    flops_ += geometry::vector_weights_flops(mesh.dim, static_cast<int>(points.size()));
  }
}

}  // namespace polyslip::spaces
