// What a Newton iteration on a condensed system asks of its linear solver.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "polyslip/assembly/mechanics_system.hpp"

namespace polyslip::solver {

struct LinearCounts {
  int iterations = 0;      ///< Krylov iterations of all solves.
  int max_per_solve = 0;
  int setups = 0;          ///< Preconditioner set-ups; updates of a hierarchy near the fractures do not count.
  int factorisations = 0;  ///< Those that factorise the whole matrix.
};

/// Asked of an approximate direction, on all ranks alike: whether it is worth solving for more of it.
using IsWorthMore = std::function<bool(Vec direction)>;

class DirectionSolver {
 public:
  DirectionSolver(const assembly::MechanicsSystem& system, la::Handle<Vec> condensed);
  virtual ~DirectionSolver() = default;

  /// What `linearise` must write into the matrix for this solver.
  [[nodiscard]] virtual assembly::MechanicsSystem::MatrixContent content() const = 0;
  /// Tells that the next matrix is the first of a step. What was learnt before is forgotten, unless a new solver would come to the same: a
  /// step depends on the state that it starts from alone, so that a run taken up again goes on bit by bit.
  virtual void start_step() {}
  /// Tells that the matrix has changed; `states` of the owned faces, `everywhere` if it changed on faces that kept their state too.
  virtual void matrix_changed(const std::vector<physics::ContactState>& states, bool everywhere) = 0;
  /// direction = J^{-1} f, to what `norms` at a relative tolerance rtol ask for; `loose`: not so far, for steps after which the active set
  /// is likely to change anyway. There the Krylov method asks, if `is_worth_more` is given, whether to go on to the end.
  virtual PetscErrorCode solve(Vec f, Vec direction, const assembly::ResidualNorms& norms, double rtol, bool loose,
                               const IsWorthMore& is_worth_more) = 0;
  /// Whether a loose solve stops early each time: with multigrid. A factorisation does so only while it is older than the matrix.
  [[nodiscard]] virtual bool stops_early() const = 0;

  /// What preconditions the displacements next to other unknowns, set up for the last matrix; null where nothing does so apart.
  [[nodiscard]] virtual PC displacement_preconditioner() const { return nullptr; }

  /// Sentence for the log: what was chosen and why.
  [[nodiscard]] virtual const std::string& choice() const = 0;
  [[nodiscard]] const LinearCounts& counts() const { return counts_; }
  [[nodiscard]] int last_iterations() const { return last_iterations_; }
  /// Whether the last solve broke down (an inexact one that only ran out of iterations is no failure).
  [[nodiscard]] bool failed() const { return failed_; }
  /// A sentence if it did so for lack of memory.
  [[nodiscard]] const std::string& lack_of_memory() const { return lack_of_memory_; }

 protected:
  /// A solve may end at this part of what Newton's method accepts, as scales change and the law bends. With fractures a tenth takes a
  /// twentieth more Krylov iterations, the half at times a Newton iteration more; without them one solve is to do, though the scale of what
  /// moves may fall to a fifteenth with it.
  [[nodiscard]] double enough() const { return condensed_system_.fracture_faces() > 0 ? 0.3 : 0.05; }

  /// Solves for rhs_, the condensed f, until the residual is below `target` or below the larger of rtol and the user's relative tolerance,
  /// and books that; with another preconditioner where an old one fails, which may come with another KSP. `remedy` is what needs less memory.
  /// If it is given, `is_worth_more` is asked of the direction at rtol: if so the same Krylov method goes on as if rtol were zero.
  PetscErrorCode run(const la::Handle<KSP>& ksp, Vec f, Vec direction, double rtol, double target, const char* remedy,
                     const IsWorthMore& is_worth_more);
  /// Sets the preconditioner up for the matrix as it is.
  virtual void set_up_again() = 0;
  /// Takes over the states of the owned faces; returns how many faces, over all ranks, have changed with that: all where there were none
  /// before, or if the matrix changed `everywhere`.
  long long take_over(MPI_Comm comm, const std::vector<physics::ContactState>& states, bool everywhere);
  /// Whether so many faces have changed that a preconditioner that is no factorisation had better be brought up to date.
  [[nodiscard]] bool are_many(long long changed_faces) const;
  /// Takes down that the preconditioner has been set up for the contact law at hand as a new solver would do it.
  void is_as_new_for(std::span<const physics::ContactLinearisation> law);
  /// Whether it is what a new solver would make for this law.
  [[nodiscard]] bool is_set_up_for(MPI_Comm comm, std::span<const physics::ContactLinearisation> law) const;
  /// Faces, over all ranks, that have opened or closed since they were in the states `earlier`.
  [[nodiscard]] long long parted_since(MPI_Comm comm, const std::vector<physics::ContactState>& earlier) const;

  la::Handle<Vec> rhs_;                                  ///< Condensed.
  std::vector<physics::ContactState> states_of_matrix_;  ///< Of the owned faces.
  LinearCounts counts_;
  int last_iterations_ = 0;
  int iterations_after_setup_ = -1;  ///< Of the first full solve with this preconditioner; -1 before it.
  bool failed_ = false, is_reused_ = false;  ///< The latter: the preconditioner is older than the matrix.
  bool is_as_new_ = false;                   ///< Whether the preconditioner is what a new solver makes for law_of_setup_.
  std::string lack_of_memory_;

 private:
  const assembly::MechanicsSystem& condensed_system_;
  la::Handle<Vec> solution_;
  bool stopped_early_ = false;                               ///< The last solve, at its rtol.
  std::vector<physics::ContactLinearisation> law_of_setup_;  ///< Of the local faces; where is_as_new_.

  PetscErrorCode run_once(KSP ksp, double rtol, double target, const char* remedy, const IsWorthMore& is_worth_more);
};

}  // namespace polyslip::solver
