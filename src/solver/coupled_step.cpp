#include "polyslip/solver/coupled_step.hpp"

namespace polyslip::solver {

using assembly::CoupledSystem;
using assembly::MechanicsSystem;

CoupledStep::CoupledStep(CoupledSystem& system, ContactNewton& newton, double start)
    : system_(system),
      newton_(newton),
      z_(system.create_vector()),
      accepted_z_(system.create_vector()),
      x_(system.layout().create_vector()),
      q_(system.flow().layout().create_vector()),
      accepted_x_(system.layout().create_vector()),
      accepted_q_(system.flow().layout().create_vector()) {
  system.flow().set_initial(start, accepted_q_);
  restore(start, system.flow().time_step());
}

StepOutcome CoupledStep::start_from_equilibrium(double start, const std::function<void(const NewtonRecord&)>& monitor) {
  // A problem of rock alone, with the pressures as loads; it lives no longer than this solve.
  MechanicsSystem rock(system_.mesh(), system_.problem());
  assembly::Loads loads = system_.load_assembler().at(start);
  system_.add_pressures(accepted_q_, loads);
  rock.set_loads(std::move(loads));
  ContactNewton newton(rock);
  newton.monitor = monitor;
  const NewtonResult solved = newton.solve(accepted_x_);
  if (solved.converged) {
    system_.set_previous_jumps(accepted_x_);
    system_.set_initial_jumps(system_.previous_jumps());
    restore(start, system_.flow().time_step());
  }
  return {solved.converged, solved.iterations, newton.linear_counts().iterations, solved.message};
}

void CoupledStep::restore(double time, double size) {
  system_.flow().set_loads(system_.flow().load_assembler().at(time));
  system_.flow().set_time_step(size);
  system_.join(accepted_x_, accepted_q_, accepted_z_);
  take_over();
  elastic_ = assembly::elastic_energy(system_, accepted_z_);
}

void CoupledStep::take_over() {
  POLYSLIP_PETSC(VecCopy(accepted_z_, z_));
  system_.split(z_, x_, q_);
}

StepOutcome CoupledStep::attempt(double from, double to, double) {
  if (!system_.begin_step(accepted_z_, settled_size(to - from, system_.flow().time_step())))
    return {false, 0, 0, "the aperture of a fracture face is not positive; raise flow.fractures.contact_aperture or refine the mesh there"};
  system_.flow().set_loads(system_.flow().load_assembler().at(to));
  system_.set_loads(system_.load_assembler().at(to));
  POLYSLIP_PETSC(VecCopy(accepted_z_, z_));
  const int krylov_before = newton_.linear_counts().iterations;
  const NewtonResult solved = newton_.solve(z_);
  if (!solved.converged) POLYSLIP_PETSC(VecCopy(accepted_z_, z_));
  system_.split(z_, x_, q_);
  if (solved.converged) close_books();
  return {solved.converged, solved.iterations, newton_.linear_counts().iterations - krylov_before, solved.message};
}

void CoupledStep::close_books() {
  books_ = {assembly::energy_of_step(system_, accepted_z_, z_, elastic_), system_.flow().balance(q_, accepted_q_)};
  books_.fluid.stored += system_.volume_change(z_);
  books_.fluid.turnover += system_.volume_turnover(z_);
}

std::vector<double> CoupledStep::trial_apertures() const {
  std::vector<double> apertures = system_.apertures(z_);
  apertures.resize(static_cast<std::size_t>(system_.mesh().fractures.owned));
  return apertures;
}

void CoupledStep::accept() {
  POLYSLIP_PETSC(VecCopy(z_, accepted_z_));
  system_.split(accepted_z_, accepted_x_, accepted_q_);
  system_.set_previous_jumps(accepted_x_);
  elastic_ = books_.energy.elastic;
}

}  // namespace polyslip::solver
