// Rules of degree 2 on polygons and polyhedra, by simplices about the average of the nodes. Simplices are signed, so that polynomials up to
// degree 2 are integrated exactly on non-convex cells too.
#pragma once

#include <span>
#include <vector>

#include "polyslip/common/types.hpp"

namespace polyslip::geometry {

struct QuadraturePoint {
  Vec3 x;         ///< [m]
  double weight;  ///< Signed measure [m3, m2 or m].
};

/// Appends the rule of the cone with apex `apex` over a face (3D: tetrahedra over the face's triangles; 2D: one triangle), oriented outwards
/// when sign = +1 for a face whose normal points away from the apex.
void append_cone_rule(int dim, const Vec3& apex, std::span<const Vec3> face_points, double sign, std::vector<QuadraturePoint>& rule);

/// Appends the rule of a face (3D: triangles about the average of its nodes; 2D: segment), weights positive along `normal`.
void append_face_rule(int dim, std::span<const Vec3> face_points, const Vec3& normal, std::vector<QuadraturePoint>& rule);

}  // namespace polyslip::geometry
