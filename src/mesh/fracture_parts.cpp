#include "polyslip/mesh/fracture_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "polyslip/mesh/face_tools.hpp"

namespace polyslip::mesh {

namespace {

/// What Eigen's tree asks for: it descends while intersectVolume says so and stops once intersectObject returns true.
struct Query {
  const PolyMesh& mesh;
  const FlatRegion& region;
  std::vector<Index> found;

  [[nodiscard]] bool intersectVolume(const Eigen::AlignedBox3d& box) const { return region.meets(box); }
  bool intersectObject(Index face) {
    if (region.meets(Eigen::AlignedBox3d(node_average(mesh, face)))) found.push_back(face);
    return false;
  }
};

}  // namespace

FlatRegion::FlatRegion(std::span<const Vec3> points, const Vec3& unit_normal, double slack_)
    : origin(points[0]), normal(unit_normal), slack(slack_) {
  for (const Vec3& x : points) box.extend(x);
  box.min().array() -= slack;
  box.max().array() += slack;
}

bool FlatRegion::meets(const Eigen::AlignedBox3d& other) const {
  return box.intersects(other) &&
         std::abs(normal.dot(other.center() - origin)) <= 0.5 * normal.cwiseAbs().dot(other.sizes()) + slack;
}

FaceFinder::FaceFinder(const PolyMesh& mesh, const Eigen::AlignedBox3d& bounds) : mesh_(mesh) {
  std::vector<Index> faces;
  std::vector<Eigen::AlignedBox3d> boxes;
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    const Vec3 x = node_average(mesh, f);
    if (!bounds.contains(x)) continue;
    faces.push_back(f);
    boxes.emplace_back(x);
  }
  tree_.init(faces.begin(), faces.end(), boxes.begin(), boxes.end());
}

std::vector<Index> FaceFinder::near(const FlatRegion& region) const {
  Query query{mesh_, region, {}};
  Eigen::BVIntersect(tree_, query);
  std::sort(query.found.begin(), query.found.end());
  return std::move(query.found);
}

double distance_to_segment(const Vec3& x, const Vec3& a, const Vec3& b) {
  const Vec3 along = b - a;
  const double length2 = along.squaredNorm();
  const double t = length2 > 0.0 ? std::clamp((x - a).dot(along) / length2, 0.0, 1.0) : 0.0;
  return (x - a - t * along).norm();
}

std::string point_text(const Vec3& x, int dim) {
  return dim == 2 ? fmt::format("({:g}, {:g})", x.x(), x.y()) : fmt::format("({:g}, {:g}, {:g})", x.x(), x.y(), x.z());
}

std::string place_text(const FractureGeometry& fracture) {
  return fmt::format("{}{}fracture '{}'", fracture.where, fracture.where.empty() ? "" : ": ", fracture.name);
}

}  // namespace polyslip::mesh
