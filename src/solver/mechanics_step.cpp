#include "polyslip/solver/mechanics_step.hpp"

namespace polyslip::solver {

MechanicsStep::MechanicsStep(assembly::MechanicsSystem& system, ContactNewton& newton)
    : system_(system),
      newton_(newton),
      loads_vary_(system.load_assembler().depends_on_time()),
      accepted_loads_(system.load_assembler().zero()),
      trial_(system.layout().create_vector()),
      accepted_(system.layout().create_vector()) {}

assembly::Loads MechanicsStep::loads_at(double time, double fraction) const {
  assembly::Loads loads = system_.load_assembler().at(time);
  return loads_vary_ || fraction == 1 ? loads : assembly::Loads::blend(system_.load_assembler().zero(), loads, fraction);
}

StepOutcome MechanicsStep::attempt(double from, double to, double mark) {
  trial_fraction_ = to == mark ? 1 : fraction_ + (1 - fraction_) * (to - from) / (mark - from);
  system_.set_loads(loads_at(to, trial_fraction_));
  POLYSLIP_PETSC(VecCopy(accepted_, trial_));
  const int krylov_before = newton_.linear_counts().iterations;
  const NewtonResult solved = newton_.solve(trial_);
  if (!solved.converged) {
    system_.set_loads(accepted_loads_);
    POLYSLIP_PETSC(VecCopy(accepted_, trial_));
  }
  return {solved.converged, solved.iterations, newton_.linear_counts().iterations - krylov_before, solved.message};
}

void MechanicsStep::accept() {
  POLYSLIP_PETSC(VecCopy(trial_, accepted_));
  accepted_loads_ = system_.loads();
  fraction_ = trial_fraction_;
  system_.set_previous_jumps(accepted_);
}

void MechanicsStep::restore(double time, double load_fraction) {
  fraction_ = load_fraction;
  accepted_loads_ = loads_at(time, load_fraction);
  system_.set_loads(accepted_loads_);
  POLYSLIP_PETSC(VecCopy(accepted_, trial_));
}

}  // namespace polyslip::solver
