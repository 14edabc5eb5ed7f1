// Pieces of mark_fractures: faces found by place or by group, and the words of its messages.
#pragma once

#include <Eigen/Geometry>
#include <span>
#include <string>
#include <unsupported/Eigen/BVH>
#include <utility>
#include <vector>

#include "polyslip/mesh/fractures.hpp"

namespace polyslip::mesh {

/// A face of a fracture. `turn` says that it must be turned for its normal to be n^+.
struct FractureFace {
  Index face;
  bool turn;
};

/// Where the faces on a flat piece of a fracture can have their node averages: in a box and near a line (2D) or plane (3D).
struct FlatRegion {
  Eigen::AlignedBox3d box;
  Vec3 origin, normal;
  double slack;  ///< [m]

  FlatRegion(std::span<const Vec3> points, const Vec3& unit_normal, double slack);
  [[nodiscard]] bool meets(const Eigen::AlignedBox3d& other) const;
};

/// Finds faces by the place of their node average, in a tree of boxes: a query costs about as much as it finds.
class FaceFinder {
 public:
  /// Knows the faces whose node average lies in `bounds`.
  FaceFinder(const PolyMesh& mesh, const Eigen::AlignedBox3d& bounds);
  /// Faces whose node average may lie in the region, ascending.
  [[nodiscard]] std::vector<Index> near(const FlatRegion& region) const;

 private:
  const PolyMesh& mesh_;
  Eigen::KdBVH<double, 3, Index> tree_;
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
