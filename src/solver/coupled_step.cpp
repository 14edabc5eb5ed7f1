#include "polyslip/solver/coupled_step.hpp"

#include <algorithm>

namespace polyslip::solver {

using assembly::CoupledSystem;
using assembly::MechanicsSystem;

CoupledStep::CoupledStep(CoupledSystem& system, ContactNewton& newton, double start)
    : system_(system),
      newton_(newton),
      z_(system.create_vector()),
      accepted_z_(system.create_vector()),
      before_z_(system.create_vector()),
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
  before_size_ = 0;
  elastic_ = assembly::elastic_energy(system_, accepted_z_);
}

CoupledStep::Before CoupledStep::before() const {
  Before before{system_.layout().create_vector(), system_.flow().layout().create_vector(), before_size_};
  system_.split(before_z_, before.x, before.q);
  return before;
}

void CoupledStep::restore_before(const Before& before) {
  system_.join(before.x, before.q, before_z_);
  before_size_ = before.size;
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
  const int krylov_before = newton_.linear_counts().iterations;
  size_ = to - from;
  const NewtonResult solved = solve();
  system_.split(z_, x_, q_);
  if (solved.converged) close_books();
  return {solved.converged, solved.iterations, newton_.linear_counts().iterations - krylov_before, solved.message};
}

NewtonResult CoupledStep::solve() {
  const bool extrapolated = extrapolate(size_);
  NewtonResult solved = newton_.solve(z_);
  if (!solved.converged) POLYSLIP_PETSC(VecCopy(accepted_z_, z_));
  if (solved.converged || !extrapolated || newton_.stop_requested()) return solved;
  const int before = solved.iterations;
  solved = newton_.solve(z_);
  solved.iterations += before;
  if (!solved.converged) POLYSLIP_PETSC(VecCopy(accepted_z_, z_));
  return solved;
}

/// Writes the start of Newton's method into z_; true where it is not the accepted state.
bool CoupledStep::extrapolate(double size) {
  POLYSLIP_PETSC(VecCopy(accepted_z_, z_));
  if (before_size_ <= 0) return false;
  la::Handle<Vec> guess = system_.create_vector(), start = system_.create_vector();
  const double ratio = size / before_size_;
  POLYSLIP_PETSC(VecCopy(accepted_z_, guess));
  POLYSLIP_PETSC(VecAXPBY(guess, -ratio, 1 + ratio, before_z_));
  POLYSLIP_PETSC(VecCopy(accepted_z_, start));
  system_.impose_dirichlet(guess);
  system_.impose_dirichlet(start);
  if (!is_better(guess, start)) return false;
  POLYSLIP_PETSC(VecCopy(guess, z_));
  return true;
}

/// Whether the rows are nearer to zero at one state than at another, each kind of them measured by the larger of its scales.
bool CoupledStep::is_better(Vec guess, Vec than) const {
  la::Handle<Vec> rows = system_.create_vector();
  system_.residual(guess, rows);
  const assembly::ResidualNorms a = system_.norms(guess, rows);
  system_.residual(than, rows);
  const assembly::ResidualNorms b = system_.norms(than, rows);
  const double momentum = std::max(a.momentum_scale, b.momentum_scale), contact = std::max(a.contact_scale, b.contact_scale),
               flow = std::max({a.flow_scale, b.flow_scale, a.flow_floor, b.flow_floor});
  const auto size = [&](const assembly::ResidualNorms& n) {
    return n.momentum / momentum + (contact > 0 ? n.contact / contact : 0) + n.flow / flow;
  };
  return size(a) < size(b);
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
  POLYSLIP_PETSC(VecCopy(accepted_z_, before_z_));
  before_size_ = size_;
  POLYSLIP_PETSC(VecCopy(z_, accepted_z_));
  system_.split(accepted_z_, accepted_x_, accepted_q_);
  system_.set_previous_jumps(accepted_x_);
  elastic_ = books_.energy.elastic;
}

}  // namespace polyslip::solver
