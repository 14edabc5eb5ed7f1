// Solves the condensed nodal system of a Newton iteration (options prefix displacement_).
//
// Defaults by size and dimension: a sparse Cholesky factorisation (MUMPS) where it is cheapest, else smoothed aggregation with rigid-body
// modes (GAMG). Both are built on the symmetric matrix of the same contact state with the friction bounds held; where faces slip
// with friction the Krylov method applies the exact unsymmetric operator. -displacement_pc_type lu factorises the exact matrix.
#pragma once

#include <string>

#include "polyslip/solver/direction_solver.hpp"
#include "polyslip/solver/displacement_multigrid.hpp"

namespace polyslip::solver {

class LinearSolver final : public DirectionSolver {
 public:
  explicit LinearSolver(assembly::MechanicsSystem& system);

  [[nodiscard]] assembly::MechanicsSystem::MatrixContent content() const override { return content_; }
  void start_step() override { starts_step_ = true; }
  /// A preconditioner is set up again only if the changed faces are too many for the Krylov method to make up for, or if this has begun to cost
  /// iterations. A multigrid hierarchy is formed once; then it is brought up to date near the fractures.
  void matrix_changed(const std::vector<physics::ContactState>& states, bool everywhere) override;
  /// `loose`: multigrid stops at 1e-2 (-displacement_loose_rtol) of the right-hand side.
  PetscErrorCode solve(Vec f, Vec direction, const assembly::ResidualNorms& norms, double rtol, bool loose,
                       const IsWorthMore& is_worth_more) override;
  [[nodiscard]] bool stops_early() const override { return !factorises_; }
  [[nodiscard]] const std::string& choice() const override { return choice_; }
  [[nodiscard]] KSP ksp() const { return ksp_; }

 private:
  void set_up_again() override { set_up_preconditioner(true); }
  void choose();
  void set_method();
  void set_up_preconditioner(bool again);
  bool forget_other_steps();  ///< False where the preconditioner is what a new solver would make.

  assembly::MechanicsSystem& system_;
  la::Handle<KSP> ksp_;
  la::Handle<Mat> exact_operator_;  ///< Shell: A and the exact blocks of + cells.
  DisplacementHierarchy hierarchy_;
  assembly::MechanicsSystem::MatrixContent content_ = assembly::MechanicsSystem::MatrixContent::symmetric;
  std::string choice_;
  PetscReal loose_rtol_ = 1e-2;  ///< -displacement_loose_rtol
  bool user_ksp_ = false;
  bool factorises_ = false, has_hierarchy_ = false;
  bool starts_step_ = false;
  long long changed_since_setup_ = 0;
  bool has_preconditioner_ = false;
};

}  // namespace polyslip::solver
