// Steps of flow in a rigid rock: the fractures have their contact apertures.
#pragma once

#include "polyslip/solver/flow_solver.hpp"
#include "polyslip/solver/time_stepper.hpp"

namespace polyslip::solver {

class DarcyStep : public StepProblem {
 public:
  /// The accepted state is the initial pressure at time `start`.
  DarcyStep(assembly::FlowSystem& system, FlowSolver& solver, double start);

  StepOutcome attempt(double from, double to, double mark) override;
  void accept() override;
  /// The problem is linear: a failure stands.
  [[nodiscard]] bool can_cut() const override { return false; }

  [[nodiscard]] Vec trial() const { return trial_; }  ///< q = p - p_ref in the order of FlowLayout.
  [[nodiscard]] Vec accepted() const { return accepted_; }
  [[nodiscard]] double seconds() const { return seconds_; }  ///< Spent in the linear solver.

  /// The accepted state, at `time` and reached by a step of `size`, is what the caller has written into accepted().
  void restore(double time, double size);

 private:
  assembly::FlowSystem& system_;
  FlowSolver& solver_;
  la::Handle<Vec> trial_, accepted_;
  double seconds_ = 0;
};

}  // namespace polyslip::solver
