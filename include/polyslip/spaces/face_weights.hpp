// Vector weights of all faces of a mesh at once (geometry/faces.hpp), for loops over all of its cells: each face is seen by two.
#pragma once

#include <span>
#include <vector>

#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::spaces {

class FaceWeights {
 public:
  explicit FaceWeights(const mesh::PolyMesh& mesh);

  /// g_s of the nodes of a face, in their order; of edges and triangles, where they are alike, once.
  [[nodiscard]] std::span<const Vec3> operator[](Index face) const {
    const Index begin = first_[static_cast<std::size_t>(face)];
    return std::span(g_).subspan(static_cast<std::size_t>(begin), static_cast<std::size_t>(first_[static_cast<std::size_t>(face) + 1] - begin));
  }
  [[nodiscard]] double flops() const { return flops_; }  ///< Floating-point operations they took.
  [[nodiscard]] double bytes() const { return static_cast<double>(g_.size() * sizeof(Vec3)); }

 private:
  std::vector<Index> first_{0};  ///< Of each face, and the end.
  std::vector<Vec3> g_;
  double flops_ = 0;
};

}  // namespace polyslip::spaces
