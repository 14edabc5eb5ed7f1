#include "polyslip/solver/time_stepper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace polyslip::solver {

namespace {

constexpr double smallest_cut = 1.0 / 1024;  ///< Of span.step, where the span gives no smallest step.
constexpr double slack = 1e-9;               ///< Relative; sizes that differ by less are equal.

}  // namespace

double settled_size(double size, double last) { return std::abs(size - last) <= slack * last ? last : size; }

TimeStepper::TimeStepper(StepProblem& problem, const physics::TimeSpan& span) : problem_(problem), span_(span) {
  if (span_.smallest_step <= 0) span_.smallest_step = smallest_cut * span_.step;
  span_.largest_step = std::max(span_.largest_step, span_.step);
  state_.time = span_.start;
  state_.size = span_.step;
}

void TimeStepper::restore(const StepperState& state) {
  state_ = state;
  state_.size = std::clamp(state.size, span_.smallest_step, span_.largest_step);
}

/// The next output, or the end.
double TimeStepper::next_fixed() const {
  const auto next = std::upper_bound(span_.outputs.begin(), span_.outputs.end(), state_.time);
  return next == span_.outputs.end() ? span_.end : std::min(*next, span_.end);
}

/// The end of the scene's step that holds the time, or of the next one when the time is an end.
double TimeStepper::next_mark() const {
  const auto next = std::upper_bound(span_.outputs.begin(), span_.outputs.end(), state_.time);
  const double last_fixed = next == span_.outputs.begin() ? span_.start : *(next - 1), fixed = next_fixed();
  const double near = 0.5 * span_.step * (1 - slack);
  double k = std::floor((state_.time - span_.start) / span_.step * (1 + 1e-12) + slack) + 1;
  if (span_.start + k * span_.step - last_fixed < near) ++k;
  const double mark = span_.start + k * span_.step;
  return fixed - mark < near ? fixed : mark;
}

TimeStepper::Target TimeStepper::target() const {
  const bool keeps_marks = state_.size <= span_.step * (1 + slack);
  const double end = keeps_marks ? next_mark() : next_fixed(), left = end - state_.time;
  if (left <= state_.size * (1 + slack)) return {end, end};
  const double size = left < 2 * state_.size * (1 - slack) ? left / 2 : state_.size;
  return {state_.time + size, keeps_marks ? end : state_.time + size};
}

void TimeStepper::adapt(double tried, int newton) {
  if (newton > hard && state_.size > span_.step) {
    state_.size = std::max(span_.step, 0.5 * state_.size);
    return;
  }
  if (tried < 0.5 * state_.size) return;  // a step shortened to end somewhere tells nothing of longer ones
  if (state_.size < span_.step)
    state_.size = std::min(span_.step, 2 * state_.size);
  else if (newton <= easy)
    state_.size = std::min(span_.largest_step, 1.5 * state_.size);
}

void TimeStepper::accept(double to, const StepOutcome& outcome) {
  const StepRecord record{state_.accepted + 1, to, to - state_.time, outcome.newton, outcome.krylov};
  if (solved) solved(record);
  problem_.accept();
  state_.time = to;
  ++state_.accepted;
  state_.newton_max = std::max(state_.newton_max, outcome.newton);
  adapt(record.size, outcome.newton);
  if (accepted) accepted(record);
}

StepperResult TimeStepper::give_up(double to, const StepOutcome& outcome) const {
  return {StepperResult::End::diverged,
          fmt::format("step {} to t = {:g} failed{}. {}", state_.accepted + 1, to,
                      problem_.can_cut() ? fmt::format(" down to the step size {:g}", to - state_.time) : "", outcome.message)};
}

StepperResult TimeStepper::run() {
  while (state_.time < span_.end) {
    if (stop_requested()) return {StepperResult::End::stopped, fmt::format("stopped on request at t = {:g}; -restart goes on", state_.time)};
    const Target next = target();
    const double size = next.to - state_.time;
    const StepOutcome outcome = problem_.attempt(state_.time, next.to, next.mark);
    state_.newton_total += outcome.newton;
    if (outcome.converged) {
      accept(next.to, outcome);
      continue;
    }
    if (stop_requested()) continue;
    ++state_.rejected;
    if (rejected) rejected(next.to, size, outcome.message);
    if (!problem_.can_cut() || size / 2 < span_.smallest_step * (1 - slack)) return give_up(next.to, outcome);
    state_.size = size / 2;
  }
  return {};
}

}  // namespace polyslip::solver
