#include "polyslip/solver/linear_solver.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "polyslip/la/options.hpp"
#include "polyslip/la/reuse.hpp"
#include "polyslip/solver/condensed_operator.hpp"

namespace polyslip::solver {

using assembly::MechanicsSystem;
using physics::ContactState;

namespace {

constexpr const char *prefix = "displacement_", *memory_remedy = "-displacement_pc_type gamg";
/// Unknowns up to which a factorisation is the better choice. In 2D that is for the sake of stretched cells (examples/single_crack): with
/// fractures, where it is made in almost each iteration, multigrid takes half to two thirds of its time on cells of like size.
constexpr GlobalIndex direct_limit_2d = 1'000'000, direct_limit_3d = 12'000, direct_limit_3d_fractured = 3'000;

}  // namespace

LinearSolver::LinearSolver(MechanicsSystem& system)
    : DirectionSolver(system, system.layout().create_displacement_vector()),
      system_(system),
      exact_operator_(condensed_operator(system, system.layout().displacement_size())),
      hierarchy_(system) {
  choose();
}

void LinearSolver::choose() {
  const int dim = system_.layout().dim();
  const GlobalIndex unknowns = system_.mesh().copies.total * dim + system_.layout().total_normals();
  const bool fractured = dim == 3 && system_.fracture_faces() > 0 && suits_multigrid(system_);
  const GlobalIndex limit = dim == 2 ? direct_limit_2d : fractured ? direct_limit_3d_fractured : direct_limit_3d;
  const std::string scene = fmt::format("{} unknowns in {}D{}", unknowns, dim, fractured ? " with fractures" : "");
  const bool direct = unknowns <= limit;
  PC pc = nullptr;
  POLYSLIP_PETSC(KSPCreate(system_.mesh().comm, ksp_.put()));
  POLYSLIP_PETSC(KSPSetOptionsPrefix(ksp_, prefix));
  POLYSLIP_PETSC(KSPGetPC(ksp_, &pc));
  la::default_option(prefix, "pc_factor_mat_solver_type", MATSOLVERMUMPS);
  user_ksp_ = la::user_sets(prefix, "-ksp_type");
  const bool user_pc = la::user_sets(prefix, "-pc_type");
  const bool multigrid = user_pc ? la::user_chooses(prefix, "-pc_type", displacement_multigrid(system_)) : !direct;
  if (multigrid) {
    default_displacement_multigrid(system_, prefix, 2);
    hold_rows_for_multigrid(system_, prefix);
  } else {
    system_.hold_all_rows();
  }
  if (user_pc) {
    choice_ = "linear solver: as the options say";
  } else if (direct) {
    POLYSLIP_PETSC(PCSetType(pc, PCCHOLESKY));
    choice_ = fmt::format("linear solver: sparse Cholesky (MUMPS), as {} are at most {}; -displacement_pc_type gamg for multigrid", scene, limit);
  } else {
    POLYSLIP_PETSC(PCSetType(pc, displacement_multigrid(system_)));
    choice_ = fmt::format("linear solver: algebraic multigrid (GAMG) with rigid-body modes, as {} exceed {}; "
                          "-displacement_pc_type cholesky for a factorisation", scene, limit);
  }
  POLYSLIP_PETSC(KSPSetType(ksp_, KSPCG));
  POLYSLIP_PETSC(KSPSetTolerances(ksp_, 1e-12, 0.0, PETSC_DEFAULT, 1000));
  POLYSLIP_PETSC(MatSetOption(system_.matrix(), MAT_SPD, PETSC_TRUE));
  POLYSLIP_PETSC(KSPSetOperators(ksp_, system_.matrix(), system_.matrix()));
  POLYSLIP_PETSC(KSPSetFromOptions(ksp_));
  split_displacement(system_, pc);
  POLYSLIP_PETSC(PetscOptionsGetReal(nullptr, prefix, "-loose_rtol", &loose_rtol_, nullptr));
  PetscBool lu = PETSC_FALSE, factor = PETSC_FALSE;
  POLYSLIP_PETSC(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(pc), &factor, PCLU, PCCHOLESKY, ""));
  factorises_ = factor == PETSC_TRUE;
  has_hierarchy_ = DisplacementHierarchy::has_one(pc);
  POLYSLIP_PETSC(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCLU, &lu));
  if (lu) {
    content_ = MechanicsSystem::MatrixContent::exact;
    POLYSLIP_PETSC(MatSetOption(system_.matrix(), MAT_SPD, PETSC_FALSE));
    POLYSLIP_PETSC(MatSetOption(system_.matrix(), MAT_SYMMETRIC, PETSC_FALSE));
    if (!user_ksp_) POLYSLIP_PETSC(KSPSetType(ksp_, KSPPREONLY));
    user_ksp_ = true;
  }
}

void LinearSolver::set_method() {
  if (!user_ksp_) {
    POLYSLIP_PETSC(KSPSetType(ksp_, system_.is_symmetric() ? KSPCG : KSPFGMRES));  // FGMRES: one application less than GMRES
    POLYSLIP_PETSC(KSPGMRESSetRestart(ksp_, 100));
    POLYSLIP_PETSC(KSPSetPCSide(ksp_, system_.is_symmetric() ? PC_LEFT : PC_RIGHT));
    POLYSLIP_PETSC(KSPSetNormType(ksp_, KSP_NORM_UNPRECONDITIONED));
  }
  const Mat exact = system_.matrix_is_exact() ? system_.matrix() : exact_operator_.get();
  POLYSLIP_PETSC(KSPSetOperators(ksp_, exact, system_.matrix()));
}

void LinearSolver::set_up_preconditioner(bool again) {
  is_reused_ = !again;
  bool entirely = true;
  if (!has_hierarchy_)
    la::reuse_preconditioner(ksp_, !again);
  else if (!has_preconditioner_)
    hierarchy_.set_up(ksp_);
  else if (again)
    entirely = hierarchy_.follow(ksp_);
  if (!again) return;
  is_as_new_ = false;
  if (!has_preconditioner_ || has_hierarchy_) is_as_new_for(system_.linearised_law());
  has_preconditioner_ = true;
  changed_since_setup_ = 0;
  iterations_after_setup_ = -1;
  counts_.setups += entirely ? 1 : 0;
  if (factorises_) ++counts_.factorisations;
}

bool LinearSolver::forget_other_steps() {
  starts_step_ = false;
  changed_since_setup_ = last_iterations_ = 0;
  iterations_after_setup_ = -1;
  if (is_set_up_for(system_.mesh().comm, system_.linearised_law())) return false;
  states_of_matrix_.clear();
  if (has_hierarchy_) return true;  // it will follow
  has_preconditioner_ = is_as_new_ = false;
  PC pc = nullptr;
  PetscBool cholesky = PETSC_FALSE;
  POLYSLIP_PETSC(KSPGetPC(ksp_, &pc));
  POLYSLIP_PETSC(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCCHOLESKY, &cholesky));
  if (!cholesky) choose();  // of a Cholesky factorisation nothing stays but its order, which depends on the pattern alone
  return true;
}

void LinearSolver::matrix_changed(const std::vector<ContactState>& states, bool everywhere) {
  const bool is_as_new = starts_step_ && !forget_other_steps();
  set_method();
  const long long changed = take_over(system_.mesh().comm, states, everywhere);
  if (is_as_new) return set_up_preconditioner(false);
  if (!has_preconditioner_ || content_ == MechanicsSystem::MatrixContent::exact) return set_up_preconditioner(true);
  changed_since_setup_ += changed;
  // To a factorisation a changed face is worth about d iterations, to other preconditioners less.
  const bool many = factorises_ ? changed_since_setup_ * system_.layout().dim() > 8 : are_many(changed_since_setup_);
  const bool costly = iterations_after_setup_ >= 0 && last_iterations_ > 1.5 * iterations_after_setup_ + 5;
  set_up_preconditioner(many || costly);
}

PetscErrorCode LinearSolver::solve(Vec f, Vec direction, const assembly::ResidualNorms& norms, double newton_rtol, bool loose,
                                   const IsWorthMore& is_worth_more) {
  PetscFunctionBeginUser;
  const double rtol = loose && !factorises_ ? loose_rtol_ : 0.0, target = enough() * newton_rtol * norms.momentum_scale;
  PetscCallCXX(system_.condense_residual(f, rhs_));
  PetscCall(run(ksp_, f, direction, rtol, target, memory_remedy, is_worth_more));
  PetscFunctionReturn(0);
}

}  // namespace polyslip::solver
