// Quasi-static load steps: each solves the contact problem at its time, friction measured from the last accepted state.
#pragma once

#include <functional>

#include "polyslip/solver/contact_newton.hpp"

namespace polyslip::solver {

/// An accepted step.
struct StepRecord {
  int number = 0;      ///< From 1.
  double time = 0, size = 0;  ///< [s]
  int newton = 0, krylov = 0;
};

struct StepperResult {
  enum class End { finished, diverged, stopped } end = End::finished;
  std::string message;
  int accepted = 0, rejected = 0;
  int newton_total = 0, newton_max = 0;
};

/// Steps from span.start to span.end. A step that fails is cut in half, down to span.step/1024, and grows again after successes; ends of
/// the scene's own steps are met exactly. Loads that do not depend on time are then applied in parts, in proportion to the step. Friction
/// remembers the states between, as it does between the scene's own steps. A scene without fractures is linear: there a failure stands.
class LoadStepper {
 public:
  LoadStepper(assembly::MechanicsSystem& system, ContactNewton& newton, const physics::TimeSpan& span);

  std::function<void(const StepRecord&)> accepted;                              ///< The state is in x by then.
  std::function<void(double time, double size, const std::string&)> rejected;  ///< With the size tried and the reason.
  std::function<bool()> stop_requested = [] { return false; };                   ///< Asked between steps.

  StepperResult run(Vec x);

 private:
  assembly::MechanicsSystem& system_;
  ContactNewton& newton_;
  physics::TimeSpan span_;
};

}  // namespace polyslip::solver
