// Which steps a TimeStepper tries, on problems that only say whether a step converges.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "polyslip/solver/time_stepper.hpp"

namespace polyslip {
namespace {

using solver::StepOutcome;
using solver::StepRecord;
using solver::TimeStepper;
using End = solver::StepperResult::End;

/// Keeps what it is asked for; converges where `converges` says so.
class Recorder : public solver::StepProblem {
 public:
  StepOutcome attempt(double from, double to, double mark) override {
    EXPECT_EQ(from, time);
    EXPECT_LT(from, to);
    EXPECT_LE(to, mark);
    trial_ = to;
    marks.push_back(mark);
    const bool good = converges(from, to);
    if (!good) failed.push_back(to - from);
    return {good, newton, 3, good ? "" : "no luck"};
  }
  void accept() override {
    time = trial_;
    times.push_back(time);
  }
  [[nodiscard]] bool can_cut() const override { return cuts; }

  std::function<bool(double, double)> converges = [](double, double) { return true; };
  int newton = 1;
  bool cuts = true;
  double time = 0;
  std::vector<double> times, failed, marks;

  [[nodiscard]] std::vector<double> sizes() const {
    std::vector<double> sizes;
    double last = 0;
    for (double t : times) {
      sizes.push_back(t - last);
      last = t;
    }
    return sizes;
  }

 private:
  double trial_ = 0;
};

void expect_near(const std::vector<double>& found, const std::vector<double>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-12) << i;
}

physics::TimeSpan span(double end, double step, std::vector<double> outputs = {}) {
  return {.start = 0, .end = end, .step = step, .outputs = std::move(outputs)};
}

std::vector<double> times_of(const physics::TimeSpan& of) {
  Recorder problem;
  EXPECT_EQ(TimeStepper(problem, of).run().end, End::finished);
  return problem.times;
}

TEST(time_stepper, meets_the_ends_of_the_steps_and_of_the_run) {
  const auto times = times_of(span(0.5, 0.2));
  expect_near(times, {0.2, 0.4, 0.5});
  EXPECT_EQ(times.back(), 0.5);
  EXPECT_EQ(times_of(span(1, 1)), (std::vector<double>{1}));
}

TEST(time_stepper, accumulates_no_rounding_over_many_steps) {
  const auto times = times_of(span(1000, 0.1));
  ASSERT_EQ(times.size(), 10000U);
  for (std::size_t k = 0; k < times.size(); ++k) EXPECT_EQ(times[k], static_cast<double>(k + 1) * 0.1);
}

TEST(time_stepper, ends_steps_exactly_at_outputs) {
  const auto times = times_of(span(1, 0.25, {0.1, 0.6}));
  for (double output : {0.1, 0.6, 1.0}) EXPECT_EQ(std::count(times.begin(), times.end(), output), 1) << output;
}

TEST(time_stepper, takes_no_sliver_before_or_behind_a_fixed_time) {
  expect_near(times_of(span(0.45, 0.2)), {0.2, 0.325, 0.45});
  expect_near(times_of(span(0.8, 0.2, {0.41})), {0.2, 0.305, 0.41, 0.6, 0.8});
  expect_near(times_of(span(0.8, 0.2, {0.39})), {0.2, 0.39, 0.6 - 0.105, 0.6, 0.8});
  for (double end = 0.95; end < 1.5; end += 0.0137) {
    Recorder problem;
    TimeStepper(problem, span(end, 0.1, {0.333, 0.7512})).run();
    const auto sizes = problem.sizes();
    for (std::size_t k = 1; k < sizes.size(); ++k) {
      EXPECT_GE(sizes[k], 0.5 * sizes[k - 1] * (1 - 1e-8)) << end << " " << problem.times[k];
      EXPECT_GE(sizes[k - 1], 0.5 * sizes[k] * (1 - 1e-8)) << end << " " << problem.times[k];
    }
  }
}

TEST(time_stepper, halves_steps_that_fail_and_doubles_them_again) {
  Recorder problem;
  problem.converges = [](double from, double to) { return from >= 1 || to - from < 0.3; };
  TimeStepper stepper(problem, span(3, 1));
  EXPECT_EQ(stepper.run().end, End::finished);
  EXPECT_EQ(problem.failed, (std::vector<double>{1, 0.5, 0.375}));
  expect_near(problem.times, {0.25, 0.4375, 0.71875, 1, 1.5, 2, 3});
  EXPECT_EQ(stepper.state().accepted, 7);
  EXPECT_EQ(stepper.state().rejected, 3);
  EXPECT_EQ(stepper.state().newton_total, 10);
}

TEST(time_stepper, gives_up_below_the_smallest_step_with_a_sentence) {
  for (double smallest : {0.0, 0.2}) {
    Recorder problem;
    problem.converges = [](double from, double) { return from < 1; };
    physics::TimeSpan of = span(3, 1);
    of.smallest_step = smallest;
    TimeStepper stepper(problem, of);
    std::vector<double> rejected;
    stepper.rejected = [&](double to, double size, const std::string& why) {
      EXPECT_EQ(to, 1 + size);
      EXPECT_EQ(why, "no luck");
      rejected.push_back(size);
    };
    const auto result = stepper.run();
    EXPECT_EQ(result.end, End::diverged);
    EXPECT_EQ(rejected, problem.failed);
    EXPECT_EQ(rejected.back(), smallest > 0 ? 0.25 : 1.0 / 1024);
    EXPECT_EQ(stepper.state().time, 1) << "the last accepted state stays";
    EXPECT_NE(result.message.find("step 2 to t = 1"), std::string::npos) << result.message;
    EXPECT_NE(result.message.find("no luck"), std::string::npos);
  }
}

TEST(time_stepper, lets_failures_stand_where_shorter_steps_cannot_help) {
  Recorder problem;
  problem.cuts = false;
  problem.converges = [](double, double) { return false; };
  EXPECT_EQ(TimeStepper(problem, span(3, 1)).run().end, End::diverged);
  EXPECT_EQ(problem.failed.size(), 1U);
}

TEST(time_stepper, grows_beyond_the_step_while_newton_finds_it_easy) {
  physics::TimeSpan of = span(100, 1, {50});
  of.largest_step = 8;
  Recorder easy, hard;
  hard.newton = TimeStepper::easy + 1;
  TimeStepper(easy, of).run();
  TimeStepper(hard, of).run();
  EXPECT_EQ(hard.times.size(), 100U);
  const auto sizes = easy.sizes();
  expect_near({sizes.begin(), sizes.begin() + 4}, {1, 1.5, 2.25, 3.375});
  EXPECT_LE(*std::max_element(sizes.begin(), sizes.end()), 8 + 1e-9);
  EXPECT_EQ(std::count(easy.times.begin(), easy.times.end(), 50), 1);
  for (std::size_t k = 1; k < sizes.size(); ++k) EXPECT_GE(sizes[k], 0.5 * sizes[k - 1] - 1e-9);
}

TEST(time_stepper, halves_steps_that_newton_finds_hard_down_to_the_scenes_step) {
  physics::TimeSpan of = span(100, 1);
  of.largest_step = 8;
  Recorder problem;
  problem.converges = [&](double from, double) {
    problem.newton = from < 40 ? 1 : from < 60 ? TimeStepper::hard : TimeStepper::hard + 1;
    return true;
  };
  TimeStepper(problem, of).run();
  const auto sizes = problem.sizes();
  std::vector<double> hard;
  for (std::size_t k = 1; k < sizes.size(); ++k) {
    const double start = problem.times[k - 1];
    EXPECT_TRUE(start < 40 || start >= 60 || std::abs(sizes[k] - 8) < 1e-9) << start;
    if (start >= 60) hard.push_back(sizes[k]);
  }
  ASSERT_GT(hard.size(), 20U);
  expect_near({hard.begin(), hard.begin() + 3}, {8, 4, 2});
  for (std::size_t k = 3; k < hard.size(); ++k) EXPECT_LE(hard[k], 1 + 1e-9);
}

TEST(time_stepper, tells_the_end_of_the_scenes_step) {
  Recorder problem;
  problem.converges = [](double from, double to) { return from >= 1 || to - from < 0.6; };
  TimeStepper(problem, span(2, 1)).run();
  EXPECT_EQ(problem.marks, (std::vector<double>{1, 1, 1, 2}));
}

TEST(time_stepper, calls_outputs_before_and_after_a_step_is_accepted) {
  Recorder problem;
  TimeStepper stepper(problem, span(2, 1));
  std::vector<double> before, after;
  stepper.solved = [&](const StepRecord& record) {
    EXPECT_EQ(problem.time, record.time - record.size);
    EXPECT_EQ(record.krylov, 3);
    before.push_back(stepper.state().time);
  };
  stepper.accepted = [&](const StepRecord& record) {
    EXPECT_EQ(problem.time, record.time);
    EXPECT_EQ(record.number, stepper.state().accepted);
    after.push_back(stepper.state().time);
  };
  stepper.run();
  EXPECT_EQ(before, (std::vector<double>{0, 1}));
  EXPECT_EQ(after, (std::vector<double>{1, 2}));
}

TEST(time_stepper, stops_between_steps_and_in_an_attempt_without_a_rejection) {
  Recorder problem;
  bool stop = false;
  problem.converges = [&](double from, double) { return from < 2 || (stop = true, false); };
  TimeStepper stepper(problem, span(9, 1));
  stepper.stop_requested = [&] { return stop; };
  const auto result = stepper.run();
  EXPECT_EQ(result.end, End::stopped);
  EXPECT_EQ(stepper.state().accepted, 2);
  EXPECT_EQ(stepper.state().rejected, 0);

  Recorder untouched;
  TimeStepper other(untouched, span(9, 1));
  other.stop_requested = [] { return true; };
  EXPECT_EQ(other.run().end, End::stopped);
  EXPECT_TRUE(untouched.marks.empty());
}

TEST(time_stepper, goes_on_as_if_it_had_never_stopped) {
  physics::TimeSpan of = span(40, 1, {7.3, 20.1});
  of.largest_step = 3;
  const auto rough = [](double from, double to) { return to - from < (std::fmod(from, 5) < 2 ? 0.4 : 9); };
  Recorder whole;
  whole.converges = rough;
  TimeStepper uncut(whole, of);
  ASSERT_EQ(uncut.run().end, End::finished);
  for (std::size_t steps = 1; steps < whole.times.size(); steps += 3) {
    Recorder part, rest;
    part.converges = rest.converges = rough;
    TimeStepper first(part, of), second(rest, of);
    first.stop_requested = [&] { return part.times.size() == steps; };
    ASSERT_EQ(first.run().end, End::stopped);
    second.restore(first.state());
    rest.time = part.time;
    ASSERT_EQ(second.run().end, End::finished);
    part.times.insert(part.times.end(), rest.times.begin(), rest.times.end());
    EXPECT_EQ(part.times, whole.times);
    EXPECT_EQ(second.state().rejected, uncut.state().rejected);
    EXPECT_EQ(second.state().newton_total, uncut.state().newton_total);
  }
}

TEST(step_sizes, are_settled_where_only_rounding_differs) {
  EXPECT_EQ(solver::settled_size(0.3 - 0.2, 0.1), 0.1);
  EXPECT_EQ(solver::settled_size(0.1001, 0.1), 0.1001);
}

}  // namespace
}  // namespace polyslip
