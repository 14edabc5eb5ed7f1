// Rock, contact and fluid in one step: exact derivatives through the condensation, solvers that agree, books that balance.
#include <gtest/gtest.h>

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
  const assembly::VecWrite a(z);
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
  system.residual(z, f);
  system.linearise(z, linear.content());
  linear.matrix_changed(system.states(z), true);
  POLYSLIP_PETSC(linear.solve(f, direction, system.norms(z, f), 1e-14, false));
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

INSTANTIATE_TEST_SUITE_P(every_shape, coupled_steps,
                         testing::Combine(testing::ValuesIn(planar_shapes()), testing::Values(spaces::Bubbles::fracture, spaces::Bubbles::all)),
                         ShapeAndBubblesName());

}  // namespace
}  // namespace polyslip
