#include "polyslip/geometry/quadrature.hpp"

#include <Eigen/Geometry>
#include <array>
#include <cmath>

namespace polyslip::geometry {

namespace {

/// 4 points of degree 2 (Hammer and Stroud).
void append_tetrahedron(const std::array<Vec3, 4>& p, double volume, std::vector<QuadraturePoint>& rule) {
  constexpr double a = 0.1381966011250105, b = 0.5854101966249685;
  const Vec3 sum = p[0] + p[1] + p[2] + p[3];
  for (const Vec3& x : p) rule.push_back({a * sum + (b - a) * x, volume / 4});
}

/// 3 points of degree 2.
void append_triangle(const std::array<Vec3, 3>& p, double area, std::vector<QuadraturePoint>& rule) {
  const Vec3 sum = p[0] + p[1] + p[2];
  for (const Vec3& x : p) rule.push_back({(sum + 3 * x) / 6, area / 3});
}

Vec3 average(std::span<const Vec3> points) {
  Vec3 c = Vec3::Zero();
  for (const Vec3& x : points) c += x;
  return c / static_cast<double>(points.size());
}

}  // namespace

void append_cone_rule(int dim, const Vec3& apex, std::span<const Vec3> face_points, double sign, std::vector<QuadraturePoint>& rule) {
  if (dim == 2) {
    const Vec3 t = face_points[1] - face_points[0];
    const Vec3 area_vector(t.y(), -t.x(), 0.0);
    append_triangle({apex, face_points[0], face_points[1]}, sign * area_vector.dot(face_points[0] - apex) / 2, rule);
    return;
  }
  const Vec3 c = average(face_points);
  const std::size_t m = face_points.size();
  const bool triangle = m == 3;
  for (std::size_t i = 0; i < (triangle ? 1 : m); ++i) {
    const Vec3& x = face_points[i];
    const Vec3& y = face_points[i + 1 == m ? 0 : i + 1];
    const Vec3& z = triangle ? face_points[2] : c;
    append_tetrahedron({apex, x, y, z}, sign * (x - apex).dot((y - apex).cross(z - apex)) / 6, rule);
  }
}

void append_face_rule(int dim, std::span<const Vec3> face_points, const Vec3& normal, std::vector<QuadraturePoint>& rule) {
  if (dim == 2) {
    const Vec3 t = face_points[1] - face_points[0];
    const Vec3 middle = (face_points[0] + face_points[1]) / 2;
    for (double s : {-0.5, 0.5}) rule.push_back({middle + s / std::sqrt(3.0) * t, t.norm() / 2});
    return;
  }
  const Vec3 c = average(face_points);
  const std::size_t m = face_points.size();
  for (std::size_t i = 0; i < m; ++i) {
    const Vec3& x = face_points[i];
    const Vec3& y = face_points[i + 1 == m ? 0 : i + 1];
    append_triangle({c, x, y}, normal.dot((x - c).cross(y - c)) / 2, rule);
  }
}

}  // namespace polyslip::geometry
