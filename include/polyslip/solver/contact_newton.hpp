// One load step: semi-smooth Newton by PETSc SNES, with a ladder of remedies where it fails (scheme.md section 8).
//
// SNES iterates on all unknowns (nodal, bubbles, multipliers). Condensed formulation: its preconditioner is the exact static condensation,
// that is, condense the residual, solve the nodal system (LinearSolver), recover bubbles and multipliers. Saddle formulation: the
// whole Jacobian is assembled and factorised (options without prefix: -ksp_type, -pc_type).
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "polyslip/assembly/floating_blocks.hpp"
#include "polyslip/assembly/mechanics_system.hpp"
#include "polyslip/solver/active_set_search.hpp"
#include "polyslip/solver/linear_solver.hpp"
#include "polyslip/solver/nonlinear_elimination.hpp"

namespace polyslip::solver {

/// One Newton iteration, for log and newton.csv.
struct NewtonRecord {
  int iteration = 0;          ///< 0: the start
  double momentum = 0;        ///< Relative to loads and contact forces.
  double contact = 0;         ///< Relative to contact forces.
  assembly::StateCounts counts;
  long long changed = 0;
  double step_length = 1;
  int krylov = 0;
  int window_steps = 0;       ///< Of nonlinear elimination, after this iteration.
  std::string remedy;         ///< Rung of the ladder, empty on the first.
};

struct NewtonResult {
  bool converged = false;
  int iterations = 0;  ///< Of all rungs.
  std::string message;  ///< Why not, and what may help.
};

/// Seconds spent, for the summary.
struct NewtonSeconds {
  double condense = 0, solve = 0;
};

/// Whether the fluid balances to rtol, or as far as round-off lets it: row by row in the 2-norm; and all rows together, which may lose a
/// billionth of the volumes that move (more if rtol is above 1e-10). Rows at the floor of round-off may lose much more than that: in open
/// fractures of a million unknowns 1e-7 of a step.
[[nodiscard]] bool is_balanced(const assembly::ResidualNorms& n, double rtol);

class ContactNewton {
 public:
  /// With the linear solver of the condensed formulation where a system needs another than LinearSolver.
  explicit ContactNewton(assembly::MechanicsSystem& system, std::unique_ptr<DirectionSolver> linear = nullptr);
  ~ContactNewton();

  /// Solves for the loads of the system, from x and into x; x is as it was where no remedy helps. A state that leaves a block free to
  /// move is no solution, whatever its residual.
  NewtonResult solve(Vec x);

  std::function<void(const NewtonRecord&)> monitor;
  /// Asked at every iteration, on all ranks alike: where it is true the solve ends there, without a remedy.
  std::function<bool()> stop_requested = [] { return false; };

  [[nodiscard]] LinearCounts linear_counts() const;
  [[nodiscard]] long long cycles() const { return trace_.cycles; }
  [[nodiscard]] const std::string& linear_choice() const;
  [[nodiscard]] const NewtonSeconds& seconds() const { return seconds_; }
  [[nodiscard]] SNES snes() const { return snes_; }
  [[nodiscard]] const assembly::FloatingBlocks& floating_blocks() const { return blocks_; }

 private:
  struct Rung;
  NewtonResult solve_by_remedies(Vec x);
  void refuse_free_motion(Vec x, NewtonResult& result) const;
  void set_up();
  void set_up_condensed();
  void set_up_saddle();
  void start_step();
  bool run(Vec x, const std::string& remedy, NewtonResult& result);
  bool climb(Vec x, const Rung& rung, NewtonResult& result);
  void approach_by_springs(Vec x, NewtonResult& result);
  bool try_lagged_friction(Vec x, NewtonResult& result);
  bool is_unsettled(int iteration);
  void measure(Vec x, Vec f);
  void eliminate(Vec x, Vec f);
  [[nodiscard]] double worth_solving() const;
  [[nodiscard]] bool moves_active_set(Vec direction) const;  ///< The whole step does, from where Newton stands.
  [[nodiscard]] std::string why(SNESConvergedReason reason) const;
  void refuse_lack_of_memory() const;
  void record(int iteration, const assembly::ResidualNorms& norms);

  static PetscErrorCode form_residual(SNES, Vec, Vec, void*);
  static PetscErrorCode form_jacobian(SNES, Vec, Mat, Mat, void*);
  static PetscErrorCode apply_condensation(PC, Vec, Vec);
  static PetscErrorCode test_convergence(SNES, PetscInt, PetscReal, PetscReal, PetscReal, SNESConvergedReason*, void*);

  assembly::MechanicsSystem& system_;
  assembly::FloatingBlocks blocks_;
  ActiveSetTrace trace_;
  std::unique_ptr<DirectionSolver> linear_;  ///< Condensed formulation only.
  std::optional<NonlinearElimination> elimination_;
  la::Handle<SNES> snes_;
  la::Handle<Mat> jacobian_;  ///< Shell (condensed) or assembled (saddle).
  la::Handle<Vec> residual_, start_, lagged_;
  bool law_changed_ = true;  ///< On faces that keep their state too, since the matrix was written last.
  std::string remedy_;
  bool may_soften_ = false, may_eliminate_ = false, unsettled_ = false, stopped_ = false;
  double eliminated_imbalance_ = 0;  ///< Momentum rows after the last elimination of a run; 0: no more of them [N].
  int window_steps_ = 0;             ///< Of elimination, after the iteration at hand.
  assembly::ResidualNorms norms_;
  double largest_flow_floor_ = 0;  ///< What round-off may excuse of flow.
  NewtonSeconds seconds_;
  LinearCounts saddle_counts_;
};

}  // namespace polyslip::solver
