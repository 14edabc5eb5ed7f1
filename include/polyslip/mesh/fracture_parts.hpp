// Pieces of mark_fractures: faces found by place or by group, and the words of its messages.
#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "polyslip/mesh/fractures.hpp"

namespace polyslip::mesh {

/// A face of a fracture. `turn` says that it must be turned for its normal to be n^+.
struct FractureFace {
  Index face;
  bool turn;
};

/// Finds faces by the place of their node average: sorted along x.
class FaceFinder {
 public:
  explicit FaceFinder(const PolyMesh& mesh);
  /// Faces whose node average lies in [from, to] along x, in that order.
  [[nodiscard]] std::span<const std::pair<double, Index>> between(double from, double to) const;

 private:
  std::vector<std::pair<double, Index>> by_x_;
};

/// Faces that make up a fracture given by points, turned as fractures.hpp says. Throws InputError where it is not covered.
std::vector<FractureFace> match_points(const PolyMesh& mesh, const FaceFinder& finder, const FractureGeometry& fracture);
/// Faces of a physical group, the side carried from face to face. Throws InputError for an unknown or empty group.
std::vector<FractureFace> match_group(const PolyMesh& mesh, const FractureGeometry& fracture);

/// Distance of x to the segment from a to b (a point where they coincide) [m].
double distance_to_segment(const Vec3& x, const Vec3& a, const Vec3& b);

/// "(1, 2, 3)", or "(1, 2)" in 2D.
std::string point_text(const Vec3& x, int dim);
/// "scene.yaml:12 (fractures[0]): fracture 'name'", how every message begins.
std::string place_text(const FractureGeometry& fracture);

}  // namespace polyslip::mesh
