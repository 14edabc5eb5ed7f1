#include "polyslip/solver/darcy_step.hpp"

#include "polyslip/la/log_stage.hpp"

namespace polyslip::solver {

DarcyStep::DarcyStep(assembly::FlowSystem& system, FlowSolver& solver, double start)
    : system_(system), solver_(solver), trial_(system.layout().create_vector()), accepted_(system.layout().create_vector()) {
  system.set_initial(start, accepted_);
  restore(start, system.time_step());
}

StepOutcome DarcyStep::attempt(double from, double to, double) {
  system_.set_loads(system_.load_assembler().at(to));
  system_.set_time_step(settled_size(to - from, system_.time_step()));
  POLYSLIP_PETSC(VecCopy(accepted_, trial_));
  const la::LogStage stage("solve", seconds_);
  const FlowStep solved = solver_.step(trial_);
  if (!solved.converged) POLYSLIP_PETSC(VecCopy(accepted_, trial_));
  return {solved.converged, 1, solved.iterations, solved.message};
}

void DarcyStep::accept() { POLYSLIP_PETSC(VecCopy(trial_, accepted_)); }

void DarcyStep::restore(double time, double size) {
  system_.set_loads(system_.load_assembler().at(time));
  system_.set_time_step(size);
  POLYSLIP_PETSC(VecCopy(accepted_, trial_));
}

}  // namespace polyslip::solver
