#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "polyslip/common/error.hpp"
#include "polyslip/physics/darcy.hpp"
#include "support/flow_shapes.hpp"

namespace polyslip::physics {
namespace {

using spaces::HfvCell;
using tests::Shape;

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// A tensor with contrast 100 along axes that fit no mesh.
Eigen::Matrix3d rotated_anisotropic(int dim) {
  const Vec3 axis = dim == 2 ? Vec3(0, 0, 1) : Vec3(1, 2, -0.5).normalized();
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.6, axis).toRotationMatrix();
  return turn * Vec3(10, 0.1, dim == 2 ? 0.0 : 1.0).asDiagonal() * turn.transpose();
}

RowMajor transmissibilities(const HfvCell& element, const Eigen::Matrix3d& mobility) {
  RowMajor T(element.size(), element.size());
  local_transmissibilities(element, mobility, {T.data(), static_cast<std::size_t>(T.size())});
  return T;
}

/// v_sigma = p_sigma - p_K of a linear pressure.
Eigen::VectorXd differences(const HfvCell& element, const Vec3& g) {
  Eigen::VectorXd v(element.size());
  for (int i = 0; i < element.size(); ++i) v[i] = g.dot(element.faces()[i].centre - element.centre());
  return v;
}

/// The bilinear form over the cones, as the scheme writes it.
double form_by_definition(const HfvCell& element, const Eigen::Matrix3d& mobility, const Eigen::VectorXd& v) {
  Vec3 g = Vec3::Zero();
  for (int i = 0; i < element.size(); ++i) g += element.faces()[i].area / element.measure() * v[i] * element.faces()[i].normal;
  double form = 0;
  for (int i = 0; i < element.size(); ++i) {
    const auto& face = element.faces()[i];
    const double R = std::sqrt(element.dim()) / face.distance * (v[i] - g.dot(face.centre - element.centre()));
    const Vec3 grad = g + R * face.normal;
    form += face.area * face.distance / element.dim() * grad.dot(mobility * grad);
  }
  return form;
}

class darcy_cells : public testing::TestWithParam<Shape> {
 protected:
  mesh::PolyMesh mesh_ = tests::fractured_box(GetParam(), 4, 0.25, 0.75);
  HfvCell hfv_{mesh_};
  Eigen::Matrix3d mobility_ = rotated_anisotropic(mesh_.dim);

  /// All cells with the anisotropic tensor, then all fracture faces with a scalar.
  template <class Body>
  void for_each_element(Body&& body) {
    for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
      SCOPED_TRACE(cell);
      hfv_.build(cell);
      body(mobility_);
    }
    for (Index face = 0; face < mesh_.n_faces(); ++face) {
      if (!mesh_.on_fracture(face)) continue;
      SCOPED_TRACE(face);
      hfv_.build_fracture_face(face);
      body(Eigen::Matrix3d(0.03 * Eigen::Matrix3d::Identity()));
    }
  }
};

TEST_P(darcy_cells, linear_pressures_have_their_exact_fluxes) {
  const Vec3 g(0.4, -1.3, mesh_.dim == 3 ? 0.7 : 0.0);
  for_each_element([&](const Eigen::Matrix3d& mobility) {
    const Eigen::VectorXd flux = -transmissibilities(hfv_, mobility) * differences(hfv_, g);
    for (int i = 0; i < hfv_.size(); ++i) {
      const auto& face = hfv_.faces()[i];
      EXPECT_NEAR(flux[i], -face.area * face.normal.dot(mobility * g), 1e-13 * mobility.norm());
    }
  });
}

TEST_P(darcy_cells, transmissibilities_are_symmetric_and_positive_definite) {
  for_each_element([&](const Eigen::Matrix3d& mobility) {
    const RowMajor T = transmissibilities(hfv_, mobility);
    EXPECT_EQ(T, T.transpose());
    const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(T).eigenvalues();
    EXPECT_GT(values[0], 1e-6 * values.maxCoeff());
  });
}

TEST_P(darcy_cells, transmissibilities_have_the_form_of_the_scheme) {
  for_each_element([&](const Eigen::Matrix3d& mobility) {
    Eigen::VectorXd v(hfv_.size());
    for (int i = 0; i < v.size(); ++i) v[i] = std::sin(3.0 * i + 1);
    const double form = form_by_definition(hfv_, mobility, v);
    EXPECT_NEAR(v.dot(transmissibilities(hfv_, mobility) * v), form, 1e-12 * form);
  });
}

TEST_P(darcy_cells, element_matrix_gives_the_fluxes_and_their_sum) {
  hfv_.build(0);
  const RowMajor T = transmissibilities(hfv_, mobility_);
  const int n = hfv_.size();
  RowMajor A(n + 1, n + 1);
  element_matrix({T.data(), static_cast<std::size_t>(T.size())}, n, {A.data(), static_cast<std::size_t>(A.size())});
  Eigen::VectorXd p(n + 1);
  for (int i = 0; i <= n; ++i) p[i] = std::cos(2.0 * i);
  const Eigen::VectorXd flux = T * (Eigen::VectorXd::Constant(n, p[0]) - p.tail(n)), rows = A * p;
  EXPECT_NEAR(rows[0], flux.sum(), 1e-12 * T.norm());
  EXPECT_LT((rows.tail(n) + flux).norm(), 1e-12 * T.norm());
  EXPECT_LT((A - A.transpose()).norm(), 1e-15 * A.norm());
}

INSTANTIATE_TEST_SUITE_P(every_planar_shape, darcy_cells, testing::ValuesIn(tests::planar_shapes()), tests::ShapeName());

mesh::PolyMesh plain_box(int dim) {
  mesh::PolyMesh mesh = mesh::make_box(tests::unit_box(dim == 2 ? Shape{2, "quads"} : Shape{3, "hexahedra"}, 2));
  mesh::build_copies(mesh);
  return mesh;
}

HydraulicRule rock(std::array<double, 6> K) {
  HydraulicRule rule;
  rule.permeability.emplace();
  for (std::size_t i = 0; i < 6; ++i) (*rule.permeability)[i] = Expression(K[i]);
  rule.place = "scene.yaml:9 (materials[0])";
  return rule;
}

TEST_P(darcy_cells, lose_the_flux_through_a_sealed_face_and_keep_the_others_at_the_pressure_that_settles_there) {
  for_each_element([&](const Eigen::Matrix3d& mobility) {
    const RowMajor T = transmissibilities(hfv_, mobility);
    RowMajor sealed = T;
    const Eigen::Index n = T.rows(), i = n - 1;
    seal_face({sealed.data(), static_cast<std::size_t>(n * n)}, static_cast<std::size_t>(n), static_cast<std::size_t>(i));
    Eigen::VectorXd v = differences(hfv_, {0.4, -1.3, 0.7});
    v[i] -= T.row(i).dot(v) / T(i, i);  // now F_i = 0
    EXPECT_LT((sealed * v - T * v).norm(), 1e-12 * T.norm() * v.norm());
    EXPECT_EQ(sealed.row(i).norm() + sealed.col(i).norm(), 0);
    EXPECT_LT((sealed - sealed.transpose()).norm(), 1e-14 * T.norm());
  });
}

TEST(cell_hydraulics, place_the_components_of_the_tensor) {
  Eigen::Matrix3d K;
  K << 7, 1, 3, 1, 8, 2, 3, 2, 9;
  EXPECT_EQ(cell_hydraulics(plain_box(3), {rock({7, 8, 9, 1, 2, 3})})[0].permeability, K);
  K.row(2).setZero();
  K.col(2).setZero();
  EXPECT_EQ(cell_hydraulics(plain_box(2), {rock({7, 8, -9, 1, 20, 30})})[0].permeability, K);
}

TEST(cell_hydraulics, are_won_by_later_rules_property_by_property) {
  HydraulicRule first = rock({1, 1, 1, 0, 0, 0}), half;
  first.inverse_modulus = Expression(0.25);
  half.where = Expression("x > 0.5", {}, "test");
  half.biot = Expression(0.75);
  const mesh::PolyMesh mesh = plain_box(2);
  const auto cells = cell_hydraulics(mesh, {first, half});
  for (Index c = 0; c < mesh.n_cells(); ++c) {
    EXPECT_EQ(cells[c].biot, mesh::cell_node_average(mesh, c).x() > 0.5 ? 0.75 : 1);
    EXPECT_EQ(cells[c].inverse_modulus, 0.25);
    EXPECT_EQ(cells[c].permeability(0, 0), 1);
  }
}

std::string refusal(int dim, const std::vector<HydraulicRule>& rules) {
  try {
    cell_hydraulics(plain_box(dim), rules);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(cell_hydraulics, name_place_point_and_remedy_where_they_are_not_admissible) {
  const std::string text = refusal(3, {rock({1, 1, 1, 2, 0, 0})});
  EXPECT_NE(text.find("scene.yaml:9 (materials[0])"), std::string::npos) << text;
  EXPECT_NE(text.find("xy 2"), std::string::npos) << text;
  EXPECT_NE(text.find("0.25"), std::string::npos) << text;
  EXPECT_NE(refusal(2, {rock({1, 0, 1, 0, 0, 0})}), "");
  EXPECT_EQ(refusal(2, {rock({1e-20, 1e-20, 0, 0.9e-20, 0, 0})}), "");
  HydraulicRule biot = rock({1, 1, 1, 0, 0, 0}), modulus = biot;
  biot.biot = Expression(1.1);
  modulus.inverse_modulus = Expression(-1e-10);
  EXPECT_NE(refusal(2, {biot}).find("0 <= b <= 1"), std::string::npos);
  EXPECT_NE(refusal(2, {modulus}).find("1/M >= 0"), std::string::npos);
  HydraulicRule half = rock({1, 1, 1, 0, 0, 0});
  half.where = Expression("x > 0.5", {}, "test");
  EXPECT_NE(refusal(2, {half}).find("region 'rock'"), std::string::npos);
}

}  // namespace
}  // namespace polyslip::physics
