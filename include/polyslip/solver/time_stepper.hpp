// Steps in time, the same for rock, fluid and both: which sizes are tried, when they are cut and grown, where they must end.
//
// A step of size s ends at its start + s, with these exceptions:
//  * it ends exactly at each of span.outputs, at span.end and, while s <= span.step, at span.start + k span.step;
//  * of those multiples, the ones nearer than span.step/2 to an output or the end do not count;
//  * what is left before such a time and is longer than s but shorter than 2 s is done in two halves.
// So no step is below half its neighbours but where sizes are cut or asked for by two outputs close to each other.
#pragma once

#include <functional>
#include <string>

#include "polyslip/physics/problem.hpp"

namespace polyslip::solver {

/// What came of one attempt.
struct StepOutcome {
  bool converged = false;
  int newton = 0, krylov = 0;  ///< Iterations.
  std::string message;         ///< Why not, and what may help.
};

/// Something that can be taken from one time to another: an accepted state and a trial state.
class StepProblem {
 public:
  StepProblem() = default;
  StepProblem(const StepProblem&) = delete;
  StepProblem& operator=(const StepProblem&) = delete;
  virtual ~StepProblem() = default;

  /// Solves from the accepted state at `from` for the trial state at `to`. On failure the accepted state is as it was and the trial
  /// state equals it. `mark`, at or after `to`, is the end of the scene's own step: loads that do not depend on time are applied in
  /// parts, in proportion up to it, so that cut steps follow a path.
  virtual StepOutcome attempt(double from, double to, double mark) = 0;
  /// The trial state becomes the accepted one.
  virtual void accept() = 0;
  /// Whether shorter steps may help where one fails.
  [[nodiscard]] virtual bool can_cut() const = 0;
};

/// An accepted step.
struct StepRecord {
  int number = 0;             ///< From 1.
  double time = 0, size = 0;  ///< [s]
  int newton = 0, krylov = 0;
};

/// All that a stepper needs to go on from an accepted state.
struct StepperState {
  double time = 0;  ///< Of the accepted state [s].
  double size = 0;  ///< To be tried next [s].
  int accepted = 0, rejected = 0;
  int newton_total = 0;  ///< Of rejected attempts too.
  int newton_max = 0;    ///< Of one accepted step.
};

struct StepperResult {
  enum class End { finished, diverged, stopped } end = End::finished;
  std::string message;
};

/// Steps from span.start to span.end, at first of size span.step. A step that fails is cut in half, down to span.smallest_step;
/// after a success sizes double until they are back at span.step, and then grow by half, up to span.largest_step, as long as Newton
/// needs at most `easy` iterations; where it needs more than `hard`, sizes beyond span.step are halved, down to span.step.
class TimeStepper {
 public:
  static constexpr int easy = 4, hard = 6;

  TimeStepper(StepProblem& problem, const physics::TimeSpan& span);

  std::function<void(const StepRecord&)> solved;    ///< Before accept(): for outputs that compare the step with the last.
  std::function<void(const StepRecord&)> accepted;  ///< After accept(): state() is that of the step.
  std::function<void(double time, double size, const std::string&)> rejected;  ///< With the size tried and the reason.
  /// Asked between steps and after failures; the same on all ranks. An attempt that fails while it is true is not a rejected step.
  std::function<bool()> stop_requested = [] { return false; };

  StepperResult run();

  [[nodiscard]] const StepperState& state() const { return state_; }
  /// Goes on from a state of an earlier run; its size is kept between the smallest and the largest step.
  void restore(const StepperState& state);

 private:
  struct Target {
    double to, mark;
  };
  [[nodiscard]] Target target() const;
  [[nodiscard]] double next_mark() const;
  [[nodiscard]] double next_fixed() const;
  void accept(double to, const StepOutcome& outcome);
  void adapt(double tried, int newton);
  StepperResult give_up(double to, const StepOutcome& outcome) const;

  StepProblem& problem_;
  physics::TimeSpan span_;
  StepperState state_;
};

/// `size`, or `last` where they differ by no more than rounding of times: so that equal steps have the same matrix.
double settled_size(double size, double last);

}  // namespace polyslip::solver
