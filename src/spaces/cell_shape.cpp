#include "polyslip/spaces/cell_shape.hpp"

#include <algorithm>
#include <cmath>

#include "polyslip/geometry/faces.hpp"
#include "polyslip/spaces/vem_cell.hpp"

namespace polyslip::spaces {

ShapeMeter::ShapeMeter(const mesh::PolyMesh& mesh) : mesh_(mesh), sums_(static_cast<std::size_t>(mesh.n_cells())) {
  for (Index face = 0; face < mesh.n_faces(); ++face) add_face(face);
}

void ShapeMeter::add_face(Index face) {
  face_points(mesh_, face, points_);
  g_.resize(points_.size());
  w_.resize(points_.size());
  geometry::vector_weights(mesh_.dim, points_, g_);
  const geometry::FaceGeometry geometry = geometry::face_geometry(points_, g_, w_);
  double moment = 0;  // about the first node
  for (std::size_t i = 1; i < points_.size(); ++i) moment += g_[i].dot(points_[i] - points_[0]);
  double smallest_square = mesh_.dim == 2 ? geometry.area * geometry.area : geometry.area, warp = 0;
  for (std::size_t i = 0; mesh_.dim == 3 && i < points_.size(); ++i) {
    smallest_square = std::min(smallest_square, (points_[i] - points_[i == 0 ? points_.size() - 1 : i - 1]).squaredNorm());
    if (points_.size() > 3) warp = std::max(warp, std::abs((points_[i] - geometry.centre).dot(geometry.normal)));
  }
  if (warp > 0) warp /= std::sqrt(geometry.area);
  for (const Index cell : mesh_.face_cells[static_cast<std::size_t>(face)]) {
    if (cell < 0) continue;
    Sums& sums = sums_[static_cast<std::size_t>(cell)];
    const Vec3& origin = mesh_.nodes[static_cast<std::size_t>(mesh_.cell_nodes[cell][0])];
    sums.surface += geometry.area;
    sums.volume += mesh_.orientation(cell, face) * (moment + geometry.area_vector.dot(points_[0] - origin));
    sums.smallest_square = std::min(sums.smallest_square, smallest_square);
    sums.warp = std::max(sums.warp, warp);
  }
}

CellShape ShapeMeter::measure(Index cell) {
  const Sums& sums = sums_[static_cast<std::size_t>(cell)];
  diameter_ = mesh::cell_diameter(mesh_, cell);
  return {diameter_ * sums.surface / sums.volume, std::min(1.0, std::sqrt(sums.smallest_square) / diameter_), sums.warp};
}

}  // namespace polyslip::spaces
