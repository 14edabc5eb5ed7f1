// Solves the condensed system of displacement and pressure of a Newton iteration (options prefix coupled_).
//
// Defaults by size, and by whether fractures change the matrix from one iteration to the next:
//  * an LU factorisation of the exact matrix (MUMPS) with a few GMRES iterations on top, kept as long as these are few
//    (flexible GMRES, which saves an application an iteration), or the matrix stays;
//  * else GMRES with a block triangular preconditioner, PCFIELDSPLIT (Schur, upper):
//       [ P_u  A_up ] [u]   [r_u]      S_fs = S' + diag( b^2 |K|/K_dr  on cells,  |sigma| l/(2 mu + lambda) on open fracture faces ),
//       [      S_fs ] [p] = [r_p]      K_dr = lambda + 2 mu/d,   l^2 = h_K times the length of the fracture
//    (fixed stress), one multigrid cycle for each block: coupled_fieldsplit_displacement_ (GAMG with rigid-body modes, on the matrix with the
//    friction bounds held) and coupled_fieldsplit_pressure_ (BoomerAMG, cells condensed out), whose matrix is kept while few faces open or
//    close.
// -coupled_pc_type lu or fieldsplit chooses.
#pragma once

#include <array>

#include "polyslip/assembly/coupled_system.hpp"
#include "polyslip/solver/direction_solver.hpp"
#include "polyslip/solver/displacement_multigrid.hpp"

namespace polyslip::solver {

class CoupledSolver final : public DirectionSolver {
 public:
  explicit CoupledSolver(assembly::CoupledSystem& system);

  [[nodiscard]] assembly::MechanicsSystem::MatrixContent content() const override { return content_; }
  /// A factorisation is made anew in each step unless its matrix is still that; multigrid follows where faces change their states.
  void start_step() override { starts_step_ = true; }
  void matrix_changed(const std::vector<physics::ContactState>& states, bool everywhere) override;
  PetscErrorCode solve(Vec f, Vec direction, const assembly::ResidualNorms& norms, double rtol, bool loose,
                       const IsWorthMore& is_worth_more) override;
  [[nodiscard]] bool stops_early() const override { return !factorises_; }
  [[nodiscard]] PC displacement_preconditioner() const override;
  [[nodiscard]] const std::string& choice() const override { return choice_; }
  [[nodiscard]] KSP ksp() const { return ksp_; }

 private:
  void set_up_again() override { set_up(true, true); }
  void choose();
  void split_fields(PC pc);
  /// For the matrix at hand: `again` from the start, else what follows it; of displacement only if that has `moved`.
  void set_up(bool again, bool moved);
  void set_up_direct(bool again);
  void set_up_blocks(bool again, bool moved);
  /// The solvers of displacement and of pressure within the preconditioner that is set up.
  [[nodiscard]] std::array<KSP, 2> blocks() const;
  void forget_other_steps();
  /// Whether a factorisation is that of the matrix at hand: by the law of contact and the matrix of flow. Where fractures conduct, their
  /// apertures enter too, and change.
  [[nodiscard]] bool is_factorised() const;
  void write_fixed_stress();
  [[nodiscard]] bool fixed_stress_is_stale() const;
  /// Residual at which a solve may end.
  [[nodiscard]] double target(const assembly::ResidualNorms& norms, double newton_rtol) const;

  assembly::CoupledSystem& system_;
  la::Handle<KSP> ksp_;
  la::Handle<Mat> exact_operator_;  ///< Shell: the nest plus the frictional corrections.
  la::Handle<Mat> assembled_;       ///< The nest as one AIJ matrix, where a factorisation needs it.
  la::Handle<Mat> fixed_stress_;    ///< S_fs
  la::Handle<Vec> compressibility_; ///< The diagonal that fixed stress adds, on the owned flow unknowns; open fracture faces apart.
  DisplacementHierarchy hierarchy_;
  assembly::MechanicsSystem::MatrixContent content_ = assembly::MechanicsSystem::MatrixContent::symmetric;
  std::string choice_;
  PetscReal loose_rtol_ = 0;  ///< -coupled_loose_rtol: of multigrid and of an old factorisation
  bool factorises_ = false, has_preconditioner_ = false, starts_step_ = false;
  std::vector<physics::ContactState> states_of_fixed_stress_;  ///< Of the owned faces.
  long long changed_since_setup_ = 0, flow_of_setup_ = -1;  ///< The latter is a CoupledSystem::flow_matrix_version.
};

}  // namespace polyslip::solver
