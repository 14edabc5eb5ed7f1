// Vector weights of all faces of a mesh at once (geometry/faces.hpp), for loops over all of its cells: each face is seen by two.
#pragma once

#include <span>
#include <vector>

#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::spaces {

class FaceWeights {
 public:
  explicit FaceWeights(const mesh::PolyMesh& mesh);

  /// g_s of the nodes of a face, in their order.
  [[nodiscard]] std::span<const Vec3> operator[](Index face) const {
    return std::span(g_).subspan(static_cast<std::size_t>(rows_.offsets[face]), static_cast<std::size_t>(rows_.row_size(face)));
  }
  [[nodiscard]] double flops() const { return flops_; }  ///< Floating-point operations they took.
  [[nodiscard]] double bytes() const { return static_cast<double>(g_.size() * sizeof(Vec3)); }

 private:
  const Csr& rows_;
  std::vector<Vec3> g_;
  double flops_ = 0;
};

}  // namespace polyslip::spaces
