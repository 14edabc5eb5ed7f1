// A body that holds its initial stress does not move, and its fractures bear what the stress puts on them.
#include <gtest/gtest.h>

#include "support/coupled_scene.hpp"

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

TEST_P(initial_stress, that_grows_with_height_loads_each_face_at_its_own_height) {
  physics::MechanicsProblem problem;
  problem.boundary = {hold("all", std::vector<std::string>(static_cast<std::size_t>(GetParam().dim), "0"))};
  problem.contact = {contact(physics::FrictionLaw::coulomb, 0.6)};
  problem.initial_stress.emplace();
  (*problem.initial_stress)[0] = Expression("-3 - y", {}, "test");
  ContactScene scene([] { return fractured_box(GetParam(), 4, 0.25, 0.75); }, problem);
  ASSERT_TRUE(scene.solve().converged);
  const auto values = assembly::fracture_values(*scene.system, scene.x);
  for (std::size_t f = 0; f < values.size(); ++f)
    EXPECT_NEAR(values[f].traction_normal, 3 + scene.system->contact_cells().faces()[f].centre.y(), 0.015);
}

TEST_P(initial_stress, by_a_fluid_at_rest_loads_each_face_at_its_own_height) {
  // Suction that grows with height pulls the rock together, lam_n = b p - p on the fracture, and holds its weight.
  const int dim = GetParam().dim;
  if (dim == 3 && std::string(GetParam().name) == "warped") GTEST_SKIP() << "flow wants planar faces";
  constexpr double b = 0.8;
  physics::MechanicsProblem rules;
  rules.boundary = {hold("all", std::vector<std::string>(static_cast<std::size_t>(dim), "0"))};
  rules.materials = {rock()};
  rules.contact = {contact(physics::FrictionLaw::coulomb, 0.6)};
  rules.body_force[1] = Expression(-b);
  physics::FlowProblem fluid = flow_problem(dim, false);
  fluid.materials[0].biot = Expression(b);
  fluid.fractures = {fracture("0.05")};
  fluid.initial_pressure = fluid.reference_pressure.emplace("-1 - y", Definitions{}, "test");
  mesh::PolyMesh serial;
  mpi::on_root(PETSC_COMM_WORLD, [&] { serial = fractured_box(GetParam(), 4, 0.25, 0.75); });
  mesh::PartitionOptions partition;
  partition.flow = true;
  const mesh::DistributedMesh mesh = mesh::distribute(PETSC_COMM_WORLD, std::move(serial), partition);
  assembly::FlowSystem flow(mesh, fluid);
  assembly::CoupledSystem system(mesh, rules, flow);
  POLYSLIP_PETSC(solver::register_types());
  const ScopedOption tight("-snes_rtol", "1e-12");
  solver::ContactNewton newton(system, std::make_unique<solver::CoupledSolver>(system));
  solver::CoupledStep step(system, newton, 0);
  ASSERT_TRUE(step.start_from_equilibrium(0, {}).converged);
  const auto values = assembly::fracture_values(system, step.accepted());
  for (std::size_t f = 0; f < values.size(); ++f)
    EXPECT_NEAR(values[f].traction_normal, (1 - b) * (1 + system.contact_cells().faces()[f].centre.y()), 0.012);
}

INSTANTIATE_TEST_SUITE_P(every_shape, initial_stress, testing::ValuesIn(all_shapes()), ShapeName());

}  // namespace
}  // namespace polyslip
