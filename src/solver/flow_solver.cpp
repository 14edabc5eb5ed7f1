#include "polyslip/solver/flow_solver.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "polyslip/common/error.hpp"
#include "polyslip/la/memory.hpp"
#include "polyslip/la/options.hpp"
#include "polyslip/solver/pressure_multigrid.hpp"

namespace polyslip::solver {

namespace {

constexpr const char* prefix = "pressure_";
/// Unknowns up to which a factorisation pays over some ten steps. Its set-up is three to four times that of multigrid, its solves
/// take a third.
constexpr GlobalIndex direct_limit_2d = 200'000, direct_limit_3d = 50'000;
/// Passes of correction: enough for multigrid at 1e-8 each to reach the digits that doubles have.
constexpr int max_passes = 4;
constexpr double balanced = 1e-11;   ///< Fluid that no row accounts for, in units of the turnover: no further pass is needed.
constexpr double unbalanced = 1e-6;  ///< And what is too much after the last pass.

/// Sum of the sizes of all entries.
double sum_of_sizes(Vec v) {
  PetscReal sum = 0;
  POLYSLIP_PETSC(VecNorm(v, NORM_1, &sum));
  return sum;
}

}  // namespace

FlowSolver::FlowSolver(assembly::FlowSystem& system)
    : system_(system),
      previous_(system.layout().create_vector()),
      residual_(system.layout().create_vector()),
      correction_(system.layout().create_vector()) {
  PetscReal storage = 0;
  POLYSLIP_PETSC(VecNorm(system.storage(), NORM_INFINITY, &storage));
  if (storage == 0 && system.load_assembler().fixed_total() == 0)
    throw InputError("nothing determines the pressure: no boundary has a given pressure, and nothing stores fluid", "flow",
                     "Give a pressure on some boundary, or 1/M > 0 and flow in time");
  POLYSLIP_PETSC(KSPCreate(system.mesh().comm, ksp_.put()));
  POLYSLIP_PETSC(KSPSetOptionsPrefix(ksp_, prefix));
  choose();
}

void FlowSolver::choose() {
  const int dim = system_.mesh().mesh.dim;
  const GlobalIndex unknowns = system_.layout().numbering().total, limit = dim == 2 ? direct_limit_2d : direct_limit_3d;
  PC pc = nullptr;
  POLYSLIP_PETSC(KSPGetPC(ksp_, &pc));
  POLYSLIP_PETSC(KSPSetType(ksp_, KSPCG));
  POLYSLIP_PETSC(KSPSetNormType(ksp_, KSP_NORM_NATURAL));
  POLYSLIP_PETSC(KSPSetTolerances(ksp_, 1e-8, 0.0, PETSC_DEFAULT, 500));
  la::default_option(prefix, "pc_factor_mat_solver_type", MATSOLVERMUMPS);
  if (la::user_sets(prefix, "-pc_type")) {
    choice_ = "pressure solver: as the options say";
    if (la::user_chooses(prefix, "-pc_type", PCHYPRE)) default_pressure_multigrid(prefix, dim);
  } else if (unknowns <= limit) {
    POLYSLIP_PETSC(KSPSetType(ksp_, KSPPREONLY));
    POLYSLIP_PETSC(KSPSetNormType(ksp_, KSP_NORM_NONE));
    POLYSLIP_PETSC(PCSetType(pc, PCCHOLESKY));
    choice_ = fmt::format(
        "pressure solver: sparse Cholesky (MUMPS), as {} unknowns in {}D are at most {}; -pressure_pc_type hypre for multigrid",
        unknowns, dim, limit);
  } else {
    POLYSLIP_PETSC(PCSetType(pc, PCHYPRE));
    default_pressure_multigrid(prefix, dim);
    choice_ = fmt::format(
        "pressure solver: conjugate gradients with algebraic multigrid (BoomerAMG), as {} unknowns in {}D exceed {}; "
        "-pressure_pc_type cholesky for a factorisation",
        unknowns, dim, limit);
  }
  POLYSLIP_PETSC(KSPSetFromOptions(ksp_));
  PetscBool factor = PETSC_FALSE;
  POLYSLIP_PETSC(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(pc), &factor, PCLU, PCCHOLESKY, ""));
  factorises_ = factor == PETSC_TRUE;
}

void FlowSolver::use_matrix() {
  const Mat matrix = system_.matrix();
  POLYSLIP_PETSC(KSPSetOperators(ksp_, matrix, matrix));
  if (system_.matrix_version() == set_up_for_) return;
  set_up_for_ = system_.matrix_version();
  ++counts_.setups;
  if (factorises_) ++counts_.factorisations;
}

void FlowSolver::count(FlowStep& step) {
  PetscInt its = 0;
  KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
  POLYSLIP_PETSC(KSPGetIterationNumber(ksp_, &its));
  POLYSLIP_PETSC(KSPGetConvergedReason(ksp_, &reason));
  const int iterations = static_cast<int>(its);
  step.iterations += iterations;
  counts_.iterations += iterations;
  counts_.max_per_solve = std::max(counts_.max_per_solve, iterations);
  if (reason > 0) return;
  if (const std::string lack = la::lack_of_memory(ksp_, "-pressure_pc_type hypre"); !lack.empty()) throw ResourceError(lack);
  step.converged = false;
  step.message = fmt::format("the pressure solver stopped after {} iterations ({}); -pressure_pc_type cholesky may help", its,
                             KSPConvergedReasons[reason]);
}

FlowStep FlowSolver::step(Vec q) {
  FlowStep step;
  use_matrix();
  POLYSLIP_PETSC(VecCopy(q, previous_));
  system_.impose(q);
  system_.residual(q, previous_, residual_);
  double lost = 0, turnover = 0;
  for (int pass = 0; pass < max_passes && step.converged; ++pass) {
    POLYSLIP_PETSC(KSPSolve(ksp_, residual_, correction_));
    count(step);
    POLYSLIP_PETSC(VecAXPY(q, -1.0, correction_));
    system_.residual(q, previous_, residual_);
    lost = sum_of_sizes(residual_);
    turnover = system_.balance(q, previous_).turnover;
    if (lost <= std::max(balanced * turnover, 4 * system_.round_off(q))) return step;
  }
  if (step.converged && lost > std::max(unbalanced * turnover, 100 * system_.round_off(q))) {
    step.converged = false;
    step.message =
        fmt::format("{:.1e} of the fluid is lost after {} passes of the pressure solver; -pressure_pc_type cholesky may help",
                    lost / turnover, max_passes);
  }
  return step;
}

}  // namespace polyslip::solver
