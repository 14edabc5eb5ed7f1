// A body that holds its initial stress does not move, and its fractures bear what the stress puts on them.
#include <gtest/gtest.h>

#include "support/contact_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;

class initial_stress : public testing::TestWithParam<Shape> {};

TEST_P(initial_stress, in_a_held_body_loads_the_fractures_and_moves_nothing) {
  const int dim = GetParam().dim;
  physics::MechanicsProblem problem;
  problem.boundary = {hold("all", dim == 2 ? std::vector<std::string>{"0", "0"} : std::vector<std::string>{"0", "0", "0"})};
  problem.contact = {contact(physics::FrictionLaw::coulomb, 0.6)};
  Eigen::Matrix3d stress = Vec3(-3, -2, -1).asDiagonal();
  stress(0, 1) = stress(1, 0) = 0.4;
  if (dim == 3) stress(0, 2) = stress(2, 0) = -0.3;
  problem.initial_stress.emplace();
  const std::array<double, 6> entries{stress(0, 0), stress(1, 1), stress(2, 2), stress(0, 1), stress(1, 2), stress(0, 2)};
  for (std::size_t k = 0; k < 6; ++k) (*problem.initial_stress)[k] = Expression(entries[k]);
  ContactScene scene([] { return fractured_box(GetParam(), 4, 0.25, 0.75); }, problem);
  ASSERT_TRUE(scene.solve().converged);
  EXPECT_LT(largest(assembly::copy_displacements(*scene.system, scene.x)), 1e-13);
  for (const auto& face : assembly::fracture_values(*scene.system, scene.x)) EXPECT_LT(std::abs(face.jump_normal), 1e-13);
  const auto values = assembly::fracture_values(*scene.system, scene.x);
  for (std::size_t f = 0; f < values.size(); ++f) {
    const Eigen::Matrix3d& frame = scene.system->contact_cells().faces()[f].frame;
    const Eigen::Matrix3d local = frame * stress * frame.transpose();  // lam = - sigma n^+
    EXPECT_NEAR(values[f].traction_normal, -local(0, 0), 1e-11);
    const Eigen::Vector3d error = frame * values[f].traction_tangential + Eigen::Vector3d(0, local(1, 0), local(2, 0));
    EXPECT_LT(error.norm(), 1e-11);
  }
  const auto stresses = assembly::cell_stresses(*scene.system, scene.x);
  for (std::size_t k = 0; k < stresses.size(); ++k) EXPECT_NEAR(stresses[k], entries[k % 6], 1e-11);
}

INSTANTIATE_TEST_SUITE_P(every_shape, initial_stress, testing::ValuesIn(all_shapes()), ShapeName());

}  // namespace
}  // namespace polyslip
