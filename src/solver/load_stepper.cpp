#include "polyslip/solver/load_stepper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace polyslip::solver {

namespace {

constexpr double smallest_cut = 1.0 / 1024;

/// The end of the scene's step that holds `time`, or of the next one when `time` is an end.
double next_mark(const physics::TimeSpan& span, double time) {
  const double steps = std::floor((time - span.start) / span.step * (1 + 1e-12) + 1e-9) + 1;
  const double mark = span.start + steps * span.step;
  return mark > span.end - 1e-9 * span.step ? span.end : mark;
}

}  // namespace

LoadStepper::LoadStepper(assembly::MechanicsSystem& system, ContactNewton& newton, const physics::TimeSpan& span)
    : system_(system), newton_(newton), span_(span) {}

StepperResult LoadStepper::run(Vec x) {
  StepperResult result;
  la::Handle<Vec> trial;
  POLYSLIP_PETSC(VecDuplicate(x, trial.put()));
  assembly::Loads accepted_loads = system_.load_assembler().zero();
  const bool varies = system_.load_assembler().depends_on_time(), can_cut = system_.fracture_faces() > 0;
  double time = span_.start, cut = 1;
  while (time < span_.end) {
    if (stop_requested()) {
      result.end = StepperResult::End::stopped;
      result.message = fmt::format("stopped on request at t = {:g}", time);
      return result;
    }
    const double mark = next_mark(span_, time);
    const double target = std::min(mark, time + cut * span_.step * (1 + 1e-9));
    const double next = mark - target < 1e-6 * span_.step ? mark : target;
    assembly::Loads loads = system_.load_assembler().at(next);
    if (!varies && next < mark) loads = assembly::Loads::blend(accepted_loads, loads, (next - time) / (mark - time));
    system_.set_loads(loads);
    POLYSLIP_PETSC(VecCopy(x, trial));
    const int krylov_before = newton_.linear_counts().iterations;
    const NewtonResult solved = newton_.solve(trial);
    result.newton_total += solved.iterations;
    if (solved.converged) {
      POLYSLIP_PETSC(VecCopy(trial, x));
      accepted_loads = std::move(loads);
      result.newton_max = std::max(result.newton_max, solved.iterations);
      const double size = next - time;
      time = next;
      ++result.accepted;
      cut = std::min(1.0, 2 * cut);
      if (accepted) accepted({result.accepted, time, size, solved.iterations, newton_.linear_counts().iterations - krylov_before});
      system_.set_previous_jumps(x);  // after the outputs, which show the states of this step
      continue;
    }
    ++result.rejected;
    if (rejected) rejected(next, next - time, solved.message);
    cut /= 2;
    if (!can_cut || cut < smallest_cut) {
      result.end = StepperResult::End::diverged;
      result.message = fmt::format("step {} to t = {:g} failed{}. {}", result.accepted + 1, next,
                                   can_cut ? fmt::format(" down to the step size {:g}", next - time) : "", solved.message);
      return result;
    }
  }
  return result;
}

}  // namespace polyslip::solver
