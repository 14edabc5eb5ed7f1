// Rock, contact and fluid in one step: exact derivatives through the condensation, solvers that agree, books that balance.
#include <gtest/gtest.h>

#include "polyslip/la/vec_access.hpp"
#include "support/coupled_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;
using assembly::CoupledSystem;
using physics::ConductivityTime;

/// A vector of the system with independent entries of these sizes; the same on any number of ranks is not needed here.
la::Handle<Vec> random_state(const CoupledSystem& system, unsigned seed, double displacement, double traction, double pressure) {
  la::Handle<Vec> z = system.create_vector();
  std::mt19937 engine(seed + 17 * static_cast<unsigned>(mpi::rank(PETSC_COMM_WORLD)));
  std::uniform_real_distribution<double> uniform(-1, 1);
  const la::VecWrite a(z);
  const assembly::Layout& l = system.layout();
  for (Index i = 0; i < system.size(); ++i)
    a[i] = uniform(engine) * (i < l.multiplier_start() ? displacement : i < l.size() ? traction : pressure);
  return z;
}

double norm(Vec v) {
  PetscReal n = 0;
  POLYSLIP_PETSC(VecNorm(v, NORM_2, &n));
  return n;
}

class coupled_derivatives : public testing::TestWithParam<std::tuple<Shape, ConductivityTime, spaces::Bubbles>> {};

TEST_P(coupled_derivatives, the_direction_solves_the_linearised_rows) {
  const auto& [shape, conductivities, bubbles] = GetParam();
  CoupledScene scene(shape, {.dilation = 0.1, .conductivities = conductivities, .bubbles = bubbles});
  CoupledSystem& system = *scene.system;
  la::Handle<Vec> before = random_state(system, 1, 1e-3, 0, 0.1), z = random_state(system, 2, 2e-3, 1, 0.1);
  ASSERT_TRUE(system.begin_step(before, 0.3));
  scene.flow->set_loads(scene.flow->load_assembler().at(1));
  system.set_loads(system.load_assembler().at(1));
  system.impose_dirichlet(z);
  solver::CoupledSolver linear(system);
  la::Handle<Vec> f = system.create_vector(), direction = system.create_vector(), plus = system.create_vector(),
                  minus = system.create_vector(), trial = system.create_vector();
  {  // Other pressures drive other fluxes through the same apertures, and leave the contact law as it is.
    la::Handle<Vec> elsewhere = random_state(system, 3, 0, 0, 0.1);
    POLYSLIP_PETSC(VecAXPY(elsewhere, 1.0, z));
    system.linearise(elsewhere, linear.content());
  }
  system.residual(z, f);
  system.linearise(z, linear.content());
  linear.matrix_changed(system.states(z), true);
  POLYSLIP_PETSC(linear.solve(f, direction, system.norms(z, f), 1e-14, false, {}));
  const double step = 1e-7;
  for (auto [sign, rows] : {std::pair{1.0, plus.get()}, std::pair{-1.0, minus.get()}}) {
    POLYSLIP_PETSC(VecWAXPY(trial, sign * step, direction, z));
    system.residual(trial, rows);
  }
  POLYSLIP_PETSC(VecAXPY(plus, -1.0, minus));
  POLYSLIP_PETSC(VecAXPY(plus, -2 * step, f));
  EXPECT_LT(norm(plus) / (2 * step), 2e-6 * norm(f));
}

std::string case_name(const testing::TestParamInfo<std::tuple<Shape, ConductivityTime, spaces::Bubbles>>& info) {
  const auto& [shape, conductivities, bubbles] = info.param;
  return shape.name + std::to_string(shape.dim) + "d" + (conductivities == ConductivityTime::current ? "_current" : "_previous") +
         (bubbles == spaces::Bubbles::all ? "_bubbles_on_all_faces" : "");
}

INSTANTIATE_TEST_SUITE_P(every_shape, coupled_derivatives,
                         testing::Combine(testing::ValuesIn(planar_shapes()),
                                          testing::Values(ConductivityTime::previous, ConductivityTime::current),
                                          testing::Values(spaces::Bubbles::fracture, spaces::Bubbles::all)),
                         case_name);

struct History {
  la::Handle<Vec> x, q;
  int newton = 0;
  double energy_error = 0, mass_error = 0;  ///< Relative to what was exchanged.
};

/// What backward Euler loses: half the square of the change, in the norms of rock and fluid.
double numerical_dissipation(const CoupledScene& scene, const solver::CoupledStep& step) {
  la::Handle<Vec> z = scene.system->create_vector(), x = scene.system->layout().create_vector(), q = scene.flow->layout().create_vector();
  POLYSLIP_PETSC(VecWAXPY(x, -1.0, step.accepted(), step.trial()));
  POLYSLIP_PETSC(VecWAXPY(q, -1.0, step.accepted_pressure(), step.trial_pressure()));
  scene.system->join(x, q, z);
  return assembly::elastic_energy(*scene.system, z) + scene.flow->stored_energy(q);
}


/// A few steps to t = 1.
History run(CoupledScene& scene, int steps = 4) {
  solver::ContactNewton newton(*scene.system, std::make_unique<solver::CoupledSolver>(*scene.system));
  solver::CoupledStep step(*scene.system, newton, 0);
  History result{scene.system->layout().create_vector(), scene.flow->layout().create_vector()};
  for (int k = 0; k < steps; ++k) {
    const auto outcome = step.attempt(k / double(steps), (k + 1) / double(steps), (k + 1) / double(steps));
    EXPECT_TRUE(outcome.converged) << outcome.message;
    result.newton += outcome.newton;
    const solver::CoupledBooks& books = step.books();
    const double lost = numerical_dissipation(scene, step);
    result.energy_error = std::max(result.energy_error, std::abs(books.energy.excess() + lost) / books.energy.turnover());
    result.mass_error = std::max(result.mass_error, std::abs(books.fluid.error()) / books.fluid.turnover);
    step.accept();
  }
  POLYSLIP_PETSC(VecCopy(step.accepted(), result.x));
  POLYSLIP_PETSC(VecCopy(step.accepted_pressure(), result.q));
  return result;
}

class coupled_steps : public testing::TestWithParam<std::tuple<Shape, spaces::Bubbles>> {
 protected:
  Shape shape_ = std::get<0>(GetParam());
  spaces::Bubbles bubbles_ = std::get<1>(GetParam());
};

TEST_P(coupled_steps, create_neither_energy_nor_fluid) {
  for (double dilation : {0.0, 0.1}) {
    CoupledScene scene(shape_, {.dilation = dilation, .bubbles = bubbles_});
    const History steps = run(scene);
    EXPECT_LT(steps.energy_error, 1e-9);
    EXPECT_LT(steps.mass_error, 1e-9);
    EXPECT_LE(steps.newton, 40);
    const auto counts = scene.system->count(scene.system->states(steps.x));
    EXPECT_GT(counts.faces[2], 0) << "the test is about faces that slip";
  }
}

TEST_P(coupled_steps, are_the_same_by_fixed_stress_and_by_factorisation) {
  CoupledScene scene(shape_, {.bubbles = bubbles_});
  const History direct = run(scene, 2);
  const ScopedOption fixed_stress("-coupled_pc_type", "fieldsplit");
  CoupledScene again(shape_, {.bubbles = bubbles_});
  const History split = run(again, 2);
  for (auto [a, b] : {std::pair{direct.x.get(), split.x.get()}, std::pair{direct.q.get(), split.q.get()}}) {
    const double size = norm(a);
    POLYSLIP_PETSC(VecAXPY(a, -1.0, b));
    EXPECT_LT(norm(a), 1e-8 * size);
  }
}

/// A step of a quarter from t = 3/4 after three such steps; where Newton starts and what it finds.
struct LastStep {
  solver::NewtonRecord start;
  int newton = 0;
  la::Handle<Vec> x;
};

/// `change` may alter what is kept of the state before the accepted one.
LastStep last_step(CoupledScene& scene, const std::function<void(solver::CoupledStep&, solver::CoupledStep::Before&)>& change) {
  solver::ContactNewton newton(*scene.system, std::make_unique<solver::CoupledSolver>(*scene.system));
  solver::CoupledStep step(*scene.system, newton, 0);
  for (double t : {0.0, 0.25, 0.5}) {
    EXPECT_TRUE(step.attempt(t, t + 0.25, t + 0.25).converged);
    step.accept();
  }
  auto before = step.before();
  change(step, before);
  step.restore_before(before);
  LastStep last{{}, 0, scene.system->layout().create_vector()};
  newton.monitor = [&](const solver::NewtonRecord& record) {
    if (record.iteration == 0 && record.remedy.empty()) last.start = record;
  };
  const auto outcome = step.attempt(0.75, 1, 1);
  EXPECT_TRUE(outcome.converged) << outcome.message;
  last.newton = outcome.newton;
  POLYSLIP_PETSC(VecCopy(step.trial(), last.x));
  return last;
}

void forget(solver::CoupledStep&, solver::CoupledStep::Before& before) { before.size = 0; }

class predicted_steps : public testing::TestWithParam<Shape> {};

TEST_P(predicted_steps, start_where_the_last_speed_leads) {
  CoupledScene scene(GetParam(), {}), other(GetParam(), {});
  const LastStep led = last_step(scene, [](auto&, auto&) {}), plain = last_step(other, forget);
  EXPECT_LT(led.start.momentum + led.start.contact, 0.1 * (plain.start.momentum + plain.start.contact));
  EXPECT_LE(led.newton, plain.newton + 1);
  POLYSLIP_PETSC(VecAXPY(led.x, -1.0, plain.x));
  EXPECT_LT(norm(led.x), 1e-8 * norm(plain.x));
}

TEST_P(predicted_steps, start_where_they_are_when_the_last_speed_misleads) {
  CoupledScene scene(GetParam(), {}), other(GetParam(), {});
  const LastStep misled = last_step(scene, [](auto& step, auto& before) {
    POLYSLIP_PETSC(VecCopy(step.accepted(), before.x));
    POLYSLIP_PETSC(VecScale(before.x, 3.0));
  });
  const LastStep plain = last_step(other, forget);
  EXPECT_NEAR(misled.start.momentum, plain.start.momentum, 1e-9 * plain.start.momentum);
  EXPECT_EQ(misled.newton, plain.newton);
}

TEST(coupled_elimination, leaves_contact_rows_alone_that_are_solved) {
  const ScopedOption split("-coupled_pc_type", "fieldsplit"), short_solves("-coupled_ksp_max_it", "3");
  CoupledScene scene({2, "quads"}, {.friction = 0.4}, 8);
  solver::ContactNewton newton(*scene.system, std::make_unique<solver::CoupledSolver>(*scene.system));
  solver::CoupledStep step(*scene.system, newton, 0);
  int rested = 0;
  newton.monitor = [&](const solver::NewtonRecord& record) {
    if (record.iteration < 2 || record.changed > 0 || record.contact > 1e-12) return;
    ++rested;
    EXPECT_EQ(record.window_steps, 0) << "iteration " << record.iteration;
  };
  ASSERT_TRUE(step.attempt(0, 0.25, 0.25).converged);
  EXPECT_GT(rested, 2) << "short solves of what fluid and rock do are nothing to contact";
}

TEST(coupled_elimination, solves_windows_as_options_say) {
  const ScopedOption type("-elimination_ksp_type", "gmres"), tight("-elimination_ksp_rtol", "1e-12"), long_enough("-elimination_ksp_max_it", "999"),
      all("-elimination_share", "1");
  for (const Shape& shape : {Shape{2, "quads"}, Shape{3, "hexahedra"}}) {
    SCOPED_TRACE(shape.name);
    CoupledScene scene(shape, {.friction = 0.4}, 8);
    CoupledSystem& system = *scene.system;
    system.hold_all_rows();  // bjacobi's windows are copied by PETSc
    const la::Handle<Vec> before = system.create_vector(), f = system.create_vector(), start = random_state(system, 2, 0, 0.1, 0);
    ASSERT_TRUE(system.begin_step(before, 0.3));
    scene.flow->set_loads(scene.flow->load_assembler().at(1));
    system.set_loads(system.load_assembler().at(1));
    const auto improved = [&](const char* preconditioner) {
      const ScopedOption chosen("-elimination_pc_type", preconditioner);
      la::Handle<Vec> z = system.create_vector();
      POLYSLIP_PETSC(VecCopy(start, z));
      system.residual(z, f);
      solver::NonlinearElimination elimination(system);
      elimination.improve(z, f);
      EXPECT_GT(elimination.steps(), 0) << preconditioner;
      return z;
    };
    const la::Handle<Vec> by_products = improved("jacobi"), by_matrix = improved("bjacobi");
    PetscReal moved = 0, difference = 0;
    POLYSLIP_PETSC(VecAXPY(by_matrix, -1, by_products));
    POLYSLIP_PETSC(VecNorm(by_matrix, NORM_2, &difference));
    POLYSLIP_PETSC(VecAXPY(by_products, -1, start));
    POLYSLIP_PETSC(VecNorm(by_products, NORM_2, &moved));
    EXPECT_LT(difference, 1e-8 * moved);
  }
}

TEST(coupled_rows, are_measured_one_by_one_and_by_what_they_lose_together) {
  CoupledScene scene({2, "quads"}, {});
  CoupledSystem& system = *scene.system;
  la::Handle<Vec> before = system.create_vector(), z = system.create_vector(), f = system.create_vector();
  const Index first = system.layout().size();
  const auto measured = [&] {  // where all rows are 2
    system.residual(z, f);
    {
      const la::VecWrite rows(f);
      for (Index i = first; i < system.size(); ++i) rows[i] = 2;
    }
    return system.norms(z, f);
  };
  const double n = static_cast<double>(scene.flow->layout().numbering().total);
  ASSERT_TRUE(system.begin_step(before, 0.3));
  scene.flow->set_loads(scene.flow->load_assembler().at(0));
  system.set_loads(system.load_assembler().at(0));
  {
    const la::VecWrite q(z);
    if (mpi::rank(PETSC_COMM_WORLD) == 0) q[first + scene.flow->layout().cell(0)] = 1;
  }
  const assembly::ResidualNorms one_cell = measured();
  EXPECT_NEAR(one_cell.flow, 2 * std::sqrt(n), 1e-12 * n);
  EXPECT_NEAR(one_cell.flow_loss, 2 * n, 1e-12 * n);
  EXPECT_NEAR(one_cell.flow_turnover, one_cell.flow_scale, 1e-12 * one_cell.flow_scale) << "one cell alone moves";
  {
    const la::VecWrite q(z);
    for (Index i = first; i < system.size(); ++i) q[i] = 1;
  }
  const assembly::ResidualNorms all = measured();
  EXPECT_GT(all.flow_turnover, 2 * all.flow_scale);
}

TEST(coupled_rows, may_rest_on_round_off_but_not_lose_fluid) {
  assembly::ResidualNorms rows;
  rows.flow_scale = 1e3;
  rows.flow_turnover = 1e6;
  EXPECT_TRUE(solver::is_balanced(rows, 1e-10));
  rows.flow = 1e-6;
  EXPECT_FALSE(solver::is_balanced(rows, 1e-10));
  EXPECT_TRUE(solver::is_balanced(rows, 1e-8));
  rows.flow_floor = 1e-5;
  EXPECT_TRUE(solver::is_balanced(rows, 1e-10));
  rows.flow_loss = 5e-4;
  EXPECT_TRUE(solver::is_balanced(rows, 1e-10)) << "half a billionth of what moves";
  rows.flow_loss = 1e-1;
  EXPECT_FALSE(solver::is_balanced(rows, 1e-10));
  EXPECT_TRUE(solver::is_balanced(rows, 1e-7));
  rows.flow_floor = 1;
  EXPECT_TRUE(solver::is_balanced(rows, 1e-10)) << "no digits are left";
}

TEST(fixed_stress, depends_on_the_contact_at_hand_alone) {
  const ScopedOption split("-coupled_pc_type", "fieldsplit"), tolerance("-coupled_ksp_rtol", "1e-8");
  const std::pair<spaces::Bubbles, const char*> cases[] = {{spaces::Bubbles::fracture, "gamg"},
                                                             {spaces::Bubbles::all, "fieldsplit"},
                                                             {spaces::Bubbles::fracture, "hypre"},
                                                             {spaces::Bubbles::fracture, "bjacobi"}};
  for (const auto& [bubbles, displacement] : cases) {
    SCOPED_TRACE(displacement);
    const ScopedOption block("-coupled_fieldsplit_displacement_pc_type", displacement);
    CoupledScene scene({3, "hexahedra"}, {.friction = 2, .bubbles = bubbles}, 8);
    CoupledSystem& system = *scene.system;
    la::Handle<Vec> open = system.create_vector(), closed = system.create_vector();
    ASSERT_TRUE(system.begin_step(closed, 0.3));
    scene.flow->set_loads(scene.flow->load_assembler().at(1));
    system.set_loads(system.load_assembler().at(1));
    {
      const la::VecWrite a(open), b(closed);
      for (Index i = system.layout().multiplier_start(); i < system.layout().size(); i += 3) a[i] = -1, b[i] = 1;
    }
    solver::CoupledSolver old(system), fresh(system);
    direction_at(system, old, open);
    expect_same_direction(system, old, fresh, closed);
  }
}

TEST(fixed_stress, is_set_up_anew_where_an_old_one_fails) {
  const ScopedOption split("-coupled_pc_type", "fieldsplit");
  CoupledScene scene({2, "quads"}, {});
  CoupledSystem& system = *scene.system;
  la::Handle<Vec> z = system.create_vector();
  ASSERT_TRUE(system.begin_step(z, 0.3));
  scene.flow->set_loads(scene.flow->load_assembler().at(1));
  system.set_loads(system.load_assembler().at(1));
  solver::CoupledSolver linear(system);
  direction_at(system, linear, z);
  POLYSLIP_PETSC(KSPSetTolerances(linear.ksp(), 1e-12, 0, 1e-30, 500));  // whatever is left counts as divergence
  direction_at(system, linear, z);
  EXPECT_GT(linear.last_iterations(), 1);
  EXPECT_FALSE(linear.failed());
  EXPECT_EQ(linear.counts().setups, 2);
}

TEST(fixed_stress, lets_the_rock_settle_at_the_pressures_at_hand) {
  const ScopedOption split("-coupled_pc_type", "fieldsplit"), tight("-elimination_rock_ksp_rtol", "1e-6");
  for (const Shape& shape : {Shape{2, "quads"}, Shape{3, "hexahedra"}}) {
    SCOPED_TRACE(shape.name);
    CoupledScene scene(shape, {.friction = 0.4}, 8);
    CoupledSystem& system = *scene.system;
    la::Handle<Vec> z = system.create_vector(), f = system.create_vector(), was = system.create_vector();
    ASSERT_TRUE(system.begin_step(z, 0.3));
    scene.flow->set_loads(scene.flow->load_assembler().at(1));
    system.set_loads(system.load_assembler().at(1));
    solver::CoupledSolver linear(system);
    EXPECT_EQ(linear.displacement_preconditioner(), nullptr) << "before there is a matrix";
    direction_at(system, linear, z);
    ASSERT_NE(linear.displacement_preconditioner(), nullptr);
    {
      const la::VecWrite a(z);
      for (Index i = system.layout().multiplier_start(); i < system.layout().size(); i += 4) a[i] -= 0.1;
    }
    POLYSLIP_PETSC(VecCopy(z, was));
    system.residual(z, f);
    const assembly::ResidualNorms before = system.norms(z, f);
    ASSERT_GT(before.contact, 0);
    solver::NonlinearElimination elimination(system);
    EXPECT_TRUE(elimination.improve(z, f, linear.displacement_preconditioner()));
    const assembly::ResidualNorms after = system.norms(z, f);
    EXPECT_LT(after.contact, 0.003 * before.contact);
    EXPECT_LT(after.momentum, 0.01 * before.momentum);
    {
      const ScopedOption windows_alone("-elimination_rock", "false");
      const la::Handle<Vec> by_windows = system.create_vector(), rows = system.create_vector();
      POLYSLIP_PETSC(VecCopy(was, by_windows));
      system.residual(by_windows, rows);
      solver::NonlinearElimination(system).improve(by_windows, rows, linear.displacement_preconditioner());
      EXPECT_GT(system.norms(by_windows, rows).momentum, 0.1 * before.momentum) << "beside the fractures";
    }
    la::Handle<Vec> x = system.layout().create_vector(), q = scene.flow->layout().create_vector(), q_was = scene.flow->layout().create_vector();
    system.split(was, x, q_was);
    system.split(z, x, q);
    POLYSLIP_PETSC(VecAXPY(q, -1.0, q_was));
    PetscReal moved = 0;
    POLYSLIP_PETSC(VecNorm(q, NORM_INFINITY, &moved));
    EXPECT_EQ(moved, 0) << "pressures are held";
  }
}

/// The first iteration of a step, by fixed stress.
struct FirstIteration {
  const ScopedOption split{"-coupled_pc_type", "fieldsplit"};
  CoupledScene scene{{2, "quads"}, {}};
  CoupledSystem& system = *scene.system;
  la::Handle<Vec> z = system.create_vector(), f = system.create_vector(), direction = system.create_vector();
  solver::CoupledSolver linear{system};

  FirstIteration() {
    EXPECT_TRUE(system.begin_step(z, 0.3));
    scene.flow->set_loads(scene.flow->load_assembler().at(1));
    system.set_loads(system.load_assembler().at(1));
    system.residual(z, f);
    system.linearise(z, linear.content());
    linear.matrix_changed(system.states(z), true);
  }

  int iterations(const assembly::ResidualNorms& norms, bool loose, const solver::IsWorthMore& is_worth_more) {
    POLYSLIP_PETSC(linear.solve(f, direction, norms, 1e-10, loose, is_worth_more));
    return linear.last_iterations();
  }
};

TEST(fixed_stress, goes_on_where_newton_does) {
  FirstIteration first;
  assembly::ResidualNorms coarse;
  coarse.momentum_scale = coarse.flow_floor = 1e12;  // nothing is left to do, as far as these say
  EXPECT_GT(first.iterations(coarse, false, {}), 0);
}

TEST(fixed_stress, asks_once_whether_a_loose_direction_is_worth_more) {
  FirstIteration first;
  const assembly::ResidualNorms norms = first.system.norms(first.z, first.f);
  int asked = 0;
  la::Handle<Vec> loose = first.system.create_vector();
  const auto ask = [&](bool goes_on) {
    return [&, goes_on](Vec direction) {
      ++asked;
      POLYSLIP_PETSC(VecCopy(direction, loose));
      return goes_on;
    };
  };
  const int all = first.iterations(norms, false, ask(false)), some = first.iterations(norms, true, {});
  EXPECT_EQ(asked, 0);
  EXPECT_LT(some, all);
  EXPECT_EQ(first.iterations(norms, true, ask(false)), some);
  EXPECT_EQ(asked, 1);
  POLYSLIP_PETSC(VecAXPY(loose, -1.0, first.direction));
  EXPECT_LT(norm(loose), 1e-12 * norm(first.direction)) << "it was asked of another direction";
  EXPECT_EQ(first.iterations(norms, true, ask(true)), all) << "the Krylov space was thrown away";
  EXPECT_EQ(asked, 2);
}

INSTANTIATE_TEST_SUITE_P(every_shape, predicted_steps, testing::ValuesIn(planar_shapes()), ShapeName());
INSTANTIATE_TEST_SUITE_P(every_shape, coupled_steps,
                         testing::Combine(testing::ValuesIn(planar_shapes()), testing::Values(spaces::Bubbles::fracture, spaces::Bubbles::all)),
                         ShapeAndBubblesName());

}  // namespace
}  // namespace polyslip
