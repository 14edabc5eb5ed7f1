// Solves one step of flow alone (options prefix pressure_).
//
// Defaults by size and dimension: a sparse Cholesky factorisation (MUMPS) where it is cheapest, else conjugate gradients with
// algebraic multigrid (BoomerAMG). Either is set up again only when the matrix changes: with the apertures or the time step. A step
// ends when no row loses fluid beyond 1e-11 of what flows and is stored, or what the digits of the pressures leave: solves of 1e-8
// are repeated on what is left.
#pragma once

#include <string>

#include "polyslip/assembly/flow_system.hpp"
#include "polyslip/solver/linear_solver.hpp"

namespace polyslip::solver {

struct FlowStep {
  bool converged = true;
  int iterations = 0;
  std::string message;  ///< Why it has not converged, and what may help.
};

class FlowSolver {
 public:
  /// Throws InputError where neither a pressure condition nor storage determines the pressure.
  explicit FlowSolver(assembly::FlowSystem& system);

  /// q = q^n from q^{n-1}, for the loads, apertures and time step that the system has.
  FlowStep step(Vec q);

  /// Sentence for the log: what was chosen and why.
  [[nodiscard]] const std::string& choice() const { return choice_; }
  [[nodiscard]] const LinearCounts& counts() const { return counts_; }
  [[nodiscard]] KSP ksp() const { return ksp_; }

 private:
  void choose();
  void use_matrix();
  void count(FlowStep& step);

  assembly::FlowSystem& system_;
  la::Handle<KSP> ksp_;
  la::Handle<Vec> previous_, residual_, correction_;
  std::string choice_;
  bool factorises_ = false;
  long long set_up_for_ = -1;  ///< Version of the matrix that the preconditioner was set up for.
  LinearCounts counts_;
};

}  // namespace polyslip::solver
