#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>

#include "polyslip/geometry/quadrature.hpp"
#include "support/boxes.hpp"

namespace polyslip::geometry {
namespace {

using tests::Shape;
using Rule = std::vector<QuadraturePoint>;

constexpr std::array<std::array<int, 3>, 10> monomials{
    {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {2, 0, 0}, {0, 2, 0}, {0, 0, 2}, {1, 1, 0}, {0, 1, 1}, {1, 0, 1}}};

double integrate(const Rule& rule, const std::array<int, 3>& powers) {
  double sum = 0;
  for (const auto& q : rule)
    sum += q.weight * std::pow(q.x[0], powers[0]) * std::pow(q.x[1], powers[1]) * std::pow(q.x[2], powers[2]);
  return sum;
}

/// Integral of a monomial over the box [a, b].
double over_box(int dim, const Vec3& a, const Vec3& b, const std::array<int, 3>& powers) {
  double product = 1;
  for (int i = 0; i < 3; ++i) {
    if (i >= dim) {
      product *= powers[i] == 0 ? 1 : 0;  // the box lies at 0 there
      continue;
    }
    const int p = powers[i] + 1;
    product *= (std::pow(b[i], p) - std::pow(a[i], p)) / p;
  }
  return product;
}

Rule cell_rule(const mesh::PolyMesh& mesh, Index cell, const Vec3& apex) {
  Rule rule;
  std::vector<Vec3> points;
  for (Index face : mesh.cell_faces[cell]) {
    points.clear();
    for (Index s : mesh.face_nodes[face]) points.push_back(mesh.nodes[s]);
    append_cone_rule(mesh.dim, apex, points, mesh.orientation(cell, face), rule);
  }
  return rule;
}

class cell_rules : public testing::TestWithParam<Shape> {};

TEST_P(cell_rules, are_exact_for_degree_2_over_the_whole_box) {
  const mesh::PolyMesh mesh = mesh::make_box(tests::unit_box(GetParam(), 3));
  Rule all;
  for (Index cell = 0; cell < mesh.n_cells(); ++cell) {
    const Rule rule = cell_rule(mesh, cell, mesh.nodes[mesh.face_nodes[mesh.cell_faces[cell][0]][0]]);
    all.insert(all.end(), rule.begin(), rule.end());
  }
  for (const auto& m : monomials)
    EXPECT_NEAR(integrate(all, m), over_box(mesh.dim, Vec3::Zero(), Vec3::Ones(), m), 1e-13) << m[0] << m[1] << m[2];
}

TEST_P(cell_rules, do_not_depend_on_the_apex_for_degree_2) {
  // Only signed, exact rules let the parts outside the cell cancel.
  const mesh::PolyMesh mesh = mesh::make_box(tests::unit_box(GetParam(), 3));
  const Vec3 outside(1.5, -0.5, mesh.dim == 3 ? 2.0 : 0.0);
  for (Index cell = 0; cell < mesh.n_cells(); ++cell) {
    const Rule inner = cell_rule(mesh, cell, mesh.nodes[mesh.face_nodes[mesh.cell_faces[cell][0]][0]]);
    const Rule outer = cell_rule(mesh, cell, outside);
    for (const auto& m : monomials) EXPECT_NEAR(integrate(inner, m), integrate(outer, m), 1e-13) << cell;
  }
}

INSTANTIATE_TEST_SUITE_P(every_shape, cell_rules, testing::ValuesIn(tests::all_shapes()), tests::ShapeName());

/// Integral over the L  [0,2] x [0,1]  and  [0,1] x [1,2]  (times [0,1] along z in 3D).
double over_l(int dim, const std::array<int, 3>& m) {
  return over_box(dim, {0, 0, 0}, {2, 1, 1}, m) + over_box(dim, {0, 1, 0}, {1, 2, 1}, m);
}

const std::array<Vec3, 6> l_corners{Vec3(0, 0, 0), Vec3(2, 0, 0), Vec3(2, 1, 0), Vec3(1, 1, 0), Vec3(1, 2, 0), Vec3(0, 2, 0)};

TEST(rules_of_cells_that_are_not_convex, are_exact_for_degree_2_on_an_l_about_an_apex_outside) {
  Rule rule;
  for (std::size_t i = 0; i < 6; ++i) append_cone_rule(2, {1.8, 1.9, 0}, std::array{l_corners[i], l_corners[(i + 1) % 6]}, 1, rule);
  for (const auto& m : monomials) EXPECT_NEAR(integrate(rule, m), over_l(2, m), 1e-14);
}

TEST(rules_of_cells_that_are_not_convex, are_exact_for_degree_2_on_an_l_shaped_prism) {
  const Vec3 up(0, 0, 1), apex(1.5, 1.5, 0.3);
  Rule rule;
  std::vector<Vec3> floor(l_corners.rbegin(), l_corners.rend()), roof;
  for (const Vec3& x : l_corners) roof.push_back(x + up);
  append_cone_rule(3, apex, floor, 1, rule);
  append_cone_rule(3, apex, roof, 1, rule);
  for (std::size_t i = 0; i < 6; ++i) {
    const Vec3 &a = l_corners[i], &b = l_corners[(i + 1) % 6];
    // Every second wall is given inside out, with the sign that says so.
    if (i % 2 == 0)
      append_cone_rule(3, apex, std::array<Vec3, 4>{a, b, b + up, a + up}, 1, rule);
    else
      append_cone_rule(3, apex, std::array<Vec3, 4>{a + up, b + up, b, a}, -1, rule);
  }
  for (const auto& m : monomials) EXPECT_NEAR(integrate(rule, m), over_l(3, m), 1e-14);
}

TEST(face_rules, are_exact_for_degree_2_on_a_polygon_that_is_not_convex) {
  // Arms so long that the average of the nodes lies outside.
  const std::array<Vec3, 6> corners{Vec3(0, 0, 0), Vec3(4, 0, 0), Vec3(4, 1, 0), Vec3(1, 1, 0), Vec3(1, 4, 0), Vec3(0, 4, 0)};
  Rule rule;
  append_face_rule(3, corners, Vec3::UnitZ(), rule);
  for (const auto& m : monomials) {
    const double exact = over_box(2, {0, 0, 0}, {4, 1, 0}, m) + over_box(2, {0, 1, 0}, {1, 4, 0}, m);
    EXPECT_NEAR(integrate(rule, m), exact, 1e-13) << m[0] << m[1] << m[2];
  }
}

TEST(face_rules, are_exact_for_degree_3_on_a_segment) {
  Rule rule;
  append_face_rule(2, std::array{Vec3(1, 2, 0), Vec3(1, 5, 0)}, Vec3::UnitX(), rule);
  for (int p = 0; p <= 3; ++p) EXPECT_NEAR(integrate(rule, {1, p, 0}), (std::pow(5, p + 1) - std::pow(2, p + 1)) / (p + 1), 1e-12);
}

}  // namespace
}  // namespace polyslip::geometry
