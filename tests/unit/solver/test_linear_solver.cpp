// The solver of the condensed displacements across states of contact.
#include <gtest/gtest.h>

#include "polyslip/la/vec_access.hpp"
#include "polyslip/solver/linear_solver.hpp"
#include "support/contact_scene.hpp"
#include "support/flow_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;

physics::MechanicsProblem pushed_and_sheared(spaces::Bubbles bubbles) {
  physics::MechanicsProblem problem;
  problem.bubbles = bubbles;
  problem.boundary = {hold("bottom", {"0", "0", "0"}), hold("top", {"0.02", "-0.01", "-0.01"})};
  problem.contact = {contact(physics::FrictionLaw::coulomb, 2)};
  return problem;
}

/// Normal tractions of 1, and of -1 on one in `every` faces.
la::Handle<Vec> pressed(const assembly::MechanicsSystem& system, Index every) {
  la::Handle<Vec> x = system.create_vector();
  const la::VecWrite a(x);
  const Index first = system.layout().multiplier_start(), dim = system.layout().dim();
  for (Index face = 0; face < system.mesh().fractures.owned; ++face) a[first + dim * face] = (face + 1) % every == 0 ? -1 : 1;
  return x;
}

TEST(multigrid, depends_on_the_contact_at_hand_alone) {
  const ScopedOption multigrid("-displacement_pc_type", "gamg");
  for (const auto bubbles : {spaces::Bubbles::fracture, spaces::Bubbles::all}) {
    ContactScene scene([] { return crossed_box({3, "hexahedra"}, 8); }, pushed_and_sheared(bubbles));
    assembly::MechanicsSystem& system = *scene.system;
    const la::Handle<Vec> closed = pressed(system, system.mesh().fractures.owned + 1), open = pressed(system, 3);
    solver::LinearSolver old(system), fresh(system);
    direction_at(system, old, closed);
    expect_same_direction(system, old, fresh, open);
  }
}

}  // namespace
}  // namespace polyslip
