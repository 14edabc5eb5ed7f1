#include "polyslip/spaces/cell_shape.hpp"

#include <algorithm>
#include <cmath>

#include "polyslip/geometry/faces.hpp"

namespace polyslip::spaces {

namespace {

/// Into `shape`: warp, and sizes not yet divided by h_K. Returns the area.
double add_face(int dim, std::span<const Vec3> points, CellShape& shape) {
  std::vector<Vec3> g(points.size());
  std::vector<double> w(points.size());
  geometry::vector_weights(dim, points, g);
  const geometry::FaceGeometry face = geometry::face_geometry(points, g, w);
  const double size = dim == 2 ? face.area : std::sqrt(face.area);
  shape.smallest_face = std::min(shape.smallest_face, size);
  if (dim == 2) return face.area;
  for (std::size_t i = 0; i < points.size(); ++i) {
    shape.smallest_face = std::min(shape.smallest_face, (points[i] - points[i == 0 ? points.size() - 1 : i - 1]).norm());
    shape.warp = std::max(shape.warp, std::abs((points[i] - face.centre).dot(face.normal)) / size);
  }
  return face.area;
}

}  // namespace

CellShape cell_shape(const mesh::PolyMesh& mesh, const VemCell& vem) {
  CellShape shape;
  shape.smallest_face = vem.diameter();
  double surface = 0;
  std::vector<Vec3> points;
  for (const Index face : mesh.cell_faces[vem.cell()]) {
    face_points(mesh, face, points);
    surface += add_face(mesh.dim, points, shape);
  }
  shape.flatness = vem.diameter() * surface / (mesh.dim * vem.volume());
  shape.smallest_face /= vem.diameter();
  return shape;
}

}  // namespace polyslip::spaces
