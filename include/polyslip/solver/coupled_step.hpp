// Backward Euler steps of rock, contact and fluid together: one monolithic Newton solve each.
//
// Newton starts from the better of two states, judged by their residuals: the accepted state z^n, or where it would go at its last speed,
//   z^n + dt/dt^n (z^n - z^{n-1}),
// which knows most of the faces that slip, open and close next. Where Newton fails from the second the first is tried.
#pragma once

#include "polyslip/assembly/energy_balance.hpp"
#include "polyslip/solver/contact_newton.hpp"
#include "polyslip/solver/time_stepper.hpp"

namespace polyslip::solver {

/// Books of one solved step, for history and summary.
struct CoupledBooks {
  assembly::EnergyStep energy;
  assembly::FluidBalance fluid;  ///< Storage by moving rock and fractures included.
};

class CoupledStep : public StepProblem {
 public:
  /// The accepted state is zero displacement at the initial pressures of time `start`; see start_from_equilibrium.
  CoupledStep(assembly::CoupledSystem& system, ContactNewton& newton, double start);

  /// Makes the mechanical equilibrium under the loads at `start` and the initial pressures the accepted state; slip, friction and dilation are
  /// measured from it.
  StepOutcome start_from_equilibrium(double start, const std::function<void(const NewtonRecord&)>& monitor);

  StepOutcome attempt(double from, double to, double mark) override;
  void accept() override;
  [[nodiscard]] bool can_cut() const override { return true; }

  /// Of the attempt that has just converged; before accept().
  [[nodiscard]] const CoupledBooks& books() const { return books_; }

  /// d_f of the owned fracture faces in the trial state [m]; with fluid in the fractures.
  [[nodiscard]] std::vector<double> trial_apertures() const;

  // Mechanics x (order of Layout) and pressures q (order of FlowLayout), the two halves of the states.
  [[nodiscard]] Vec trial() const { return x_; }
  [[nodiscard]] Vec trial_pressure() const { return q_; }
  [[nodiscard]] Vec accepted() const { return accepted_x_; }
  [[nodiscard]] Vec accepted_pressure() const { return accepted_q_; }

  /// The accepted state is what the caller has written into accepted() and accepted_pressure(), at `time` and reached by a step of `size`;
  /// previous and initial jumps are what the caller has given to the system.
  void restore(double time, double size);

  /// The state before the accepted one and the size of the step between them; a size of 0 says that there is none.
  struct Before {
    la::Handle<Vec> x, q;
    double size = 0;  ///< [s]
  };
  [[nodiscard]] Before before() const;
  /// To be called after restore(), which forgets it.
  void restore_before(const Before& before);

 private:
  void take_over();
  NewtonResult solve();
  bool extrapolate(double size);
  [[nodiscard]] bool is_better(Vec guess, Vec than) const;
  void close_books();

  assembly::CoupledSystem& system_;
  ContactNewton& newton_;
  la::Handle<Vec> z_, accepted_z_, before_z_;
  la::Handle<Vec> x_, q_, accepted_x_, accepted_q_;
  double size_ = 0, before_size_ = 0;  ///< Of the last attempt; of the step from before_z_ to accepted_z_, 0 where there was none [s].
  CoupledBooks books_;
  double elastic_ = 0;  ///< Of the accepted state [J].
};

}  // namespace polyslip::solver
