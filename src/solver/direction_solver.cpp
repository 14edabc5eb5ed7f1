#include "polyslip/solver/direction_solver.hpp"

#include <algorithm>

namespace polyslip::solver {

PetscErrorCode DirectionSolver::count(KSP ksp) {
  KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
  PetscInt its = 0;
  PetscFunctionBeginUser;
  PetscCall(KSPGetConvergedReason(ksp, &reason));
  PetscCall(KSPGetIterationNumber(ksp, &its));
  failed_ = reason < 0 && reason != KSP_DIVERGED_ITS;
  last_iterations_ = static_cast<int>(its);
  counts_.iterations += last_iterations_;
  counts_.max_per_solve = std::max(counts_.max_per_solve, last_iterations_);
  PetscFunctionReturn(0);
}

}  // namespace polyslip::solver
