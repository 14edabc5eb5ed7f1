#include "polyslip/spaces/hfv_cell.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "polyslip/common/error.hpp"
#include "polyslip/spaces/vem_cell.hpp"

namespace polyslip::spaces {

namespace {

/// From this warp on (below) faces are refused: the fluxes of a linear pressure are wrong by about as much. Coordinates in single
/// precision, and vertices that a Voronoi mesh merges, stay below.
constexpr double warp_tolerance = 1e-6;
/// Cones flatter than this, in units of the root of the element's measure, count as inside out.
constexpr double flat_cone = 1e-10;

std::string text(const Vec3& x) { return fmt::format("({:g}, {:g}, {:g})", x.x(), x.y(), x.z()); }

/// Largest distance of the nodes from the mean plane in units of the face's diameter.
double warp(std::span<const Vec3> points, const geometry::FaceGeometry& face) {
  double away = 0, radius = 0;
  for (const Vec3& x : points) {
    away = std::max(away, std::abs(face.normal.dot(x - face.centre)));
    radius = std::max(radius, (x - face.centre).norm());
  }
  return away / (2 * radius);
}

[[noreturn]] void refuse_warped(const Vec3& face_centre, double warp, const std::string& whose) {
  throw InputError(
      fmt::format("the face at {} is warped by {:g} of its diameter; flow needs planar faces", text(face_centre), warp), whose,
      "Set mesh.box.shape: cut, or cut the faces of the mesh into triangles");
}

}  // namespace

geometry::FaceGeometry face_geometry(const mesh::PolyMesh& mesh, Index face) {
  std::vector<Vec3> points;
  face_points(mesh, face, points);
  std::vector<Vec3> g(points.size());
  std::vector<double> w(points.size());
  geometry::vector_weights(mesh.dim, points, g);
  return geometry::face_geometry(points, g, w);
}

void HfvCell::add_face(Index face) {
  face_points(mesh_, face, points_);
  g_.resize(points_.size());
  w_.resize(points_.size());
  geometry::vector_weights(mesh_.dim, points_, g_);
  const auto geometry = geometry::face_geometry(points_, g_, w_);
  if (const double bent = points_.size() > 3 ? warp(points_, geometry) : 0.0; bent > warp_tolerance)
    refuse_warped(geometry.centre, bent, fmt::format("cell {} at {}", cell_, text(cell_node_average(mesh_, cell_))));
  faces_.push_back({geometry.area, mesh_.orientation(cell_, face) * geometry.normal, geometry.centre, 0.0});
}

void HfvCell::add_ridges(Index face) {
  face_points(mesh_, face, points_);
  const std::size_t m = points_.size();
  if (mesh_.dim == 2) {
    const Vec3 t = (points_[1] - points_[0]).normalized();
    faces_.push_back({1.0, -t, points_[0], 0.0});
    faces_.push_back({1.0, t, points_[1], 0.0});
    return;
  }
  g_.resize(m);
  w_.resize(m);
  geometry::vector_weights(3, points_, g_);
  const auto geometry = geometry::face_geometry(points_, g_, w_);
  if (const double bent = m > 3 ? warp(points_, geometry) : 0.0; bent > warp_tolerance)
    refuse_warped(geometry.centre, bent, "fracture " + mesh_.fracture_names[static_cast<std::size_t>(mesh_.face_fracture[face])]);
  for (std::size_t i = 0; i < m; ++i) {
    const Vec3& x = points_[i];
    const Vec3& y = points_[i + 1 == m ? 0 : i + 1];
    faces_.push_back({(y - x).norm(), (y - x).cross(geometry.normal).normalized(), (x + y) / 2, 0.0});
  }
}

bool HfvCell::put_centre(const Vec3& x) {
  const double flat = flat_cone * std::pow(measure_, 1.0 / dim_);
  centre_ = x;
  bool star = true;
  for (HfvFace& face : faces_) {
    face.distance = (face.centre - x).dot(face.normal);
    star = star && face.distance > flat;
  }
  return star;
}

void HfvCell::place_centre(const Vec3& average) {
  // Cones about the average of the nodes, signed: their measures and centres of mass give those of the element.
  measure_ = 0;
  Vec3 moment = Vec3::Zero();
  for (const HfvFace& face : faces_) {
    const Vec3 y = face.centre - average;
    const double cone = face.area * y.dot(face.normal) / dim_;
    measure_ += cone;
    moment += cone * dim_ / (dim_ + 1.0) * y;
  }
  if (put_centre(average + moment / measure_) || put_centre(average)) return;
  throw InputError("the element is star-shaped neither about its centre of mass nor about the average of its nodes",
                   fmt::format("{} at {}", cell_ >= 0 ? fmt::format("cell {}", cell_) : "fracture face", text(average)),
                   "Mesh the place with elements closer to convex ones");
}

void HfvCell::build(Index cell) {
  cell_ = cell;
  dim_ = mesh_.dim;
  faces_.clear();
  for (Index face : mesh_.cell_faces[cell]) add_face(face);
  place_centre(cell_node_average(mesh_, cell));
}

void HfvCell::build_fracture_face(Index face) {
  cell_ = -1;
  dim_ = mesh_.dim - 1;
  faces_.clear();
  add_ridges(face);
  Vec3 average = Vec3::Zero();
  for (const Vec3& x : points_) average += x / static_cast<double>(points_.size());
  place_centre(average);
}

double HfvCell::flops() const {
  double sum = 3.0 * mesh_.cell_nodes.row_size(cell_) + 3;  // average of the nodes
  for (Index face : mesh_.cell_faces[cell_]) {
    const int m = mesh_.face_nodes.row_size(face);
    sum += geometry::vector_weights_flops(mesh_.dim, m) + geometry::face_geometry_flops(m) + 3  // sign of the normal
           + (m > 3 ? 17.0 * m : 0.0)    // warp: distances to the plane and to the centre
           + 3 + 7 + 1 + 8 + 8;          // cone: offset, measure, sum, moment; distance
  }
  return sum + 7;
}

Vec3 HfvCell::gradient(double p_K, std::span<const double> p_faces) const {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < faces_.size(); ++i) sum += faces_[i].area * (p_faces[i] - p_K) * faces_[i].normal;
  return sum / measure_;
}

void HfvCell::append_rule(std::vector<geometry::QuadraturePoint>& rule) const {
  for (Index face : mesh_.cell_faces[cell_]) {
    face_points(mesh_, face, points_);
    geometry::append_cone_rule(dim_, centre_, points_, mesh_.orientation(cell_, face), rule);
  }
}

}  // namespace polyslip::spaces
