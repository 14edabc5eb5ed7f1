// Problems whose solution is linear on each side of the fracture: the scheme must give it to round-off on every kind of cell.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "support/contact_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;
using physics::ContactState;
using physics::FrictionLaw;

/// Displacement linear on each side of x = 1/2.
struct TwoSides {
  Vec3 left = Vec3::Zero(), right = Vec3::Zero();  ///< u(0) on either side
  Eigen::Matrix3d left_gradient = Eigen::Matrix3d::Zero(), right_gradient = Eigen::Matrix3d::Zero();

  [[nodiscard]] Vec3 operator()(const Vec3& x, bool is_right) const {
    return is_right ? Vec3(right + right_gradient * x) : Vec3(left + left_gradient * x);
  }
  [[nodiscard]] Vec3 jump(const Vec3& x) const { return (*this)(x, false) - (*this)(x, true); }  // the + side lies at x < 1/2
  [[nodiscard]] std::vector<std::string> text(int dim) const {
    const auto l = as_text(dim, left, left_gradient), r = as_text(dim, right, right_gradient);
    std::vector<std::string> text;
    for (int a = 0; a < dim; ++a) text.push_back("x < 0.5 ? " + l[a] + " : " + r[a]);
    return text;
  }
};

/// Checks nodes, bubbles, jumps and multipliers (Cartesian, the same on all faces) against the exact ones, and the state of all
/// faces.
void expect_solution(const ContactScene& scene, const TwoSides& u, const Vec3& multiplier, ContactState state) {
  const int dim = scene.mesh.mesh.dim;
  const Parts parts(scene.system->layout(), scene.x);
  std::vector<double> exact, error, jump_error, lam_error;
  for (Index copy = 0; copy < scene.mesh.copies.owned; ++copy) {
    const Vec3 v = u(scene.node_of(copy), scene.is_right(copy));
    for (int a = 0; a < dim; ++a) {
      exact.push_back(v[a]);
      error.push_back(parts.nodal[static_cast<std::size_t>(dim) * copy + a] - v[a]);
    }
  }
  const auto values = assembly::fracture_values(*scene.system, scene.x);
  for (Index f = 0; f < scene.mesh.fractures.owned; ++f) {
    const auto& face = scene.system->contact_cells().faces()[f];
    const Vec3 n = face.frame.row(0).transpose();
    jump_error.push_back((values[f].jump_normal * n + values[f].jump_tangential - u.jump(face.centre)).norm());
    lam_error.push_back((values[f].traction_normal * n + values[f].traction_tangential - multiplier).norm());
  }
  const double size = largest(exact);
  EXPECT_LT(largest(error), 1e-12 * size);
  EXPECT_LT(largest(parts.bubble), 1e-12 * size);
  EXPECT_LT(largest(parts.normal_bubble), 1e-12 * size);
  EXPECT_LT(largest(jump_error), 1e-12 * size);
  // Where faces slip, Krylov's tolerance shows.
  EXPECT_LT(largest(lam_error),
            (state == ContactState::slip ? 1e-10 : 1e-11) * std::max(multiplier.norm(), (2 * mu + lambda) * size));
  auto counts = scene.counts();
  EXPECT_EQ(counts[static_cast<std::size_t>(state)], scene.system->fracture_faces());
  EXPECT_GT(scene.system->fracture_faces(), 0);
}

/// Strain with a given normal traction -pressing and shear traction on x = 1/2, as a gradient that is not symmetric.
Eigen::Matrix3d strained(int dim, double pressing, const Vec3& shear) {
  Eigen::Matrix3d g = Eigen::Matrix3d::Zero();
  g(1, 1) = -0.01;
  if (dim == 3) g(2, 2) = 0.004;
  g(0, 0) = (-pressing - lambda * (g(1, 1) + g(2, 2))) / (2 * mu + lambda);
  g(0, 1) = 0.3 * shear[1] / mu;
  g(1, 0) = 0.7 * shear[1] / mu;
  if (dim == 3) {
    g(2, 0) = shear[2] / mu;
    g(1, 2) = 0.01;
    g(2, 1) = -0.02;
  }
  return g;
}

class patches : public testing::TestWithParam<std::tuple<Shape, spaces::Bubbles>> {
 protected:
  Shape shape_ = std::get<0>(GetParam());
  int dim_ = shape_.dim;

  [[nodiscard]] auto boxed(double low, double high) const {
    return [=, this] { return fractured_box(shape_, 4, low, high); };
  }
  [[nodiscard]] physics::MechanicsProblem held_all_round(const TwoSides& u, const physics::ContactRule& rule) const {
    physics::MechanicsProblem problem;
    problem.boundary = {hold("all", u.text(dim_))};
    problem.contact = {rule};
    problem.bubbles = std::get<1>(GetParam());
    return problem;
  }
  /// Solves with u on the whole boundary; `shear` and `pressing` are the traction of u on x = 1/2.
  void expect_exact(const TwoSides& u, const physics::ContactRule& rule, double low, double high, const Vec3& multiplier,
                    ContactState state) {
    ContactScene scene(boxed(low, high), held_all_round(u, rule));
    const auto result = scene.solve();
    ASSERT_TRUE(result.converged) << result.message;
    expect_solution(scene, u, multiplier, state);
  }
};

TEST_P(patches, stuck_fracture_inside_does_not_disturb_uniform_stress) {
  const Vec3 shear(0, 0.02, dim_ == 3 ? -0.01 : 0.0);
  TwoSides u;
  u.left = u.right = {0.01, -0.02, dim_ == 3 ? 0.03 : 0.0};
  u.left_gradient = u.right_gradient = strained(dim_, 0.05, shear);
  expect_exact(u, contact(FrictionLaw::coulomb, 0.6), 0.25, 0.75, Vec3(0.05, 0, 0) - shear, ContactState::stick);
}

TEST_P(patches, stuck_fracture_does_not_disturb_uniform_stress_with_the_larger_stabilisation) {
  TwoSides u;
  u.left_gradient = u.right_gradient = strained(dim_, 0.05, {0, 0.02, 0});
  auto problem = held_all_round(u, contact(FrictionLaw::tresca, 0.03));
  problem.stabilisation = physics::Stabilisation::two_mu_lambda;
  ContactScene scene(boxed(0.25, 0.75), problem);
  ASSERT_TRUE(scene.solve().converged);
  expect_solution(scene, u, {0.05, -0.02, 0}, ContactState::stick);
}

/// Two blocks under shear whose right one has moved by `slip` along it.
TwoSides sheared_blocks(int dim, double pressing, const Vec3& shear, const Vec3& slip) {
  TwoSides u;
  u.right = slip;
  u.left_gradient = u.right_gradient = strained(dim, pressing, shear);
  return u;
}

TEST_P(patches, blocks_slip_uniformly_under_tresca_friction) {
  const Vec3 shear(0, 0.03, dim_ == 3 ? 0.04 : 0.0);
  const auto u = sheared_blocks(dim_, 0.2, shear, 0.5 * shear);
  expect_exact(u, contact(FrictionLaw::tresca, shear.norm()), 0, 1, Vec3(0.2, 0, 0) - shear, ContactState::slip);
}

TEST_P(patches, blocks_slip_uniformly_under_coulomb_friction) {
  const Vec3 shear(0, -0.03, dim_ == 3 ? 0.04 : 0.0);
  const auto u = sheared_blocks(dim_, 0.2, shear, 0.5 * shear);
  expect_exact(u, contact(FrictionLaw::coulomb, shear.norm() / 0.2), 0, 1, Vec3(0.2, 0, 0) - shear, ContactState::slip);
}

TEST_P(patches, blocks_slip_any_way_without_friction) {
  const auto u = sheared_blocks(dim_, 0.2, Vec3::Zero(), {0, 0.07, dim_ == 3 ? -0.02 : 0.0});
  expect_exact(u, contact(FrictionLaw::frictionless, 0), 0, 1, {0.2, 0, 0}, ContactState::slip);
}

TEST_P(patches, blocks_that_are_pulled_apart_carry_nothing) {
  // Each side stretched along y by its own amount, free of traction on x = 1/2.
  TwoSides u;
  u.right = {0.02, 0.01, 0};
  for (auto [gradient, stretch] : {std::pair{&u.left_gradient, 0.01}, {&u.right_gradient, -0.02}}) {
    (*gradient)(1, 1) = stretch;
    (*gradient)(0, 0) = -lambda / (2 * mu + lambda) * stretch;
  }
  expect_exact(u, contact(FrictionLaw::coulomb, 0.6), 0, 1, Vec3::Zero(), ContactState::open);
}

/// A bar of two blocks in uniaxial strain: left end held, right end moved by `end`, sides on rollers.
physics::MechanicsProblem bar(int dim, double end, double pressure, spaces::Bubbles bubbles) {
  physics::MechanicsProblem problem;
  problem.bubbles = bubbles;
  problem.boundary = {hold("left", {"0"}), hold("right", {fmt::format("{:.17g}", end)})};
  const std::vector<std::string> along_y{"", "0"}, along_z{"", "", "0"};
  for (const char* side : {dim == 2 ? "bottom" : "front", dim == 2 ? "top" : "back"})
    problem.boundary.push_back(hold(side, along_y));
  if (dim == 3)
    for (const char* side : {"bottom", "top"}) problem.boundary.push_back(hold(side, along_z));
  problem.contact = {contact(FrictionLaw::coulomb, 0.6, pressure)};
  return problem;
}

TEST_P(patches, pressure_above_the_load_opens_the_fracture_by_the_strain_of_the_blocks) {
  constexpr double modulus = 2 * mu + lambda, pressure = 0.05, end = -0.4 * pressure / modulus;
  ContactScene scene(boxed(0, 1), bar(dim_, end, pressure, std::get<1>(GetParam())));
  const auto result = scene.solve();
  ASSERT_TRUE(result.converged) << result.message;
  TwoSides u;  // both blocks at stress -pressure
  u.left_gradient(0, 0) = u.right_gradient(0, 0) = -pressure / modulus;
  u.right[0] = end + pressure / modulus;
  expect_solution(scene, u, Vec3::Zero(), ContactState::open);
  EXPECT_NEAR(u.jump({0.5, 0, 0})[0], -0.6 * pressure / modulus, 1e-15);
}

TEST_P(patches, pressure_below_the_load_takes_its_part_of_the_contact_force) {
  constexpr double modulus = 2 * mu + lambda, load = 0.05, pressure = 0.4 * load;
  ContactScene scene(boxed(0, 1), bar(dim_, -load / modulus, pressure, std::get<1>(GetParam())));
  const auto result = scene.solve();
  ASSERT_TRUE(result.converged) << result.message;
  TwoSides u;
  u.left_gradient(0, 0) = u.right_gradient(0, 0) = -load / modulus;
  expect_solution(scene, u, {load - pressure, 0, 0}, ContactState::stick);
}

INSTANTIATE_TEST_SUITE_P(every_shape, patches,
                         testing::Combine(testing::ValuesIn(all_shapes()), testing::Values(spaces::Bubbles::fracture, spaces::Bubbles::all)),
                         ShapeAndBubblesName());

}  // namespace
}  // namespace polyslip
