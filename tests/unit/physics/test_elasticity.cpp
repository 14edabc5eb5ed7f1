#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "polyslip/common/error.hpp"
#include "polyslip/physics/elasticity.hpp"
#include "support/boxes.hpp"

namespace polyslip::physics {
namespace {

using spaces::VemCell;
using tests::AffineField;
using tests::Shape;

constexpr Lame rock{1.3, 2.1};

Eigen::MatrixXd stiffness(const mesh::PolyMesh& mesh, const VemCell& vem, double gamma, const Lame& lame = rock, Blocks blocks = Blocks::all,
                          double untouched = 0) {
  const int n = vem.components();
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> matrix(n, n);
  matrix.setConstant(untouched);
  local_stiffness(mesh.dim, vem, lame, gamma, {matrix.data(), static_cast<std::size_t>(n) * n}, blocks);
  return matrix;
}

/// Nodal values of a field with zero bubbles.
template <class Field>
Eigen::VectorXd interpolate(const mesh::PolyMesh& mesh, const VemCell& vem, const Field& field) {
  Eigen::VectorXd v = Eigen::VectorXd::Zero(vem.components());
  for (int s = 0; s < vem.n_nodes(); ++s)
    v.segment(mesh.dim * s, mesh.dim) = field(mesh.nodes[mesh.cell_nodes[vem.cell()][s]]).head(mesh.dim);
  return v;
}

/// sum_K sigma:eps and stabilisation term by term from G_K and Pi_K, as the scheme writes them.
double energy_by_definition(const mesh::PolyMesh& mesh, const VemCell& vem, double gamma, const Eigen::VectorXd& v) {
  Eigen::VectorXd vectors(mesh.dim * vem.size());  // bubbles along normals too
  for (int j = 0; j < vem.size(); ++j)
    vectors.segment(mesh.dim * j, mesh.dim) = vem.is_normal(j)
                                                  ? Eigen::VectorXd(v[vem.first_component(j)] * vem.normal(j).head(mesh.dim))
                                                  : Eigen::VectorXd(v.segment(vem.first_component(j), mesh.dim));
  const std::span<const double> values(vectors.data(), static_cast<std::size_t>(vectors.size()));
  const Eigen::Matrix3d g = vem.gradient(values), eps = 0.5 * (g + g.transpose());
  const Eigen::Matrix3d sigma = 2 * rock.mu * eps + rock.lambda * eps.trace() * Eigen::Matrix3d::Identity();
  double s = 0;
  for (int j = 0; j < vem.size(); ++j) {
    Vec3 value = Vec3::Zero();
    value.head(mesh.dim) = vectors.segment(mesh.dim * j, mesh.dim);
    if (j < vem.n_nodes()) value -= vem.value(g, values, mesh.nodes[mesh.cell_nodes[vem.cell()][j]]);
    s += value.squaredNorm();
  }
  return vem.volume() * sigma.cwiseProduct(eps).sum() + gamma * std::pow(vem.diameter(), mesh.dim - 2) * s;
}

class cell_stiffness : public testing::TestWithParam<std::tuple<Shape, spaces::Bubbles>> {
 protected:
  mesh::PolyMesh mesh_ = tests::fractured_box(std::get<0>(GetParam()), 4, 0.25, 0.75);
  VemCell vem_{mesh_, std::get<1>(GetParam())};

  template <class Body>
  void for_each_cell(Body&& body) {
    for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
      vem_.build(cell);
      SCOPED_TRACE(cell);
      body();
    }
  }
};

TEST_P(cell_stiffness, stabilisation_kills_linear_fields) {
  const AffineField field(mesh_.dim);
  for_each_cell([&] {
    const Eigen::MatrixXd with = stiffness(mesh_, vem_, 2), without = stiffness(mesh_, vem_, 0);
    EXPECT_LT(((with - without) * interpolate(mesh_, vem_, field)).norm(), 1e-13 * with.norm());
  });
}

TEST_P(cell_stiffness, is_symmetric) {
  for_each_cell([&] {
    const Eigen::MatrixXd a = stiffness(mesh_, vem_, 2.6);
    EXPECT_LT((a - a.transpose()).norm(), 1e-14 * a.norm());
  });
}

TEST_P(cell_stiffness, has_the_same_lower_blocks_alone) {
  for_each_cell([&] {
    const Eigen::MatrixXd all = stiffness(mesh_, vem_, 2.6), lower = stiffness(mesh_, vem_, 2.6, rock, Blocks::lower, 1e9);
    for (int j = 0; j < vem_.size(); ++j)
      for (int row = vem_.first_component(j); row < vem_.first_component(j + 1); ++row)
        for (int col = 0; col < vem_.components(); ++col)
          EXPECT_EQ(lower(row, col), col < vem_.first_component(j + 1) ? all(row, col) : 1e9) << row << " " << col;
    const double share = stiffness_flops(mesh_.dim, vem_, Blocks::lower) / stiffness_flops(mesh_.dim, vem_);
    EXPECT_GT(share, 0.5);
    EXPECT_LT(share, 0.8);
  });
}

TEST_P(cell_stiffness, has_the_energy_of_the_scheme) {
  for_each_cell([&] {
    Eigen::VectorXd v(vem_.components());
    for (int i = 0; i < v.size(); ++i) v[i] = std::sin(3.0 * i + 1);
    const double energy = energy_by_definition(mesh_, vem_, 2.6, v);
    EXPECT_NEAR(v.dot(stiffness(mesh_, vem_, 2.6) * v), energy, 1e-12 * energy);
  });
}

TEST_P(cell_stiffness, vanishes_on_rigid_motions_only) {
  const Eigen::Index rigid = mesh_.dim == 2 ? 3 : 6;
  Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
  turn(0, 1) = 0.4;
  if (mesh_.dim == 3) turn(1, 2) = -0.9;
  turn -= Eigen::Matrix3d(turn.transpose());
  const auto motion = [&](const Vec3& x) { return Vec3(Vec3(1, 2, 3) + turn * x); };
  for_each_cell([&] {
    const Eigen::MatrixXd a = stiffness(mesh_, vem_, 2.6);
    EXPECT_LT((a * interpolate(mesh_, vem_, motion)).norm(), 1e-12 * a.norm());
    const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a).eigenvalues();
    EXPECT_LT(std::abs(values[0]), 1e-13 * values.maxCoeff());
    EXPECT_LT(std::abs(values[rigid - 1]), 1e-13 * values.maxCoeff());
    EXPECT_GT(values[rigid], 1e-7 * values.maxCoeff());
  });
}

INSTANTIATE_TEST_SUITE_P(every_shape, cell_stiffness,
                         testing::Combine(testing::ValuesIn(tests::all_shapes()), testing::Values(spaces::Bubbles::fracture, spaces::Bubbles::all)),
                         tests::ShapeAndBubblesName());

TEST(stress, is_that_of_hooke_with_the_axial_stress_of_plane_strain) {
  Eigen::Matrix3d g = Eigen::Matrix3d::Zero();
  g(0, 0) = 0.1;
  g(1, 1) = 0.2;
  g(0, 1) = 0.3;
  Eigen::Matrix3d expected;
  expected << 2 * 1.3 * 0.1 + 2.1 * 0.3, 1.3 * 0.3, 0, 1.3 * 0.3, 2 * 1.3 * 0.2 + 2.1 * 0.3, 0, 0, 0, 2.1 * 0.3;
  EXPECT_LT((stress(rock, g) - expected).norm(), 1e-15);
}

TEST(stabilisation_factor, is_mu_or_2mu_or_2mu_plus_lambda) {
  EXPECT_DOUBLE_EQ(stabilisation_factor(rock, Stabilisation::mu), 1.3);
  EXPECT_DOUBLE_EQ(stabilisation_factor(rock, Stabilisation::two_mu), 2.6);
  EXPECT_DOUBLE_EQ(stabilisation_factor(rock, Stabilisation::two_mu_lambda), 4.7);
}

ElasticRule rule(ElasticRule::Pair pair, double first, double second) {
  ElasticRule r;
  r.pair = pair;
  r.first = Expression(first);
  r.second = Expression(second);
  r.place = "scene.yaml:7 (materials[0])";
  return r;
}

mesh::PolyMesh plain_box() {
  mesh::PolyMesh mesh = mesh::make_box(tests::unit_box({2, "quads"}, 2));
  mesh::build_copies(mesh);
  return mesh;
}

TEST(cell_moduli, turn_young_and_poisson_into_lame) {
  const auto moduli = cell_moduli(plain_box(), {rule(ElasticRule::Pair::young_poisson, 10, 0.25)});
  for (const Lame& lame : moduli) {
    EXPECT_DOUBLE_EQ(lame.mu, 4);
    EXPECT_DOUBLE_EQ(lame.lambda, 4);
  }
}

TEST(cell_moduli, follow_the_last_rule_that_applies) {
  ElasticRule half = rule(ElasticRule::Pair::lame, 7, 1);
  half.where = Expression("x > 0.5", {}, "test");
  const mesh::PolyMesh mesh = plain_box();
  const auto moduli = cell_moduli(mesh, {rule(ElasticRule::Pair::lame, 3, 1), half});
  for (Index cell = 0; cell < mesh.n_cells(); ++cell) {
    VemCell vem(mesh);
    vem.build(cell);
    EXPECT_EQ(moduli[cell].mu, vem.xbar().x() > 0.5 ? 7 : 3);
  }
}

std::string refusal(const std::vector<ElasticRule>& rules) {
  try {
    cell_moduli(plain_box(), rules);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(cell_moduli, name_place_and_remedy_where_they_are_not_those_of_a_solid) {
  const std::string text = refusal({rule(ElasticRule::Pair::young_poisson, 10, 0.5)});
  EXPECT_NE(text.find("scene.yaml:7 (materials[0])"), std::string::npos) << text;
  EXPECT_NE(text.find("nu < 0.5"), std::string::npos) << text;
  EXPECT_NE(refusal({rule(ElasticRule::Pair::lame, 1, -0.7)}), "");
  EXPECT_EQ(refusal({rule(ElasticRule::Pair::lame, 1, -0.6)}), "");
}

TEST(cell_moduli, name_region_and_point_that_no_rule_covers) {
  ElasticRule half = rule(ElasticRule::Pair::lame, 7, 1);
  half.where = Expression("x > 0.5", {}, "test");
  const std::string text = refusal({half});
  EXPECT_NE(text.find("rock"), std::string::npos) << text;
  EXPECT_NE(text.find("0.25"), std::string::npos) << text;
}

}  // namespace
}  // namespace polyslip::physics
