// Load steps, and what a whole run leaves behind.
#include <gtest/gtest.h>

#include <map>

#include "polyslip/solver/load_stepper.hpp"
#include "support/contact_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;
using solver::LoadStepper;
using solver::StepRecord;
using End = solver::StepperResult::End;

/// Two blocks pressed together and pushed to and fro along each other: slip = `push`(t) less what friction holds back.
physics::MechanicsProblem pushed_blocks(const std::string& push) {
  physics::MechanicsProblem problem;
  problem.boundary = {hold("left", {"0", "0"}), hold("right", {"-0.01", push})};
  problem.contact = {contact(physics::FrictionLaw::coulomb, 0.2)};
  return problem;
}

class load_stepper : public testing::Test {
 protected:
  ContactScene scene_{[] { return fractured_box({2, "quads"}, 4, 0, 1); }, pushed_blocks("0.1*sin(pi*t)")};
  solver::ContactNewton newton_{*scene_.system};

  /// Mean tangential jump along y, right side less left side.
  [[nodiscard]] double slip() const {
    double sum = 0;
    for (const auto& v : assembly::fracture_values(*scene_.system, scene_.x)) sum -= v.jump_tangential[1];
    return mpi::sum(PETSC_COMM_WORLD, sum) / scene_.system->fracture_faces();
  }
};

TEST_F(load_stepper, meets_the_ends_of_the_steps_and_of_the_run) {
  LoadStepper stepper(*scene_.system, newton_, {0, 0.5, 0.2});
  std::vector<double> times;
  stepper.accepted = [&](const StepRecord& record) { times.push_back(record.time); };
  const auto result = stepper.run(scene_.x);
  EXPECT_EQ(result.end, End::finished) << result.message;
  ASSERT_EQ(times.size(), 3U);
  EXPECT_NEAR(times[0], 0.2, 1e-14);
  EXPECT_NEAR(times[1], 0.4, 1e-14);
  EXPECT_EQ(times[2], 0.5);
  EXPECT_EQ(result.accepted, 3);
}

TEST_F(load_stepper, measures_friction_from_the_last_step) {
  // Pushed and pulled back to where it began, the block keeps a part of its slip, and the shear stress has turned round.
  std::vector<double> slips;
  LoadStepper stepper(*scene_.system, newton_, {0, 1, 0.25});
  stepper.accepted = [&](const StepRecord&) { slips.push_back(slip()); };
  const auto result = stepper.run(scene_.x);
  ASSERT_EQ(result.end, End::finished) << result.message;
  ASSERT_EQ(slips.size(), 4U);
  EXPECT_GT(slips[1], 0.05);
  EXPECT_GT(slips[3], 1e-3);
  EXPECT_LT(slips[3], 0.5 * slips[1]);
}

TEST_F(load_stepper, stops_between_steps_on_request) {
  LoadStepper stepper(*scene_.system, newton_, {0, 1, 0.25});
  int steps = 0;
  stepper.accepted = [&](const StepRecord&) { ++steps; };
  stepper.stop_requested = [&] { return steps == 2; };
  const auto result = stepper.run(scene_.x);
  EXPECT_EQ(result.end, End::stopped);
  EXPECT_EQ(result.accepted, 2);
}

TEST_F(load_stepper, cuts_steps_that_fail_and_gives_up_with_a_sentence) {
  const ScopedOption hopeless("-snes_max_it", "0");
  solver::ContactNewton newton(*scene_.system);
  LoadStepper stepper(*scene_.system, newton, {0, 1, 0.5});
  std::vector<double> sizes;
  stepper.rejected = [&](double, double size, const std::string&) { sizes.push_back(size); };
  la::Handle<Vec> start;
  POLYSLIP_PETSC(VecDuplicate(scene_.x, start.put()));
  POLYSLIP_PETSC(VecCopy(scene_.x, start));
  const auto result = stepper.run(scene_.x);
  EXPECT_EQ(result.end, End::diverged);
  EXPECT_EQ(result.accepted, 0);
  ASSERT_GT(sizes.size(), 3U);
  for (std::size_t k = 1; k < sizes.size(); ++k) EXPECT_NEAR(sizes[k], sizes[k - 1] / 2, 1e-6 * sizes[k]);
  EXPECT_LT(sizes.back(), 1e-3);
  EXPECT_NE(result.message.find("-snes_max_it"), std::string::npos) << result.message;
  PetscBool same = PETSC_FALSE;
  POLYSLIP_PETSC(VecEqual(scene_.x, start, &same));
  EXPECT_TRUE(same) << "the last accepted state stays";
}

/// Objects of each PETSc class that were made and not destroyed since the log began.
std::map<std::string, int> alive() {
  PetscStageLog log = nullptr;
  POLYSLIP_PETSC(PetscLogGetStageLog(&log));
  std::map<std::string, int> count;
  for (int stage = 0; stage < log->numStages; ++stage)
    for (int c = 0; c < log->stageInfo[stage].classLog->numClasses; ++c) {
      const auto& info = log->stageInfo[stage].classLog->classInfo[c];
      count[log->classLog->classInfo[c].name] += info.creations - info.destructions;
    }
  std::erase_if(count, [](const auto& entry) { return entry.second == 0; });
  return count;
}

TEST(whole_runs, destroy_every_petsc_object_that_they_made) {
  const auto run = [](physics::Formulation formulation, const char* pc) {
    auto problem = mixed_contact(2);
    problem.formulation = formulation;
    const ScopedOption option("-displacement_pc_type", pc);
    ContactScene scene([] { return fractured_box({2, "quads"}, 8, 0, 1); }, problem);
    EXPECT_TRUE(scene.solve().converged);
  };
  POLYSLIP_PETSC(PetscLogDefaultBegin());
  run(physics::Formulation::condensed, "cholesky");  // what PETSc makes once and keeps is made here
  run(physics::Formulation::condensed, "gamg");
  const auto before = alive();
  run(physics::Formulation::condensed, "cholesky");
  run(physics::Formulation::condensed, "gamg");
  run(physics::Formulation::saddle, "cholesky");
  EXPECT_EQ(alive(), before);
}

TEST(whole_runs, without_fractures_are_linear) {
  physics::MechanicsProblem problem;
  problem.boundary = {hold("left", {"0", "0"}), hold("right", {"0.01", "0.02*y"})};
  ContactScene scene(
      [] {
        mesh::PolyMesh mesh = mesh::make_box(unit_box({2, "quads"}, 4));
        mesh::build_copies(mesh);
        return mesh;
      },
      problem);
  const auto result = scene.solve();
  EXPECT_TRUE(result.converged) << result.message;
  EXPECT_EQ(result.iterations, 1);
}

}  // namespace
}  // namespace polyslip
