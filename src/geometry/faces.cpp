#include "polyslip/geometry/faces.hpp"

#include <Eigen/Geometry>

namespace polyslip::geometry {

void vector_weights(int dim, std::span<const Vec3> points, std::span<Vec3> g) {
  const std::size_t m = points.size();
  if (dim == 2) {
    const Vec3 t = points[1] - points[0];
    g[0] = g[1] = 0.5 * Vec3(t.y(), -t.x(), 0.0);
    return;
  }
  if (m == 3) {
    g[0] = g[1] = g[2] = (points[1] - points[0]).cross(points[2] - points[0]) / 6.0;
    return;
  }
  Vec3 c = Vec3::Zero();
  for (const Vec3& x : points) c += x;
  c /= static_cast<double>(m);
  for (std::size_t i = 0; i < m; ++i) g[i].setZero();
  Vec3 total = Vec3::Zero();
  for (std::size_t i = 0; i < m; ++i) {
    const std::size_t j = i + 1 == m ? 0 : i + 1;
    const Vec3 third = (points[i] - c).cross(points[j] - c) / 6.0;
    g[i] += third;
    g[j] += third;
    total += third;
  }
  total /= static_cast<double>(m);
  for (std::size_t i = 0; i < m; ++i) g[i] += total;
}

FaceGeometry face_geometry(std::span<const Vec3> points, std::span<const Vec3> g, std::span<double> w) {
  FaceGeometry face;
  face.area_vector.setZero();
  for (const Vec3& v : g) face.area_vector += v;
  face.area = face.area_vector.norm();
  face.normal = face.area_vector / face.area;
  face.centre.setZero();
  for (std::size_t s = 0; s < points.size(); ++s) {
    w[s] = g[s].dot(face.normal) / face.area;
    face.centre += w[s] * (points[s] - points[0]);
  }
  face.centre += points[0];
  return face;
}

double vector_weights_flops(int dim, int m) {
  if (dim == 2) return 6;
  if (m == 3) return 18;       // two differences, cross product, division
  return 3.0 * m + 3         // centre
         + (18 + 9) * m      // thirds of the triangles: two differences, cross product, division; three sums
         + 3 + 3.0 * m;      // the share of the centre
}

double face_geometry_flops(int m) {
  return 3.0 * m + 9         // area vector, its norm and direction
         + 15.0 * m + 3;     // weights (dot product, division) and centre
}

Eigen::Matrix3d face_frame(int dim, const Vec3& normal) {
  Eigen::Matrix3d frame;
  frame.row(0) = normal.transpose();
  if (dim == 2) {
    frame.row(1) = Vec3(-normal.y(), normal.x(), 0.0).transpose();
    frame.row(2) = Vec3::UnitZ().transpose();
    return frame;
  }
  Eigen::Index smallest = 0;
  normal.cwiseAbs().minCoeff(&smallest);
  const Vec3 t1 = normal.cross(Vec3::Unit(smallest)).normalized();
  frame.row(1) = t1.transpose();
  frame.row(2) = normal.cross(t1).transpose();
  return frame;
}

}  // namespace polyslip::geometry
