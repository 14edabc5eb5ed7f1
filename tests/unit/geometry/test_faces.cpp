#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <numbers>

#include "polyslip/geometry/faces.hpp"
#include "support/boxes.hpp"

namespace polyslip::geometry {
namespace {

using tests::Shape;

/// Area vector of a closed polygon, warped or not, by the shoelace formula about the origin.
Vec3 shoelace(const std::vector<Vec3>& x) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < x.size(); ++i) sum += 0.5 * x[i].cross(x[(i + 1) % x.size()]);
  return sum;
}

std::vector<Vec3> warped_pentagon() { return {{2, 0, 0.1}, {3, 0.2, -0.2}, {3.4, 1, 0.3}, {2.5, 1.7, 0}, {1.8, 0.9, 0.4}}; }

/// An L of three unit squares in an inclined plane: not convex, and its node average is not its centre of mass.
struct InclinedL {
  Vec3 origin{0.4, -0.3, 2.0}, a = Vec3(1, 2, 2) / 3, b = Vec3(2, 1, -2) / 3;
  std::vector<Vec3> points;

  InclinedL() {
    for (const auto& [s, t] : {std::pair{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}}) points.push_back(origin + s * a + t * b);
  }
  [[nodiscard]] Vec3 normal() const { return a.cross(b); }
  [[nodiscard]] Vec3 centre() const { return origin + 5.0 / 6 * (a + b); }
};

TEST(faces, vector_weights_sum_to_the_area_vector_of_a_warped_face) {
  const auto points = warped_pentagon();
  std::vector<Vec3> g(points.size());
  vector_weights(3, points, g);
  Vec3 sum = Vec3::Zero();
  for (const Vec3& v : g) sum += v;
  EXPECT_LT((sum - shoelace(points)).norm(), 1e-15);
}

TEST(faces, vector_weights_of_a_segment_halve_its_normal) {
  const std::vector<Vec3> points{{1, 1, 0}, {1, 4, 0}};
  std::vector<Vec3> g(2);
  vector_weights(2, points, g);
  for (const Vec3& v : g) EXPECT_LT((v - Vec3(1.5, 0, 0)).norm(), 1e-15);
}

TEST(faces, scalar_weights_give_the_centre_of_mass_of_a_polygon_that_is_not_convex) {
  const InclinedL l;
  std::vector<Vec3> g(6);
  std::vector<double> w(6);
  vector_weights(3, l.points, g);
  const FaceGeometry face = face_geometry(l.points, g, w);
  EXPECT_NEAR(face.area, 3, 1e-14);
  EXPECT_LT((face.normal - l.normal()).norm(), 1e-15);
  EXPECT_LT((face.centre - l.centre()).norm(), 1e-14);
  double sum = 0;
  Vec3 centre = Vec3::Zero();
  for (std::size_t s = 0; s < 6; ++s) {
    sum += w[s];
    centre += w[s] * l.points[s];
  }
  EXPECT_NEAR(sum, 1, 1e-15);
  EXPECT_LT((centre - l.centre()).norm(), 1e-14);
}

TEST(faces, scalar_weights_of_a_warped_face_sum_to_one) {
  const auto points = warped_pentagon();
  std::vector<Vec3> g(points.size());
  std::vector<double> w(points.size());
  vector_weights(3, points, g);
  face_geometry(points, g, w);
  double sum = 0;
  for (double v : w) sum += v;
  EXPECT_NEAR(sum, 1, 1e-15);
}

TEST(faces, frames_are_orthonormal_and_right_handed_in_every_direction) {
  for (int i = 0; i <= 12; ++i) {
    for (int j = 0; j < 24; ++j) {
      const double polar = i * std::numbers::pi / 12, turn = j * std::numbers::pi / 12;
      const Vec3 n(std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn), std::cos(polar));
      const Eigen::Matrix3d frame = face_frame(3, n);
      EXPECT_LT((frame * frame.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-14);
      EXPECT_NEAR(frame.determinant(), 1, 1e-14);
      EXPECT_EQ(Vec3(frame.row(0)), n);
    }
  }
}

TEST(faces, plane_frames_turn_the_normal_by_a_right_angle_and_keep_z) {
  const Vec3 n(0.6, -0.8, 0);
  const Eigen::Matrix3d frame = face_frame(2, n);
  EXPECT_EQ(Vec3(frame.row(0)), n);
  EXPECT_EQ(Vec3(frame.row(1)), Vec3(0.8, 0.6, 0));
  EXPECT_EQ(Vec3(frame.row(2)), Vec3(0, 0, 1));
  EXPECT_NEAR(frame.determinant(), 1, 1e-15);
}

class closed_cells : public testing::TestWithParam<Shape> {};

TEST_P(closed_cells, nodes_times_vector_weights_sum_to_the_volume_times_the_identity) {
  const mesh::PolyMesh mesh = mesh::make_box(tests::unit_box(GetParam(), 3));
  double total = 0;
  std::vector<Vec3> points, g;
  for (Index cell = 0; cell < mesh.n_cells(); ++cell) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (Index face : mesh.cell_faces[cell]) {
      points.clear();
      for (Index s : mesh.face_nodes[face]) points.push_back(mesh.nodes[s]);
      g.resize(points.size());
      vector_weights(mesh.dim, points, g);
      for (std::size_t s = 0; s < points.size(); ++s) sum += mesh.orientation(cell, face) * points[s] * g[s].transpose();
    }
    const double volume = sum(0, 0);
    total += volume;
    Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
    expected.topLeftCorner(mesh.dim, mesh.dim).setIdentity();
    EXPECT_LT((sum / volume - expected).norm(), 1e-12) << "cell " << cell << " of volume " << volume;
    EXPECT_LT((sum - volume * expected).norm(), 1e-13);
  }
  EXPECT_NEAR(total, 1, 1e-13);
}

INSTANTIATE_TEST_SUITE_P(every_shape, closed_cells, testing::ValuesIn(tests::all_shapes()), tests::ShapeName());

}  // namespace
}  // namespace polyslip::geometry
