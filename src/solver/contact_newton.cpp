#include "polyslip/solver/contact_newton.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "polyslip/assembly/saddle_matrix.hpp"
#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/la/log_stage.hpp"
#include "polyslip/la/memory.hpp"

namespace polyslip::solver {

using assembly::MechanicsSystem;

namespace {

constexpr double largest_loss = 1e-9;   ///< Of fluid in a step, relative to what moves, unless rtol allows more.
constexpr double nearly_solved = 0.03;  ///< Relative residual of the contact rows.
/// Relative to the scene's beta. Springs leave jumps that know where faces slip; with more of them in z directions of slip settle sooner.
constexpr double beta_after_springs = 3;

bool is_contact_solved(const assembly::ResidualNorms& n, double atol, double rtol) { return n.contact <= std::max(atol, rtol * n.contact_scale); }

bool is_solved(const assembly::ResidualNorms& n, double atol, double rtol) {
  return n.momentum <= std::max({atol, rtol * n.momentum_scale, n.momentum_floor}) && is_contact_solved(n, atol, rtol) && is_balanced(n, rtol);
}

}  // namespace

bool is_balanced(const assembly::ResidualNorms& n, double rtol) {
  return n.flow <= std::max(n.flow_floor, rtol * n.flow_scale) &&
         n.flow_loss <= std::max(n.flow_floor, std::max(10 * rtol, largest_loss) * n.flow_turnover);
}

/// One way to the solution: the size of beta relative to the scene's, a factor on friction reached before the whole of it, and whether
/// springs come first.
struct ContactNewton::Rung {
  double beta_factor;
  double first_friction;
  bool springs;
  const char* remedy;
};

ContactNewton::ContactNewton(MechanicsSystem& system, std::unique_ptr<DirectionSolver> linear)
    : system_(system),
      blocks_(system),
      linear_(std::move(linear)),
      residual_(system.create_vector()),
      start_(system.create_vector()),
      lagged_(system.create_vector()) {
  trace_.system = &system;
  if (!blocks_.blocks().empty()) system.multiply_whole_rows();
  set_up();
}

ContactNewton::~ContactNewton() = default;

const std::string& ContactNewton::linear_choice() const {
  static const std::string saddle = "linear solver: factorisation of the whole saddle-point matrix (MUMPS), as contact.formulation is saddle";
  return linear_ ? linear_->choice() : saddle;
}

LinearCounts ContactNewton::linear_counts() const { return linear_ ? linear_->counts() : saddle_counts_; }

void ContactNewton::set_up() {
  const MPI_Comm comm = system_.mesh().comm;
  POLYSLIP_PETSC(SNESCreate(comm, snes_.put()));
  POLYSLIP_PETSC(SNESSetApplicationContext(snes_, &trace_));
  POLYSLIP_PETSC(SNESSetFunction(snes_, residual_, form_residual, this));
  POLYSLIP_PETSC(SNESSetConvergenceTest(snes_, test_convergence, this, nullptr));
  POLYSLIP_PETSC(SNESSetTolerances(snes_, 0.0, 1e-10, 0.0, 25, PETSC_MAX_INT));
  SNESLineSearch search = nullptr;
  POLYSLIP_PETSC(SNESGetLineSearch(snes_, &search));
  POLYSLIP_PETSC(SNESLineSearchSetType(search, active_set_search));
  if (system_.problem().formulation == physics::Formulation::condensed)
    set_up_condensed();
  else
    set_up_saddle();
  POLYSLIP_PETSC(SNESSetJacobian(snes_, jacobian_, jacobian_, form_jacobian, this));
  POLYSLIP_PETSC(SNESSetFromOptions(snes_));
}

void ContactNewton::set_up_condensed() {
  if (!linear_) linear_ = std::make_unique<LinearSolver>(system_);
  const Index n = system_.size();
  POLYSLIP_PETSC(MatCreateShell(system_.mesh().comm, n, n, PETSC_DETERMINE, PETSC_DETERMINE, this, jacobian_.put()));
  KSP ksp = nullptr;
  PC pc = nullptr;
  POLYSLIP_PETSC(SNESGetKSP(snes_, &ksp));
  POLYSLIP_PETSC(KSPSetType(ksp, KSPPREONLY));
  POLYSLIP_PETSC(KSPGetPC(ksp, &pc));
  POLYSLIP_PETSC(PCSetType(pc, PCSHELL));
  POLYSLIP_PETSC(PCShellSetName(pc, "exact static condensation of bubbles and multipliers"));
  POLYSLIP_PETSC(PCShellSetContext(pc, this));
  POLYSLIP_PETSC(PCShellSetApply(pc, apply_condensation));
}

void ContactNewton::set_up_saddle() {
  jacobian_ = assembly::create_saddle_matrix(system_);
  KSP ksp = nullptr;
  PC pc = nullptr;
  POLYSLIP_PETSC(SNESGetKSP(snes_, &ksp));
  POLYSLIP_PETSC(KSPSetType(ksp, KSPPREONLY));
  POLYSLIP_PETSC(KSPGetPC(ksp, &pc));
  POLYSLIP_PETSC(PCSetType(pc, PCLU));
  POLYSLIP_PETSC(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
}

PetscErrorCode ContactNewton::form_residual(SNES, Vec x, Vec f, void* context) {
  PetscFunctionBeginUser;
  PetscCallCXX(static_cast<ContactNewton*>(context)->system_.residual(x, f));
  PetscFunctionReturn(0);
}

PetscErrorCode ContactNewton::form_jacobian(SNES, Vec x, Mat, Mat matrix, void* context) {
  PetscFunctionBeginUser;
  auto* self = static_cast<ContactNewton*>(context);
  std::optional<la::LogStage> stage(std::in_place, "condense", self->seconds_.condense);
  if (self->linear_) {
    PetscCallCXX(self->system_.linearise(x, self->linear_->content()));
    stage.emplace("solve", self->seconds_.solve);  // which keeps the preconditioner up to date
    PetscCallCXX(self->linear_->matrix_changed(self->system_.states(x), std::exchange(self->law_changed_, false)));
    PetscCall(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
    PetscCall(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
  } else {
    PetscCallCXX(self->system_.linearise(x, MechanicsSystem::MatrixContent::bulk));
    PetscCallCXX(assembly::fill_saddle_matrix(self->system_, matrix));
    ++self->saddle_counts_.setups;
    ++self->saddle_counts_.factorisations;
  }
  PetscFunctionReturn(0);
}

PetscErrorCode ContactNewton::apply_condensation(PC pc, Vec f, Vec direction) {
  PetscFunctionBeginUser;
  ContactNewton* self = nullptr;
  PetscCall(PCShellGetContext(pc, &self));
  const la::LogStage stage("solve", self->seconds_.solve);
  PetscReal rtol = 0;
  PetscInt iteration = 0, max_it = 0;
  PetscCall(SNESGetTolerances(self->snes_, nullptr, &rtol, nullptr, &max_it, nullptr));
  PetscCall(SNESGetIterationNumber(self->snes_, &iteration));
  const double faces = self->system_.fracture_faces();
  // Only a step that leaves the active set as it is need be exact: where one can go on, try a loose one first. A single step ends in
  // another law, and needs no accuracy.
  const double few = self->linear_->stops_early() ? 0 : 0.01 * faces;
  const bool loose = faces > 0 && (iteration == 0 || static_cast<double>(self->trace_.changed) > few);
  const double accuracy = std::max(rtol, self->worth_solving());
  IsWorthMore keeps_active_set;
  if (max_it > 1 && self->linear_->stops_early()) keeps_active_set = [self](Vec ahead) { return !self->moves_active_set(ahead); };
  PetscCall(self->linear_->solve(f, direction, self->norms_, accuracy, loose, keeps_active_set));
  PetscCall(PCSetFailedReason(pc, self->linear_->failed() ? PC_SUBPC_ERROR : PC_NOERROR));  // SNES then ends with a failed linear solve
  PetscFunctionReturn(0);
}

/// Relative residual below which a step on a settled active set gains nothing. Slip with friction turns in 3D, and the law bends with it:
/// a step leaves some hundred times the square of what there was. Elsewhere it is linear once the active set is right, and the step is the
/// last one.
double ContactNewton::worth_solving() const {
  const bool bends = system_.layout().dim() == 3 && !system_.is_symmetric() && norms_.contact_scale > 0;
  const double imbalance = norms_.momentum_scale > 0 ? norms_.momentum / norms_.momentum_scale : 0;
  if (!bends) return 0;
  const double left = std::max(norms_.contact / norms_.contact_scale, imbalance);
  return left * std::min(1e-2, 100 * left);
}

bool ContactNewton::moves_active_set(Vec direction) const {
  Vec x = nullptr;
  la::Handle<Vec> ahead;
  POLYSLIP_PETSC(SNESGetSolution(snes_, &x));
  POLYSLIP_PETSC(VecDuplicate(x, ahead.put()));
  POLYSLIP_PETSC(VecWAXPY(ahead, -1.0, direction, x));
  return mpi::any(system_.mesh().comm, system_.states(ahead) != trace_.states);
}

PetscErrorCode ContactNewton::test_convergence(SNES snes, PetscInt iteration, PetscReal, PetscReal, PetscReal, SNESConvergedReason* reason,
                                               void* context) {
  PetscFunctionBeginUser;
  auto* self = static_cast<ContactNewton*>(context);
  Vec x = nullptr, f = nullptr;
  PetscReal atol = 0, rtol = 0;
  PetscInt max_it = 0;
  PetscCall(SNESGetSolution(snes, &x));
  PetscCall(SNESGetFunction(snes, &f, nullptr, nullptr));
  PetscCall(SNESGetTolerances(snes, &atol, &rtol, nullptr, &max_it, nullptr));
  if (iteration == 0) {
    PetscCallCXX(self->trace_.start(x));
    self->eliminated_imbalance_ = self->may_eliminate_ ? INFINITY : 0;
  }
  if (iteration == 0) self->largest_flow_floor_ = INFINITY;
  PetscCallCXX(self->measure(x, f));
  const assembly::ResidualNorms& n = self->norms_;
  if (iteration == 0 && n.flow > 10 * n.flow_floor) self->largest_flow_floor_ = 0.1 * n.flow;
  // The line search has only taken alpha J y off the linear rows. Behind a step that was much larger than x (of a pressure that a closed
  // fracture left undetermined, say) nothing but round-off is left of these differences: look at x itself before it is called a solution.
  if (iteration > 0 && is_solved(n, atol, rtol) && self->system_.is_linear_off_contact()) {
    PetscCall(SNESComputeFunction(snes, x, f));
    PetscCallCXX(self->measure(x, f));
  }
  self->window_steps_ = 0;
  if (iteration > 0 && max_it > 1 && !is_contact_solved(n, atol, rtol)) PetscCallCXX(self->eliminate(x, f));
  // Contact rows that are nearer to zero than the momentum rows by far tell nothing: a loose solve may leave them so, and the step that
  // balances momentum may well raise them.
  const double imbalance = n.momentum_scale > 0 ? 10 * n.momentum / n.momentum_scale : 0;
  self->trace_.settled_merit = std::pow(std::max(rtol, imbalance) * n.contact_scale, 2);
  PetscCallCXX(self->record(static_cast<int>(iteration), n));
  *reason = SNES_CONVERGED_ITERATING;
  if (!std::isfinite(n.momentum) || !std::isfinite(n.contact) || !std::isfinite(n.flow)) {
    *reason = SNES_DIVERGED_FNORM_NAN;
  } else if (iteration > 0 && self->linear_ && self->linear_->failed()) {
    *reason = SNES_DIVERGED_LINEAR_SOLVE;
  } else if (is_solved(n, atol, rtol)) {
    *reason = SNES_CONVERGED_FNORM_RELATIVE;
  } else if (self->stopped_ = self->stop_requested(); self->stopped_) {
    *reason = SNES_DIVERGED_INNER;
  } else if (self->trace_.cycle || self->is_unsettled(static_cast<int>(iteration))) {
    *reason = SNES_DIVERGED_LINE_SEARCH;
  } else if (iteration >= max_it) {
    *reason = SNES_DIVERGED_MAX_IT;
  }
  PetscFunctionReturn(0);
}

/// Pressures that have run away leave few digits of flow rows. That is no excuse where the iterations began with pressures that told what
/// there is to move: most of it must be accounted for.
void ContactNewton::measure(Vec x, Vec f) {
  norms_ = system_.norms(x, f);
  norms_.flow_floor = std::min(norms_.flow_floor, largest_flow_floor_);
}

/// Solves what a few faces leave of the contact law before the whole system is solved again. Not before the first step, which balances
/// momentum; nor once that leaves more of the momentum rows than it did before, nor among the later remedies: windows and the whole may
/// disagree about an active set for ever.
void ContactNewton::eliminate(Vec x, Vec f) {
  if (eliminated_imbalance_ == 0 || system_.fracture_faces() == 0 || !linear_ || linear_->failed()) return;
  if (!elimination_) elimination_.emplace(system_);
  const la::LogStage stage("eliminate", seconds_.solve);
  const bool is_better = elimination_->improve(x, f, linear_->displacement_preconditioner());
  window_steps_ = elimination_->steps();
  if (!is_better) return;
  trace_.adjust(x);
  measure(x, f);
  eliminated_imbalance_ = norms_.momentum < eliminated_imbalance_ ? norms_.momentum : 0;
}

/// Many faces open or close in the first step, or change at all in the second: springs get there sooner than one layer of faces a step.
/// Not where the contact rows are nearly solved, as the last spring leaves about as much of them; nor where nearly all faces have come to
/// the same state.
bool ContactNewton::is_unsettled(int iteration) {
  if (norms_.contact < nearly_solved * norms_.contact_scale) return unsettled_ = false;
  const auto many = [&](long long faces, double share) {
    return static_cast<double>(faces) > std::max(16.0, share * system_.fracture_faces());
  };
  const auto& faces = trace_.counts.faces;
  const long long others = system_.fracture_faces() - *std::max_element(faces.begin(), faces.end());
  const bool moves = iteration == 1 ? many(trace_.opened_or_closed, 0.05) && many(others, 0.05) : iteration == 2 && many(trace_.changed, 0.1);
  return unsettled_ = may_soften_ && moves;
}

void ContactNewton::record(int iteration, const assembly::ResidualNorms& n) {
  if (!monitor) return;
  const auto relative = [](double value, double scale) { return scale > 0 ? value / scale : value; };
  monitor({iteration, relative(n.momentum, n.momentum_scale), relative(n.contact, n.contact_scale),
           trace_.counts, trace_.changed, trace_.step_length, linear_ && iteration > 0 ? linear_->last_iterations() : 0, window_steps_, remedy_});
}

std::string ContactNewton::why(SNESConvergedReason reason) const {
  if (stopped_) return "stopped on request";
  if (trace_.cycle) return "the active set cycles";
  if (reason == SNES_DIVERGED_FNORM_NAN) return "the residual is not finite; a block may be free to move: hold it by displacements";
  if (linear_ && linear_->failed())
    return "the linear solver failed; a block may be free to move, or try -displacement_pc_type lu";
  return "no convergence; -snes_max_it allows more iterations";
}

/// An exception must not pass through PETSc's frames: the solvers leave word.
void ContactNewton::refuse_lack_of_memory() const {
  KSP ksp = nullptr;
  POLYSLIP_PETSC(SNESGetKSP(snes_, &ksp));
  const std::string lack = linear_ ? linear_->lack_of_memory() : la::lack_of_memory(ksp, "contact.formulation: condensed");
  if (!lack.empty()) throw ResourceError(lack);
}

bool ContactNewton::run(Vec x, const std::string& remedy, NewtonResult& result) {
  if (stopped_) return false;
  remedy_ = remedy;
  POLYSLIP_PETSC(SNESSolve(snes_, nullptr, x));
  refuse_lack_of_memory();
  SNESConvergedReason reason = SNES_CONVERGED_ITERATING;
  PetscInt iterations = 0;
  POLYSLIP_PETSC(SNESGetConvergedReason(snes_, &reason));
  POLYSLIP_PETSC(SNESGetIterationNumber(snes_, &iterations));
  result.iterations += static_cast<int>(iterations);
  result.converged = reason > 0;
  if (!result.converged) {
    const std::string flickering = trace_.flickering();
    result.message = fmt::format("Newton stopped after {} iterations ({}): {}; relative residuals momentum {:.2e}, contact {:.2e}, flow {:.2e}{}{}", iterations,
                                 SNESConvergedReasons[reason], why(reason),
                                 norms_.momentum / norms_.momentum_scale, norms_.contact / norms_.contact_scale,
                                 std::max(norms_.flow / norms_.flow_scale, norms_.flow_loss / norms_.flow_turnover),
                                 flickering.empty() ? "" : "; ", flickering);
  }
  return result.converged;
}

void ContactNewton::approach_by_springs(Vec x, NewtonResult& result) {
  // Stiffer and stiffer springs, one Newton step each: the front of the active set moves h/(scale) at a time instead of one face.
  PetscReal atol = 0, rtol = 0, stol = 0;
  PetscInt max_it = 0, max_f = 0;
  POLYSLIP_PETSC(SNESGetTolerances(snes_, &atol, &rtol, &stol, &max_it, &max_f));
  POLYSLIP_PETSC(SNESSetTolerances(snes_, atol, rtol, stol, 1, max_f));
  system_.use_springs(true);
  for (double scale : {0.25, 1.2, 6.0}) {
    system_.set_beta_scale(scale);
    law_changed_ = true;  // springs of another stiffness change the matrix on every face, and so does the law after them
    run(x, fmt::format("springs of {:g} (2 mu + lambda)/h first", scale), result);
  }
  system_.use_springs(false);
  law_changed_ = true;
  POLYSLIP_PETSC(SNESSetTolerances(snes_, atol, rtol, stol, max_it, max_f));
}

bool ContactNewton::climb(Vec x, const Rung& rung, NewtonResult& result) {
  if (rung.springs) approach_by_springs(x, result);
  system_.set_beta_scale(rung.beta_factor * system_.problem().beta_scale);
  bool converged = true;
  for (double factor = rung.first_friction; converged; factor = std::min(1.0, 2 * factor)) {
    system_.set_friction_factor(factor);
    converged = run(x, factor < 1 ? fmt::format("{}, friction times {:g}", rung.remedy, factor) : rung.remedy, result);
    if (factor >= 1) break;
  }
  system_.set_friction_factor(1);
  system_.set_beta_scale(system_.problem().beta_scale);
  return converged;
}

bool ContactNewton::try_lagged_friction(Vec x, NewtonResult& result) {
  // A sequence of convex Tresca problems with an under-relaxed bound; now and then Coulomb's law from where it has come.
  constexpr int most = 60, between = 15;
  double weight = 1, last = 0;
  bool converged = false;
  for (int k = 0; k < most && !converged; ++k) {
    const double change = system_.update_lagged_friction(x, weight);
    system_.use_lagged_friction(true);
    if (k > 0) weight = change > 0.9 * last ? std::max(0.05, weight / 2) : std::min(weight, 0.5);
    last = change;
    run(x, fmt::format("friction bound lagged, change {:.1e}", change), result);
    const bool settled = k > 0 && change < 1e-3;
    if (!settled && (k + 1) % between != 0) continue;
    POLYSLIP_PETSC(VecCopy(x, lagged_));
    system_.use_lagged_friction(false);
    converged = run(x, "Coulomb's law after a lagged bound", result);
    if (!converged) POLYSLIP_PETSC(VecCopy(lagged_, x));
    if (settled) break;
  }
  system_.use_lagged_friction(false);
  return converged;
}

/// No step may depend on what was linearised and factorised before it (DirectionSolver::start_step).
void ContactNewton::start_step() {
  system_.forget_linearisation();
  if (linear_) return linear_->start_step();
  KSP ksp = nullptr;
  POLYSLIP_PETSC(SNESGetKSP(snes_, &ksp));
  POLYSLIP_PETSC(KSPReset(ksp));
}

/// Sliding or opening all round, a block has no place of its own: the linear systems are singular, and round-off says where it goes.
void ContactNewton::refuse_free_motion(Vec x, NewtonResult& result) const {
  constexpr const char* remedy =
      "Contact alone holds it: prescribe a displacement of it in mechanics.boundary, load it less, or raise contact.friction";
  if (!result.converged) {
    result.message = fmt::format("Perhaps {} moves freely. {}. {}", assembly::FloatingBlocks::text(blocks_.blocks().front()), remedy, result.message);
    return;
  }
  const std::optional<std::string> motion = blocks_.free_motion(system_.states(x));
  if (!motion) return;
  result.converged = false;
  result.message = fmt::format("The solution is not unique: {}, as its faces slip or open. {}", *motion, remedy);
  POLYSLIP_PETSC(VecCopy(start_, x));
}

NewtonResult ContactNewton::solve(Vec x) {
  NewtonResult result = solve_by_remedies(x);
  if (!blocks_.blocks().empty() && !stopped_) refuse_free_motion(x, result);
  return result;
}

NewtonResult ContactNewton::solve_by_remedies(Vec x) {
  NewtonResult result;
  stopped_ = law_changed_ = false;
  start_step();
  system_.impose_dirichlet(x);
  POLYSLIP_PETSC(VecCopy(x, start_));
  may_soften_ = may_eliminate_ = true;
  bool converged = climb(x, {1, 1, false, ""}, result);
  may_soften_ = false;
  if (!converged && unsettled_) {
    POLYSLIP_PETSC(VecCopy(start_, x));  // what the first iterations have slipped, perhaps backwards, misleads the springs
    converged = climb(x, {beta_after_springs, 1, true, ""}, result);
  }
  if (converged || system_.fracture_faces() == 0) return result;  // a linear problem has no remedy here
  may_eliminate_ = false;
  static constexpr Rung ladder[] = {{0.3, 1, true, "springs first"},
                                    {0.1, 1, false, "another beta"},
                                    {10, 1, false, "another beta"},
                                    {0.3, 0.25, false, "continuation in friction"}};
  for (const Rung& rung : ladder) {
    POLYSLIP_PETSC(VecCopy(start_, x));
    if (climb(x, rung, result)) return result;
  }
  POLYSLIP_PETSC(VecCopy(start_, x));
  if (try_lagged_friction(x, result)) return result;
  POLYSLIP_PETSC(VecCopy(start_, x));
  return result;
}

}  // namespace polyslip::solver
