// Area vectors, centres and weights of faces (scheme.md section 2), planar or warped, convex or not.
//
// A 3D face is triangulated about the average of its m nodes, with triangles a_i = 1/2 (x_i - c) x (x_{i+1} - c). Hat functions phi_s of this
// triangulation, 1/m at c, give the vector weights g_s = int phi_s n dS = (a_{s-1} + a_s)/3 + sum(a)/(3 m). They sum to the area vector, and
// over a closed surface sum_sigma sum_s x_s (x) g_s = |K| I exactly, warped faces included.
#pragma once

#include <span>

#include "polyslip/common/types.hpp"

namespace polyslip::geometry {

struct FaceGeometry {
  Vec3 area_vector;  ///< sum of g_s [m2; m in 2D]
  Vec3 normal;       ///< Unit mean normal.
  Vec3 centre;       ///< x_sigma = sum_s w_s x_s, the centre of mass of a planar face [m]
  double area;       ///< |area_vector|
};

/// Vector weights g_s of a face: `points` are its nodes in cyclic order (3D) or its two ends (2D: dim 2), g has as many entries.
void vector_weights(int dim, std::span<const Vec3> points, std::span<Vec3> g);

/// Geometry and scalar weights w_s = g_s . n / |sigma| (sum 1, sum_s w_s x_s = x_sigma); g from vector_weights.
FaceGeometry face_geometry(std::span<const Vec3> points, std::span<const Vec3> g, std::span<double> w);

/// Floating-point operations of the two for m points.
double vector_weights_flops(int dim, int m);
double face_geometry_flops(int m);

/// Orthonormal frame of a face, by rows: n, t_1, t_2. In 2D t_1 = (-n_y, n_x) and t_2 = e_z.
Eigen::Matrix3d face_frame(int dim, const Vec3& normal);

}  // namespace polyslip::geometry
