#include "polyslip/scene/model.hpp"

#include <algorithm>
#include <cmath>

#include "polyslip/common/error.hpp"
#include "polyslip/solver/coupled_solver.hpp"

namespace polyslip::scene {

namespace {

/// energy - energy_before + dissipated - work, where it is positive, relative to all of them.
double violation(double energy, double before, double dissipated, double work) {
  const double scale = std::abs(energy) + std::abs(before) + std::abs(dissipated) + std::abs(work);
  return scale > 0 ? std::max(0.0, energy - before + dissipated - work) / scale : 0;
}

}  // namespace

Model::Model(const mesh::DistributedMesh& mesh, const Scene& scene) : mesh_(mesh) {
  try {
    set_up(scene);
  } catch (const InputError& error) {
    // Kernels know the cell; which mesh it is of is known here.
    const std::string text = error.what();
    throw text.starts_with("cell ") ? InputError(scene.mesh.place + ", " + text) : error;
  }
}

void Model::set_up(const Scene& scene) {
  if (scene.has_mechanics && scene.flow) {
    set_up_coupled(scene);
  } else if (scene.has_mechanics) {
    mechanics_ = std::make_unique<assembly::MechanicsSystem>(mesh_, scene.mechanics);
    set_up_mechanics();
  } else {
    flow_ = std::make_unique<assembly::FlowSystem>(mesh_, *scene.flow);
    set_up_flow(scene.time.start);
  }
}

void Model::set_up_mechanics() {
  newton_ = std::make_unique<solver::ContactNewton>(*mechanics_);
  auto step = std::make_unique<solver::MechanicsStep>(*mechanics_, *newton_);
  mechanics_step_ = step.get();
  displacement_ = {step->trial(), step->accepted()};
  steps_ = std::move(step);
}

void Model::set_up_flow(double start) {
  flow_solver_ = std::make_unique<solver::FlowSolver>(*flow_);
  auto step = std::make_unique<solver::DarcyStep>(*flow_, *flow_solver_, start);
  darcy_step_ = step.get();
  pressure_ = {step->trial(), step->accepted()};
  steps_ = std::move(step);
}

void Model::set_up_coupled(const Scene& scene) {
  if (scene.mechanics.formulation == physics::Formulation::saddle)
    throw InputError("contact.formulation is saddle, but flow is only computed with condensed bubbles and multipliers", scene.path.string(),
                     "Set contact.formulation: condensed");
  flow_ = std::make_unique<assembly::FlowSystem>(mesh_, *scene.flow);
  auto system = std::make_unique<assembly::CoupledSystem>(mesh_, scene.mechanics, *flow_);
  newton_ = std::make_unique<solver::ContactNewton>(*system, std::make_unique<solver::CoupledSolver>(*system));
  auto step = std::make_unique<solver::CoupledStep>(*system, *newton_, scene.time.start);
  mechanics_ = std::move(system);
  coupled_step_ = step.get();
  displacement_ = {step->trial(), step->accepted()};
  pressure_ = {step->trial_pressure(), step->accepted_pressure()};
  steps_ = std::move(step);
  if (scene.initial.equilibrium) equilibrium_at_ = scene.time.start;
}

solver::StepOutcome Model::find_equilibrium(const std::function<void(const solver::NewtonRecord&)>& monitor) {
  if (!equilibrium_at_) return {true, 0, 0, ""};
  return coupled_step_->start_from_equilibrium(*equilibrium_at_, monitor);
}

std::vector<double> Model::apertures() const {
  if (coupled_step_ != nullptr && flow_->layout().with_fractures()) return coupled_step_->trial_apertures();
  std::vector<double> apertures;
  if (flow_ && flow_->layout().with_fractures())
    for (Index f = 0; f < flow_->mesh().fractures.owned; ++f) apertures.push_back(flow_->fractures()[f].contact_aperture);
  return apertures;
}

std::vector<std::string> Model::book_names(const Scene& scene) {
  if (!scene.flow) return {};
  std::vector<std::string> names{"stored_volume",     "injected_volume",      "outflow_volume",      "mass_error", "fluid_energy",
                                 "dissipated_matrix", "dissipated_interface", "dissipated_fracture", "work"};
  if (scene.has_mechanics) names.insert(names.end(), {"elastic_energy", "contact_work", "dilation_work", "energy_violation"});
  return names;
}

double Model::mass_error(const assembly::FluidBalance& fluid) {
  largest_turnover_ = std::max(largest_turnover_, fluid.turnover);
  return largest_turnover_ > 0 ? std::abs(fluid.error()) / largest_turnover_ : 0;
}

std::optional<Books> Model::books(double size) {
  if (!flow_) return std::nullopt;
  if (coupled_step_ != nullptr) return coupled_books();
  const double duration = flow_->problem().stationary ? 1 : size;  // a stationary state: what one second does
  const assembly::FluidBalance fluid = flow_->balance(pressure_.trial, pressure_.accepted);
  const assembly::Dissipation power = flow_->fluxes().dissipation(pressure_.trial);
  const double energy = flow_->stored_energy(pressure_.trial), before = flow_->stored_energy(pressure_.accepted);
  const double work = duration * flow_->power_input(pressure_.trial);
  Books books;
  books.mass_error = mass_error(fluid);
  books.energy_violation = violation(energy, before, duration * power.total(), work);
  books.values = {fluid.stored,
                  fluid.injected,
                  fluid.outflow,
                  books.mass_error,
                  energy,
                  duration * power.matrix,
                  duration * power.interface,
                  duration * power.fracture,
                  work};
  return books;
}

Books Model::coupled_books() {
  const auto& [energy, fluid] = coupled_step_->books();
  const assembly::Dissipation power = flow_->fluxes().dissipation(pressure_.trial);
  const double dt = flow_->time_step();
  Books books;
  books.mass_error = mass_error(fluid);
  const double scale = energy.elastic + energy.fluid + energy.turnover();
  books.energy_violation = scale > 0 ? std::max(0.0, energy.excess()) / scale : 0;
  books.values = {fluid.stored,
                  fluid.injected,
                  fluid.outflow,
                  books.mass_error,
                  energy.fluid,
                  dt * power.matrix,
                  dt * power.interface,
                  dt * power.fracture,
                  energy.work,
                  energy.elastic,
                  energy.contact,
                  energy.dilation,
                  books.energy_violation};
  return books;
}

std::vector<const la::KernelLog*> Model::kernels() const {
  std::vector<const la::KernelLog*> logs;
  if (mechanics_) logs.push_back(&mechanics_->kernels());
  if (flow_) logs.push_back(&flow_->fluxes().kernels());
  return logs;
}

double Model::owned_unknowns() const {
  return (mechanics_ ? mechanics_->layout().size() : 0) + (flow_ ? flow_->layout().size() : 0);
}

std::vector<std::string> Model::linear_choices() const {
  std::vector<std::string> choices;
  if (newton_) choices.push_back(newton_->linear_choice());
  if (flow_solver_) choices.push_back(flow_solver_->choice());
  return choices;
}

solver::LinearCounts Model::linear_counts() const { return newton_ ? newton_->linear_counts() : flow_solver_->counts(); }

double Model::seconds_solving() const { return newton_ ? newton_->seconds().solve : darcy_step_->seconds(); }

Model::Memory Model::memory() const {
  Memory memory;
  if (mechanics_step_) memory.load_fraction = mechanics_step_->load_fraction();
  if (flow_) memory.flow_step = flow_->time_step();
  memory.turnover = largest_turnover_;
  return memory;
}

void Model::resume(double time, const Memory& memory) {
  largest_turnover_ = memory.turnover;
  if (mechanics_step_) mechanics_step_->restore(time, memory.load_fraction);
  if (darcy_step_) darcy_step_->restore(time, memory.flow_step);
  if (coupled_step_) coupled_step_->restore(time, memory.flow_step);
}

}  // namespace polyslip::scene
