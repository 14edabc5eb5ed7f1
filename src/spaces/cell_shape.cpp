#include "polyslip/spaces/cell_shape.hpp"

#include <algorithm>
#include <cmath>

#include "polyslip/geometry/faces.hpp"
#include "polyslip/spaces/vem_cell.hpp"

namespace polyslip::spaces {

/// Into `shape`: warp, sizes not yet divided by h_K, and its part of d |K|, measured from xbar. Returns the area.
double ShapeMeter::add_face(Index face, const Vec3& xbar, double sign, CellShape& shape, double& volume) {
  face_points(mesh_, face, points_);
  g_.resize(points_.size());
  w_.resize(points_.size());
  geometry::vector_weights(mesh_.dim, points_, g_);
  for (std::size_t i = 0; i < points_.size(); ++i) volume += sign * g_[i].dot(points_[i] - xbar);
  const geometry::FaceGeometry geometry = geometry::face_geometry(points_, g_, w_);
  const double size = mesh_.dim == 2 ? geometry.area : std::sqrt(geometry.area);
  shape.smallest_face = std::min(shape.smallest_face, size);
  if (mesh_.dim == 2) return geometry.area;
  for (std::size_t i = 0; i < points_.size(); ++i) {
    shape.smallest_face = std::min(shape.smallest_face, (points_[i] - points_[i == 0 ? points_.size() - 1 : i - 1]).norm());
    shape.warp = std::max(shape.warp, std::abs((points_[i] - geometry.centre).dot(geometry.normal)) / size);
  }
  return geometry.area;
}

CellShape ShapeMeter::measure(Index cell) {
  diameter_ = mesh::cell_diameter(mesh_, cell);
  const Vec3 xbar = mesh::cell_node_average(mesh_, cell);
  CellShape shape;
  shape.smallest_face = diameter_;
  double surface = 0, volume = 0;  // d |K|
  for (const Index face : mesh_.cell_faces[cell]) surface += add_face(face, xbar, mesh_.orientation(cell, face), shape, volume);
  shape.flatness = diameter_ * surface / volume;
  shape.smallest_face /= diameter_;
  return shape;
}

}  // namespace polyslip::spaces
