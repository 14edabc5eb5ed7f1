// Solves the condensed nodal system of a Newton iteration (options prefix displacement_).
//
// Defaults by size and dimension: a sparse Cholesky factorisation (MUMPS) where it is cheapest, else smoothed aggregation with rigid-body
// modes (GAMG). Both are built on the symmetric matrix of the same contact state with the friction bounds held; where faces slip
// with friction the Krylov method applies the exact unsymmetric operator. -displacement_pc_type lu factorises the exact matrix.
#pragma once

#include <optional>
#include <string>

#include "polyslip/assembly/mechanics_system.hpp"
#include "polyslip/la/hierarchy_update.hpp"

namespace polyslip::solver {

struct LinearCounts {
  int iterations = 0;      ///< Krylov iterations of all solves.
  int max_per_solve = 0;
  int setups = 0;          ///< Preconditioner set-ups; updates of a hierarchy near the fractures do not count.
  int factorisations = 0;  ///< Those that factorise the whole matrix.
};

class LinearSolver {
 public:
  explicit LinearSolver(assembly::MechanicsSystem& system);

  /// What `linearise` must write into the matrix for this solver.
  [[nodiscard]] assembly::MechanicsSystem::MatrixContent content() const { return content_; }
  /// Tells that the matrix has changed; `states` of the owned faces, `everywhere` if it changed on faces that kept their state too. A
  /// multigrid hierarchy is brought up to date near the fractures, or built anew once more than half of the faces have opened or closed
  /// since its aggregates were formed (these glue what an open fracture parts). Other preconditioners are set up again only if the
  /// changed faces are too many for the Krylov method to make up for, or if this has begun to cost iterations.
  void matrix_changed(const std::vector<physics::ContactState>& states, bool everywhere);
  /// direction = J^{-1} f, to `target` [N] in the condensed residual; `loose`: multigrid stops at 1e-3 (-displacement_loose_rtol) of the right-hand side, for
  /// steps after which the active set is likely to change anyway.
  PetscErrorCode solve(Vec f, Vec direction, double target, bool loose);

  /// Sentence for the log: what was chosen and why.
  [[nodiscard]] const std::string& choice() const { return choice_; }
  [[nodiscard]] const LinearCounts& counts() const { return counts_; }
  [[nodiscard]] int last_iterations() const { return last_iterations_; }
  /// Whether the last solve broke down (an inexact one that only ran out of iterations is no failure).
  [[nodiscard]] bool failed() const { return failed_; }
  [[nodiscard]] KSP ksp() const { return ksp_; }

 private:
  void choose();
  void set_method();
  void set_up_preconditioner(bool again);
  [[nodiscard]] PC hierarchy() const;  ///< The preconditioner where it is algebraic multigrid, else null.
  bool update_hierarchy();
  [[nodiscard]] bool aggregates_are_stale() const;
  PetscErrorCode run(double rtol, double target);

  assembly::MechanicsSystem& system_;
  la::Handle<KSP> ksp_;
  la::Handle<Mat> exact_operator_;  ///< Shell: P plus the frictional corrections.
  la::Handle<Vec> rhs_, solution_;
  std::optional<la::HierarchyUpdate> changes_;  ///< Where fractures change a matrix that algebraic multigrid works on.
  assembly::MechanicsSystem::MatrixContent content_ = assembly::MechanicsSystem::MatrixContent::symmetric;
  std::string choice_;
  PetscBool updates_hierarchy_ = PETSC_TRUE;  ///< -displacement_update_hierarchy
  PetscReal loose_rtol_ = 1e-3;  ///< -displacement_loose_rtol
  bool user_ksp_ = false;
  LinearCounts counts_;
  int last_iterations_ = 0;
  bool failed_ = false;
  bool factorises_ = false;
  std::vector<physics::ContactState> states_of_matrix_, states_of_aggregates_;  ///< Of the owned faces.
  long long changed_since_setup_ = 0;
  int iterations_after_setup_ = -1;  ///< Of the first solve with this preconditioner; -1 before it.
  bool has_preconditioner_ = false, is_reused_ = false;
};

}  // namespace polyslip::solver
