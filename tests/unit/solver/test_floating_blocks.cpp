// Blocks that contact alone holds, and states that leave them free.
#include "polyslip/assembly/floating_blocks.hpp"

#include <gtest/gtest.h>

#include "support/contact_scene.hpp"

namespace polyslip::tests {
namespace {

using assembly::FloatingBlocks;
using physics::ContactState;

const Shape plane{2, "quads"}, solid{3, "hexahedra"};

/// Two halves of a box with a fracture between them at x = 1/2.
std::unique_ptr<ContactScene> halves(const Shape& shape, std::vector<physics::BoundaryRule> boundary, double friction = 1) {
  physics::MechanicsProblem problem;
  problem.boundary = std::move(boundary);
  problem.contact = {contact(physics::FrictionLaw::coulomb, friction)};
  return std::make_unique<ContactScene>([&] { return fractured_box(shape, 4, 0, 1); }, problem);
}

physics::BoundaryRule push(const std::string& tag, const std::vector<std::string>& traction) {
  physics::BoundaryRule rule;
  rule.tag = tag;
  for (std::size_t a = 0; a < traction.size(); ++a) rule.traction[a] = Expression(traction[a], {}, "test");
  return rule;
}

std::optional<std::string> motion(const ContactScene& scene, ContactState state) {
  return FloatingBlocks(*scene.system).free_motion(std::vector<ContactState>(static_cast<std::size_t>(scene.mesh.fractures.owned), state));
}

TEST(floating_blocks, displacements_on_both_sides_leave_none) {
  const auto scene = halves(plane, {hold("left", {"0", "0"}), hold("right", {"0", "0"})});
  EXPECT_TRUE(FloatingBlocks(*scene->system).blocks().empty());
  EXPECT_FALSE(motion(*scene, ContactState::open));
}

TEST(floating_blocks, a_half_without_displacements_is_held_by_sticking_faces_only) {
  for (const Shape& shape : {plane, solid}) {
    const auto scene = halves(shape, {hold("left", {"0", "0", "0"})});
    const FloatingBlocks floating(*scene->system);
    ASSERT_EQ(floating.blocks().size(), 1u);
    EXPECT_EQ(floating.blocks()[0].cells, shape.dim == 2 ? 8 : 32);
    EXPECT_GT(floating.blocks()[0].point.x(), 0.5);
    EXPECT_FALSE(floating.unstoppable_motion());
    EXPECT_TRUE(motion(*scene, ContactState::open));
    ASSERT_TRUE(motion(*scene, ContactState::slip));
  }
  const auto slipping = motion(*halves(plane, {hold("left", {"0", "0"})}), ContactState::slip);
  EXPECT_NE(slipping->find("about (0.625, 0.125, 0) is free to move along (0, 1, 0)"), std::string::npos) << *slipping;
}

TEST(floating_blocks, what_the_fracture_leaves_free_a_displacement_may_hold) {
  const auto guided = halves(plane, {hold("left", {"0", "0"}), hold("bottom", {"", "0"})});
  EXPECT_FALSE(motion(*guided, ContactState::slip));
  EXPECT_TRUE(motion(*guided, ContactState::open));
}

TEST(floating_blocks, rock_that_nothing_holds_moves_whatever_sticks) {
  const auto scene = halves(plane, {hold("left", {"0", ""})});
  EXPECT_EQ(FloatingBlocks(*scene->system).blocks().size(), 2u);
  EXPECT_TRUE(FloatingBlocks(*scene->system).unstoppable_motion());
}

TEST(floating_blocks, newton_refuses_a_block_that_slides_and_keeps_one_that_sticks) {
  const auto rough = halves(plane, {hold("left", {"0", "0"}), push("right", {"-1", "0.1"})}, 1);
  EXPECT_TRUE(rough->solve().converged);
  const auto smooth = halves(plane, {hold("left", {"0", "0"}), push("right", {"-1", "0.1"})}, 0.01);
  const solver::NewtonResult refused = smooth->solve();
  EXPECT_FALSE(refused.converged);
  EXPECT_NE(refused.message.find("mechanics.boundary"), std::string::npos) << refused.message;
}

}  // namespace
}  // namespace polyslip::tests
