// Steps of rock in time, and what a whole run leaves behind.
#include <gtest/gtest.h>

#include <map>

#include "polyslip/solver/mechanics_step.hpp"
#include "support/contact_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;
using solver::MechanicsStep;
using solver::StepRecord;
using solver::TimeStepper;
using End = solver::StepperResult::End;

double norm(Vec v) {
  PetscReal value = 0;
  POLYSLIP_PETSC(VecNorm(v, NORM_2, &value));
  return value;
}

/// Two blocks pressed together and pushed to and fro along each other: slip = `push`(t) less what friction holds back.
physics::MechanicsProblem pushed_blocks(const std::string& push) {
  physics::MechanicsProblem problem;
  problem.boundary = {hold("left", {"0", "0"}), hold("right", {"-0.01", push})};
  problem.contact = {contact(physics::FrictionLaw::coulomb, 0.2)};
  return problem;
}

class mechanics_steps : public testing::Test {
 protected:
  ContactScene scene_{[] { return fractured_box({2, "quads"}, 4, 0, 1); }, pushed_blocks("0.1*sin(pi*t)")};
  solver::ContactNewton newton_{*scene_.system};
  MechanicsStep steps_{*scene_.system, newton_};

  /// Mean tangential jump along y, right side less left side.
  [[nodiscard]] double slip() const {
    double sum = 0;
    for (const auto& v : assembly::fracture_values(*scene_.system, steps_.trial())) sum -= v.jump_tangential[1];
    return mpi::sum(PETSC_COMM_WORLD, sum) / scene_.system->fracture_faces();
  }
};

TEST_F(mechanics_steps, measure_friction_from_the_last_step) {
  // Pushed and pulled back to where it began, the block keeps a part of its slip, and the shear stress has turned round.
  std::vector<double> slips;
  TimeStepper stepper(steps_, {0, 1, 0.25});
  stepper.solved = [&](const StepRecord&) { slips.push_back(slip()); };
  const auto result = stepper.run();
  ASSERT_EQ(result.end, End::finished) << result.message;
  ASSERT_EQ(slips.size(), 4U);
  EXPECT_GT(slips[1], 0.05);
  EXPECT_GT(slips[3], 1e-3);
  EXPECT_LT(slips[3], 0.5 * slips[1]);
}

TEST_F(mechanics_steps, that_fail_are_cut_and_given_up_with_a_sentence) {
  const ScopedOption hopeless("-snes_max_it", "0");
  solver::ContactNewton newton(*scene_.system);
  MechanicsStep steps(*scene_.system, newton);
  TimeStepper stepper(steps, {0, 1, 0.5});
  std::vector<double> sizes;
  stepper.rejected = [&](double, double size, const std::string&) { sizes.push_back(size); };
  const auto result = stepper.run();
  EXPECT_EQ(result.end, End::diverged);
  EXPECT_EQ(stepper.state().accepted, 0);
  EXPECT_EQ(stepper.state().rejected, static_cast<int>(sizes.size()));
  ASSERT_GT(sizes.size(), 3U);
  for (std::size_t k = 1; k < sizes.size(); ++k) EXPECT_NEAR(sizes[k], sizes[k - 1] / 2, 1e-6 * sizes[k]);
  EXPECT_LT(sizes.back(), 1e-3);
  EXPECT_NE(result.message.find("-snes_max_it"), std::string::npos) << result.message;
  EXPECT_EQ(norm(steps.accepted()), 0) << "the last accepted state stays";
  EXPECT_EQ(norm(steps.trial()), 0) << "and is what there is to show";
}

TEST_F(mechanics_steps, stop_at_the_next_newton_iteration_on_request) {
  const ScopedOption no_end("-snes_rtol", "0");
  solver::ContactNewton newton(*scene_.system);
  MechanicsStep steps(*scene_.system, newton);
  TimeStepper stepper(steps, {0, 1, 0.5});
  int iterations = 0;
  bool stop = false;
  newton.monitor = [&](const solver::NewtonRecord& record) { stop = ++iterations == 3 || stop || record.iteration > 9; };
  newton.stop_requested = stepper.stop_requested = [&] { return stop; };
  EXPECT_EQ(stepper.run().end, End::stopped);
  EXPECT_EQ(iterations, 3) << "no remedy is tried";
  EXPECT_EQ(stepper.state().accepted + stepper.state().rejected, 0);
  EXPECT_EQ(norm(steps.trial()), 0) << "the accepted state is what there is to show";
}

// Loads that do not depend on time grow with it over the scene's first step, and then stay.
TEST(mechanics_steps_of_given_loads, apply_them_in_parts) {
  ContactScene scene([] { return fractured_box({2, "quads"}, 4, 0, 1); }, pushed_blocks("0.001"));
  solver::ContactNewton newton(*scene.system);
  MechanicsStep steps(*scene.system, newton);
  double whole = 0;
  for (const auto& [from, to, mark, part] :
       std::vector<std::array<double, 4>>{{0, 1, 4, 0.25}, {1, 3, 4, 0.75}, {3, 4, 4, 1}, {4, 5, 8, 1}}) {
    ASSERT_TRUE(steps.attempt(from, to, mark).converged);
    steps.accept();
    EXPECT_DOUBLE_EQ(steps.load_fraction(), part);
    const auto& u = scene.system->loads().dirichlet;
    const double most = largest(u);
    whole = to == 1 ? most / part : whole;
    EXPECT_NEAR(most, part * whole, 1e-15);
  }
}

/// Faces that change in the first Newton iteration, and iterations with springs.
struct Approach {
  long long changed = 0;
  int springs = 0;
};

Approach approach(ContactScene& scene, double time) {
  scene.system->set_loads(scene.system->load_assembler().at(time));
  solver::ContactNewton newton(*scene.system);
  Approach found;
  newton.monitor = [&](const solver::NewtonRecord& record) {
    found.springs += record.remedy.find("springs") != std::string::npos ? 1 : 0;
    if (record.iteration == 1 && record.remedy.empty() && found.springs == 0) found.changed = record.changed;
  };
  EXPECT_TRUE(newton.solve(scene.x).converged);
  return found;
}

TEST(springs, come_first_where_many_faces_open_or_close_far_from_a_solution) {
  const auto box = [] { return fractured_box({2, "quads"}, 128, 0, 1); };
  ContactScene scene(box, mixed_contact(2)), eliminated(box, mixed_contact(2));
  EXPECT_EQ(approach(eliminated, 1).springs, 0) << "elimination alone settles this one";
  const ScopedOption none("-elimination_share", "0");
  EXPECT_GT(approach(scene, 1).springs, 0);
}

TEST(springs, stay_away_where_many_faces_open_near_a_solution) {
  // Uniaxial strain: lam_n = (2 mu + lambda)/100 less the fluid pressure, which takes a quarter of the faces from just above 0 to just below.
  physics::MechanicsProblem problem;
  problem.boundary = {hold("left", {"0", "0"}), hold("right", {"-0.01", "0"}), hold("bottom", {"", "0"}), hold("top", {"", "0"})};
  problem.contact = {contact(physics::FrictionLaw::coulomb, 0.5)};
  problem.contact[0].fracture_pressure = Expression(fmt::format("y < 0.25 ? {:.17g} + 0.001*t : 0", (2 * mu + lambda) / 100 - 0.0015), {}, "test");
  ContactScene scene([] { return fractured_box({2, "quads"}, 128, 0, 1); }, problem);
  approach(scene, 1);
  ASSERT_EQ(scene.counts()[0], 0);
  const Approach second = approach(scene, 2);
  EXPECT_GT(second.changed, 16) << "many faces are meant to open";
  EXPECT_EQ(second.springs, 0);
}

TEST_F(mechanics_steps, go_on_from_a_state_that_was_kept) {
  TimeStepper stepper(steps_, {0, 0.5, 0.25});
  ASSERT_EQ(stepper.run().end, End::finished);

  solver::ContactNewton newton(*scene_.system);
  MechanicsStep again(*scene_.system, newton);
  POLYSLIP_PETSC(VecCopy(steps_.accepted(), again.accepted()));
  again.restore(0.5, steps_.load_fraction());
  TimeStepper rest(again, {0, 1, 0.25}), rest_of_first(steps_, {0, 1, 0.25});
  rest.restore(stepper.state());
  ASSERT_EQ(rest.run().end, End::finished);
  EXPECT_EQ(rest.state().accepted, 4);

  const std::vector<Vec3> jumps(scene_.system->previous_jumps().begin(), scene_.system->previous_jumps().end());
  scene_.system->set_previous_jumps(steps_.accepted());
  rest_of_first.restore(stepper.state());
  ASSERT_EQ(rest_of_first.run().end, End::finished);
  POLYSLIP_PETSC(VecAXPY(again.accepted(), -1.0, steps_.accepted()));
  EXPECT_LT(norm(again.accepted()), 1e-10 * norm(steps_.accepted()));
  for (std::size_t f = 0; f < jumps.size(); ++f) EXPECT_LT((jumps[f] - scene_.system->previous_jumps()[f]).norm(), 1e-10);
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

TEST(whole_runs, converge_whatever_norm_the_krylov_method_measures) {
  // Young's modulus makes displacements small in their unit and forces large: a target for the one must not be taken for the other.
  auto problem = mixed_contact(3);
  problem.materials = {{.region = "", .where = {}, .first = Expression(1e10), .second = Expression(0.25), .place = ""}};
  const ScopedOption multigrid("-displacement_pc_type", "gamg");
  for (const char* method : {"cg", "gmres", "fgmres", "bcgs", "minres"}) {
    SCOPED_TRACE(method);
    const ScopedOption option("-displacement_ksp_type", method);
    ContactScene scene([] { return fractured_box({3, "hexahedra"}, 4, 0, 1); }, problem);
    EXPECT_TRUE(scene.solve().converged);
  }
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
