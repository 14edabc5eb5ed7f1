#include "polyslip/solver/direction_solver.hpp"

#include <algorithm>
#include <utility>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/memory.hpp"

namespace polyslip::solver {

using physics::ContactState;

namespace {

/// A test of convergence that stops once at a loose tolerance to ask whether to go on. Solving again from what a loose solve has left would
/// throw away the Krylov space.
class LooseStop {
 public:
  LooseStop(double rtol, const IsWorthMore& is_worth_more) : rtol_(rtol), is_worth_more_(is_worth_more) {}

  [[nodiscard]] bool has_stopped() const { return has_stopped_; }

  PetscErrorCode solve(KSP ksp, Vec rhs, Vec solution) {
    PetscErrorCode (*destroy)(void*) = nullptr;
    PetscFunctionBeginUser;
    PetscCall(KSPGetAndClearConvergenceTest(ksp, &test_, &context_, &destroy));
    PetscCall(KSPSetConvergenceTest(ksp, test, this, nullptr));
    PetscCall(KSPSolve(ksp, rhs, solution));
    PetscCall(KSPSetConvergenceTest(ksp, test_, context_, destroy));
    PetscFunctionReturn(0);
  }

 private:
  static PetscErrorCode test(KSP ksp, PetscInt iteration, PetscReal norm, KSPConvergedReason* reason, void* context) {
    auto* self = static_cast<LooseStop*>(context);
    PetscFunctionBeginUser;
    PetscCall(self->test_(ksp, iteration, norm, reason, self->context_));
    if (iteration == 0) self->loose_norm_ = self->rtol_ * norm;
    if (*reason != KSP_CONVERGED_ITERATING || self->has_asked_ || norm > self->loose_norm_) PetscFunctionReturn(0);
    self->has_asked_ = true;
    Vec solution = nullptr;
    PetscCall(KSPBuildSolution(ksp, nullptr, &solution));
    PetscCallCXX(self->has_stopped_ = !self->is_worth_more_(solution));
    if (self->has_stopped_) *reason = KSP_CONVERGED_RTOL;
    PetscFunctionReturn(0);
  }

  double rtol_, loose_norm_ = 0;
  const IsWorthMore& is_worth_more_;
  bool has_asked_ = false, has_stopped_ = false;
  PetscErrorCode (*test_)(KSP, PetscInt, PetscReal, KSPConvergedReason*, void*) = nullptr;  ///< For the whole solve.
  void* context_ = nullptr;
};

}  // namespace

DirectionSolver::DirectionSolver(const assembly::MechanicsSystem& system, la::Handle<Vec> condensed)
    : rhs_(std::move(condensed)), condensed_system_(system) {
  POLYSLIP_PETSC(VecDuplicate(rhs_, solution_.put()));
}

PetscErrorCode DirectionSolver::run(const la::Handle<KSP>& ksp, Vec f, Vec direction, double rtol, double target, const char* remedy,
                                    const IsWorthMore& is_worth_more) {
  PetscFunctionBeginUser;
  IsWorthMore ask;
  if (is_worth_more)
    ask = [&](Vec solution) {
      condensed_system_.recover(f, solution, direction);
      return is_worth_more(direction);
    };
  PetscCall(run_once(ksp, rtol, target, remedy, ask));
  if (failed_ && is_reused_) {
    PetscCallCXX(set_up_again());
    PetscCall(run_once(ksp, rtol, target, remedy, ask));
  }
  if (!stopped_early_ && iterations_after_setup_ < 0) iterations_after_setup_ = last_iterations_;
  PetscCallCXX(condensed_system_.recover(f, solution_, direction));
  PetscFunctionReturn(0);
}

PetscErrorCode DirectionSolver::run_once(KSP ksp, double rtol, double target, const char* remedy, const IsWorthMore& is_worth_more) {
  PetscReal user_rtol = 0, dtol = 0;
  PetscInt max_it = 0, its = 0;
  KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
  PetscFunctionBeginUser;
  const bool asks = rtol > 0 && is_worth_more;
  LooseStop stop(rtol, is_worth_more);
  KSPNormType measure = KSP_NORM_NONE;
  PetscCall(KSPGetNormType(ksp, &measure));
  PetscCall(KSPGetTolerances(ksp, &user_rtol, nullptr, &dtol, &max_it));
  double whole = user_rtol;
  if (measure == KSP_NORM_PRECONDITIONED || measure == KSP_NORM_NATURAL) {  // not that of residuals: may it fall by as much as these are to
    PetscReal size = 0;
    PetscCall(VecNorm(rhs_, NORM_2, &size));
    whole = std::max(whole, size > 0 ? target / size : 0);
    target = 0;
  }
  PetscCall(KSPSetTolerances(ksp, asks ? whole : std::max(rtol, whole), target, dtol, max_it));
  PetscCall(asks ? stop.solve(ksp, rhs_, solution_) : KSPSolve(ksp, rhs_, solution_));
  stopped_early_ = asks ? stop.has_stopped() : rtol > 0;
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

/// A changed face is a perturbation of rank d.
bool DirectionSolver::are_many(long long changed_faces) const {
  return static_cast<double>(changed_faces * condensed_system_.layout().dim()) > 0.02 * condensed_system_.fracture_faces();
}

void DirectionSolver::is_as_new_for(std::span<const physics::ContactLinearisation> law) {
  is_as_new_ = true;
  law_of_setup_.assign(law.begin(), law.end());
}

bool DirectionSolver::is_set_up_for(MPI_Comm comm, std::span<const physics::ContactLinearisation> law) const {
  const bool here = std::ranges::equal(law, law_of_setup_, &physics::ContactLinearisation::has_derivatives_of);
  return is_as_new_ && !mpi::any(comm, !here);
}

long long DirectionSolver::parted_since(MPI_Comm comm, const std::vector<ContactState>& earlier) const {
  long long parted = 0;
  for (std::size_t f = 0; f < states_of_matrix_.size(); ++f)
    parted += (states_of_matrix_[f] == ContactState::open) != (earlier[f] == ContactState::open) ? 1 : 0;
  return mpi::sum(comm, parted);
}

}  // namespace polyslip::solver
