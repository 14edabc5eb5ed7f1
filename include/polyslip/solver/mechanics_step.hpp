// Steps of rock alone: each solves the contact problem at its end, friction measured from the last accepted state.
#pragma once

#include "polyslip/solver/contact_newton.hpp"
#include "polyslip/solver/time_stepper.hpp"

namespace polyslip::solver {

class MechanicsStep : public StepProblem {
 public:
  /// The accepted state is zero displacement without loads.
  MechanicsStep(assembly::MechanicsSystem& system, ContactNewton& newton);

  StepOutcome attempt(double from, double to, double mark) override;
  void accept() override;
  /// Without fractures the problem is linear: a failure stands.
  [[nodiscard]] bool can_cut() const override { return system_.fracture_faces() > 0; }

  [[nodiscard]] Vec trial() const { return trial_; }
  [[nodiscard]] Vec accepted() const { return accepted_; }

  /// The part of the loads that the accepted state bears, where these do not depend on time: grows from 0 to 1 over the scene's
  /// first step.
  [[nodiscard]] double load_fraction() const { return fraction_; }
  /// The accepted state, at `time` under that part of the loads, is what the caller has written into accepted(), and the previous
  /// jumps are what the caller has given to the system.
  void restore(double time, double load_fraction);

 private:
  [[nodiscard]] assembly::Loads loads_at(double time, double fraction) const;

  assembly::MechanicsSystem& system_;
  ContactNewton& newton_;
  bool loads_vary_;
  double fraction_ = 0, trial_fraction_ = 0;
  assembly::Loads accepted_loads_;
  la::Handle<Vec> trial_, accepted_;
};

}  // namespace polyslip::solver
