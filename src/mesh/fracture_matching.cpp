// Mesh faces on the segments (2D) and planar polygons (3D) of a scene.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "polyslip/common/error.hpp"
#include "polyslip/mesh/face_tools.hpp"
#include "polyslip/mesh/fracture_parts.hpp"

namespace polyslip::mesh {
namespace {

/// A node lies on a fracture if it is closer to it than this part of the extent of its face. Coordinates in scenes have fewer
/// digits than those of meshes; cells much thinner than this beside a fracture would be taken for the fracture.
constexpr double kTolerance = 1e-5;
const char* const kRemedy =
    "Make the mesh follow the fracture: in a box choose cells (or grading) so that mesh planes fall on the fracture and nodes on "
    "its ends; in "
    "Gmsh embed the fracture in its volume";

double face_extent(const PolyMesh& mesh, Index face) {
  const auto nodes = mesh.face_nodes[face];
  double extent2 = 0.0;
  for (const Index s : nodes) extent2 = std::max(extent2, (mesh.nodes[s] - mesh.nodes[nodes[0]]).squaredNorm());
  return std::sqrt(extent2);
}

/// Straight piece of a polyline and the faces on it.
class Segment {
 public:
  Segment(const Vec3& from, const Vec3& to) : from_(from), length_((to - from).norm()), along_((to - from) / length_) {}

  /// Faces on the segment are shorter than it, and so is the distance of their nodes to it.
  [[nodiscard]] FlatRegion region() const {
    return {std::array{from_, Vec3(from_ + length_ * along_)}, Vec3(along_.y(), -along_.x(), 0.0), kTolerance * length_};
  }
  /// Takes the face if both its ends lie on the segment.
  bool take(const PolyMesh& mesh, Index face) {
    const auto nodes = mesh.face_nodes[face];
    const Vec3 a = mesh.nodes[nodes[0]] - from_, b = mesh.nodes[nodes[1]] - from_;
    const double tolerance = kTolerance * (b - a).norm();
    for (const Vec3& x : {a, b}) {
      const double t = x.dot(along_);
      if (t < -tolerance || t > length_ + tolerance || (x - t * along_).norm() > tolerance) return false;
    }
    covered_.push_back(std::minmax({a.dot(along_), b.dot(along_)}));
    return true;
  }
  /// The + side is to the left, so n^+ points to the right: the face then runs along the segment.
  [[nodiscard]] bool turned(const PolyMesh& mesh, Index face) const {
    const auto nodes = mesh.face_nodes[face];
    return (mesh.nodes[nodes[1]] - mesh.nodes[nodes[0]]).dot(along_) < 0.0;
  }
  /// Ends of the uncovered parts, one behind the other; none if the segment is covered.
  std::vector<std::pair<Vec3, Vec3>> gaps() {
    std::sort(covered_.begin(), covered_.end());
    std::vector<std::pair<Vec3, Vec3>> result;
    double end = 0.0, size = length_;
    const auto close_gap = [&](double next, double next_size) {
      if (next - end > 2.0 * kTolerance * std::min(size, next_size))
        result.emplace_back(from_ + end * along_, from_ + next * along_);
    };
    for (const auto& [a, b] : covered_) {
      close_gap(a, b - a);
      end = b;
      size = b - a;
    }
    close_gap(length_, size);
    return result;
  }

 private:
  Vec3 from_;
  double length_;
  Vec3 along_;
  std::vector<std::pair<double, double>> covered_;
};

std::vector<FractureFace> match_polyline(const PolyMesh& mesh, const FaceFinder& finder, const FractureGeometry& fracture) {
  std::vector<FractureFace> result;
  for (std::size_t i = 0; i + 1 < fracture.points.size(); ++i) {
    const Vec3 &from = fracture.points[i], &to = fracture.points[i + 1];
    if (from == to) {
      throw InputError(fmt::format("points {} and {} are both {}", i + 1, i + 2, point_text(from, 2)), place_text(fracture),
                       "Remove one of them");
    }
    Segment segment(from, to);
    for (const Index face : finder.near(segment.region())) {
      if (segment.take(mesh, face)) result.push_back({face, segment.turned(mesh, face)});
    }
    if (const auto gaps = segment.gaps(); !gaps.empty()) {
      const std::string more =
          gaps.size() > 1 ? fmt::format(" and {} more part{}", gaps.size() - 1, gaps.size() > 2 ? "s" : "") : "";
      throw InputError(fmt::format("no mesh faces from {} to {}{} on the piece from point {} to point {}",
                                   point_text(gaps[0].first, 2), point_text(gaps[0].second, 2), more, i + 1, i + 2),
                       place_text(fracture), kRemedy);
    }
  }
  return result;
}

/// Planar polygon, convex or not.
class Polygon {
 public:
  explicit Polygon(const FractureGeometry& fracture) : corners_(fracture.points) {
    Vec3 area = Vec3::Zero();
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      area += 0.5 * (corners_[i] - corners_[0]).cross(corners_[(i + 1) % corners_.size()] - corners_[0]);
      extent_ = std::max(extent_, (corners_[i] - corners_[0]).norm());
    }
    if (!(area.norm() > 1e-12 * extent_ * extent_)) {
      throw InputError("its corners lie on one line", place_text(fracture),
                       "Give three or more corners of a planar polygon, in order");
    }
    normal_ = area.normalized();
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      const double off = normal_.dot(corners_[i] - corners_[0]);
      if (std::abs(off) > kTolerance * extent_) {
        throw InputError(fmt::format("corner {} at {} lies {:g} m off the plane of the others", i + 1, point_text(corners_[i], 3),
                                     std::abs(off)),
                         place_text(fracture), "Correct it or split the fracture into planar ones");
      }
    }
    first_ = (corners_[1] - corners_[0]).normalized();
    second_ = normal_.cross(first_);
  }

  [[nodiscard]] const Vec3& normal() const { return normal_; }
  [[nodiscard]] FlatRegion region() const { return {corners_, normal_, kTolerance * extent_}; }
  [[nodiscard]] const std::vector<Vec3>& corners() const { return corners_; }

  /// All nodes on the polygon, and the middle inside: the face does not bridge a notch.
  [[nodiscard]] bool holds(const PolyMesh& mesh, Index face) const {
    const auto nodes = mesh.face_nodes[face];
    const double tolerance = kTolerance * face_extent(mesh, face);
    const auto off_plane = [&](Index s) { return std::abs(normal_.dot(mesh.nodes[s] - corners_[0])) > tolerance; };
    if (std::any_of(nodes.begin(), nodes.end(), off_plane)) return false;
    const auto on_polygon = [&](Index s) { return inside(mesh.nodes[s]) || distance_to_outline(mesh.nodes[s]) <= tolerance; };
    return inside(node_average(mesh, face)) && std::all_of(nodes.begin(), nodes.end(), on_polygon);
  }
  [[nodiscard]] bool outline_holds(const Vec3& a, const Vec3& b) const {
    const double tolerance = 2.0 * kTolerance * (b - a).norm();
    const Vec3 middle = 0.5 * (a + b);
    return distance_to_outline(a) <= tolerance && distance_to_outline(b) <= tolerance && distance_to_outline(middle) <= tolerance;
  }

 private:
  /// Even-odd rule in the plane.
  [[nodiscard]] bool inside(const Vec3& x) const {
    bool odd = false;
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      const Vec3 a = corners_[i] - x, b = corners_[(i + 1) % corners_.size()] - x;
      const double ya = a.dot(second_), yb = b.dot(second_);
      if ((ya > 0.0) == (yb > 0.0)) continue;
      const double xa = a.dot(first_), xb = b.dot(first_);
      if (xa - ya * (xb - xa) / (yb - ya) > 0.0) odd = !odd;
    }
    return odd;
  }
  [[nodiscard]] double distance_to_outline(const Vec3& x) const {
    double distance = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      distance = std::min(distance, distance_to_segment(x, corners_[i], corners_[(i + 1) % corners_.size()]));
    }
    return distance;
  }

  const std::vector<Vec3>& corners_;
  double extent_ = 0.0;
  Vec3 normal_, first_, second_;
};

/// The faces cover the polygon if every edge that bounds only one of them lies on its outline. Throws with the box around what is
/// missing.
void check_cover(const PolyMesh& mesh, const Polygon& polygon, const std::vector<Index>& faces, const FractureGeometry& fracture) {
  Eigen::AlignedBox3d missing;
  if (faces.empty()) {
    for (const Vec3& corner : polygon.corners()) missing.extend(corner);
  }
  std::vector<char> reached(polygon.corners().size(), false);
  for_each_shared_rim(sorted_rims(mesh, faces), [&](std::span<const Rim> rims) {
    if (rims.size() != 1) return;
    const Vec3 &a = mesh.nodes[rims[0].low], &b = mesh.nodes[rims[0].high];
    if (!polygon.outline_holds(a, b)) {
      missing.extend(a);
      missing.extend(b);
    }
    for (std::size_t i = 0; i < reached.size(); ++i) {
      if (distance_to_segment(polygon.corners()[i], a, b) <= 2.0 * kTolerance * (b - a).norm()) reached[i] = true;
    }
  });
  if (missing.isEmpty()) return;
  for (std::size_t i = 0; i < reached.size(); ++i) {
    if (!reached[i]) missing.extend(polygon.corners()[i]);
  }
  throw InputError(
      fmt::format("no mesh faces on a part of it within {} to {}", point_text(missing.min(), 3), point_text(missing.max(), 3)),
      place_text(fracture), kRemedy);
}

std::vector<FractureFace> match_polygon(const PolyMesh& mesh, const FaceFinder& finder, const FractureGeometry& fracture) {
  const Polygon polygon(fracture);
  std::vector<Index> faces = finder.near(polygon.region());
  std::erase_if(faces, [&](Index face) { return !polygon.holds(mesh, face); });
  check_cover(mesh, polygon, faces, fracture);

  std::vector<FractureFace> result;
  for (const Index face : faces) {  // the + side is where the polygon's normal points, n^+ points away from it
    result.push_back({face, area_vector(mesh, face).dot(polygon.normal()) > 0.0});
  }
  return result;
}

}  // namespace

std::vector<FractureFace> match_points(const PolyMesh& mesh, const FaceFinder& finder, const FractureGeometry& fracture) {
  if (static_cast<int>(fracture.points.size()) < mesh.dim) {
    throw InputError(fmt::format("{} points are too few", fracture.points.size()), place_text(fracture),
                     mesh.dim == 2 ? "Give two or more points of a polyline" : "Give three or more corners of a planar polygon");
  }
  return mesh.dim == 2 ? match_polyline(mesh, finder, fracture) : match_polygon(mesh, finder, fracture);
}

}  // namespace polyslip::mesh
