#include "polyslip/solver/direction_solver.hpp"

#include <algorithm>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/memory.hpp"

namespace polyslip::solver {

using physics::ContactState;

PetscErrorCode DirectionSolver::run(const la::Handle<KSP>& ksp, Vec rhs, Vec solution, double rtol, double target, const char* remedy) {
  PetscFunctionBeginUser;
  PetscCall(run_once(ksp, rhs, solution, rtol, target, remedy));
  if (failed_ && is_reused_) {
    PetscCallCXX(set_up_again());
    PetscCall(run_once(ksp, rhs, solution, rtol, target, remedy));
  }
  PetscFunctionReturn(0);
}

PetscErrorCode DirectionSolver::go_on(const la::Handle<KSP>& ksp, Vec rhs, Vec solution, double target, const char* remedy) {
  PetscFunctionBeginUser;
  const int before = last_iterations_;
  PetscCall(KSPSetInitialGuessNonzero(ksp, PETSC_TRUE));
  PetscCall(run(ksp, rhs, solution, 0.0, target, remedy));
  PetscCall(KSPSetInitialGuessNonzero(ksp, PETSC_FALSE));
  last_iterations_ += before;
  counts_.max_per_solve = std::max(counts_.max_per_solve, last_iterations_);
  if (iterations_after_setup_ < 0) iterations_after_setup_ = last_iterations_;
  PetscFunctionReturn(0);
}

PetscErrorCode DirectionSolver::run_once(KSP ksp, Vec rhs, Vec solution, double rtol, double target, const char* remedy) {
  PetscReal user_rtol = 0, dtol = 0;
  PetscInt max_it = 0, its = 0;
  KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
  PetscFunctionBeginUser;
  PetscCall(KSPGetTolerances(ksp, &user_rtol, nullptr, &dtol, &max_it));
  PetscCall(KSPSetTolerances(ksp, std::max(rtol, user_rtol), target, dtol, max_it));
  PetscCall(KSPSolve(ksp, rhs, solution));
  PetscCall(KSPSetTolerances(ksp, user_rtol, target, dtol, max_it));
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  PetscCall(KSPGetIterationNumber(ksp, &its));
  PetscCallCXX(lack_of_memory_ = la::lack_of_memory(ksp, remedy));
  failed_ = reason < 0 && reason != KSP_DIVERGED_ITS;
  last_iterations_ = static_cast<int>(its);
  counts_.iterations += last_iterations_;
  counts_.max_per_solve = std::max(counts_.max_per_solve, last_iterations_);
  PetscFunctionReturn(0);
}

long long DirectionSolver::take_over(MPI_Comm comm, const std::vector<ContactState>& states, bool everywhere) {
  const bool all = everywhere || states_of_matrix_.empty();
  long long changed = 0;
  for (std::size_t f = 0; f < states.size(); ++f) changed += all || states[f] != states_of_matrix_[f] ? 1 : 0;
  states_of_matrix_ = states;
  return mpi::sum(comm, changed);
}

void DirectionSolver::is_as_new_for(std::span<const physics::ContactLinearisation> law) {
  is_as_new_ = true;
  law_of_setup_.assign(law.begin(), law.end());
}

bool DirectionSolver::is_set_up_for(MPI_Comm comm, std::span<const physics::ContactLinearisation> law) const {
  const auto same = [](const auto& a, const auto& b) { return a.state == b.state && a.d_lam == b.d_lam && a.d_jump == b.d_jump; };
  const bool here = std::equal(law.begin(), law.end(), law_of_setup_.begin(), law_of_setup_.end(), same);
  return is_as_new_ && !mpi::any(comm, !here);
}

long long DirectionSolver::parted_since(MPI_Comm comm, const std::vector<ContactState>& earlier) const {
  long long parted = 0;
  for (std::size_t f = 0; f < states_of_matrix_.size(); ++f)
    parted += (states_of_matrix_[f] == ContactState::open) != (earlier[f] == ContactState::open) ? 1 : 0;
  return mpi::sum(comm, parted);
}

}  // namespace polyslip::solver
