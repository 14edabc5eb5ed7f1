#include "polyslip/mesh/fracture_parts.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "polyslip/mesh/face_tools.hpp"

namespace polyslip::mesh {

FaceFinder::FaceFinder(const PolyMesh& mesh) {
  by_x_.reserve(mesh.n_faces());
  for (Index f = 0; f < mesh.n_faces(); ++f) by_x_.emplace_back(node_average(mesh, f).x(), f);
  std::sort(by_x_.begin(), by_x_.end());
}

std::span<const std::pair<double, Index>> FaceFinder::between(double from, double to) const {
  const auto begin = std::lower_bound(by_x_.begin(), by_x_.end(), std::pair<double, Index>(from, -1));
  const auto end = std::find_if(begin, by_x_.end(), [&](const auto& entry) { return entry.first > to; });
  return {begin, end};
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
