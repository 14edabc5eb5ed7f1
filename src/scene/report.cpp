#include "polyslip/scene/report.hpp"

#include <fmt/ranges.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>

#include "polyslip/assembly/error_norms.hpp"
#include "polyslip/scene/command_line.hpp"

namespace polyslip::scene {

namespace {

/// Smallest and largest cell diameter over all ranks [m].
std::pair<double, double> cell_sizes(const mesh::DistributedMesh& mesh) {
  double smallest = 1e300, largest = 0;
  for (Index cell = 0; cell < mesh.cells.owned; ++cell) {
    const double diameter = mesh::cell_diameter(mesh.mesh, cell);
    smallest = std::min(smallest, diameter);
    largest = std::max(largest, diameter);
  }
  return {mpi::min(mesh.comm, smallest), mpi::max(mesh.comm, largest)};
}

void count_unknowns(io::Summary& s, const Scene& scene, const Model& model) {
  const mesh::DistributedMesh& mesh = model.mesh();
  const long long dim = mesh.mesh.dim, normals = model.mechanics() ? model.mechanics()->layout().total_normals() : 0;
  if (model.mechanics()) {
    s.dofs.displacement_nodal = dim * mesh.copies.total;
    s.dofs.multiplier = dim * mesh.fractures.total;
    s.dofs.displacement_bubble = s.dofs.multiplier + normals;
  }
  if (model.flow()) s.dofs.pressure = model.flow()->layout().numbering().total;
  s.dofs.total = s.dofs.displacement_nodal + s.dofs.displacement_bubble + s.dofs.multiplier + s.dofs.pressure;
  const bool condensed = scene.mechanics.formulation == physics::Formulation::condensed;
  s.dofs.solved = condensed ? s.dofs.displacement_nodal + normals + s.dofs.pressure : s.dofs.total;
}

std::string unknowns_text(const io::Summary& s) {
  std::vector<std::string> parts;
  if (s.dofs.displacement_nodal > 0)
    parts.push_back(fmt::format("{} nodal + {} bubble + {} multiplier", s.dofs.displacement_nodal, s.dofs.displacement_bubble,
                                s.dofs.multiplier));
  if (s.dofs.pressure > 0) parts.push_back(fmt::format("{} pressure", s.dofs.pressure));
  return fmt::format("{}, {} solved", fmt::join(parts, " + "), s.dofs.solved);
}

/// Largest over mean of one value a rank; absent where all are 0.
std::optional<double> imbalance_of(MPI_Comm comm, double value) {
  const double sum = mpi::sum(comm, value), largest = mpi::max(comm, value);
  return sum > 0 ? std::optional(largest * mpi::size(comm) / sum) : std::nullopt;
}

/// Call when all is assembled.
void measure_balance(io::Summary& s, const Model& model) {
  const mesh::DistributedMesh& mesh = model.mesh();
  double seconds = 0;
  for (const la::KernelLog* log : model.kernels())
    for (std::size_t k = 0; k < la::kernel_names.size(); ++k) {
      const la::KernelWork& work = log->work()[k];
      seconds += work.seconds;
      s.kernels.push_back({log->field(), la::kernel_names[k], mpi::max(mesh.comm, work.seconds), mpi::sum(mesh.comm, work.flops),
                           mpi::sum(mesh.comm, work.bytes)});
    }
  s.imbalance.cells = imbalance_of(mesh.comm, mesh.cells.owned);
  s.imbalance.unknowns = imbalance_of(mesh.comm, model.owned_unknowns());
  s.imbalance.assembly = imbalance_of(mesh.comm, seconds);
}

void keep_largest(std::optional<double>& largest, double value) { largest = std::max(largest.value_or(0), value); }

}  // namespace

void report_start(const Log& log, io::Summary& s, const Scene& scene, const Model& model) {
  const mesh::DistributedMesh& mesh = model.mesh();
  const auto [smallest, largest] = cell_sizes(mesh);
  s.scene = scene.name;
  s.version = POLYSLIP_VERSION;
  s.build = {petsc_version(), POLYSLIP_BUILD_TYPE};
  s.ranks = mpi::size(mesh.comm);
  s.mesh = {mesh.mesh.dim, mesh.cells.total, mesh.total_faces, mesh.total_nodes, mesh.fractures.total, largest, smallest};
  count_unknowns(s, scene, model);
  measure_balance(s, model);
  log.line("polyslip {} on {} rank{}: {}", POLYSLIP_VERSION, s.ranks, s.ranks == 1 ? "" : "s", scene.name);
  log.line("mesh: {}D, {} cells, {} faces, {} nodes, {} fracture faces, h {:.3g} to {:.3g} m", s.mesh.dimension, s.mesh.cells,
           s.mesh.faces, s.mesh.nodes, s.mesh.fracture_faces, s.mesh.h_min, s.mesh.h_max);
  log.line("unknowns: {}", unknowns_text(s));
  for (const std::string& choice : model.linear_choices()) log.line("{}", choice);
}

void add_figures(io::Summary& s, const Model& model, const StepFigures& figures) {
  if (model.has_contact()) {
    s.extremes.max_slip = figures.extremes.max_slip;
    s.extremes.max_opening = figures.extremes.max_opening;
    s.active_set.open = figures.counts.faces[0];
    s.active_set.stick = figures.counts.faces[1];
    s.active_set.slip = figures.counts.faces[2];
  }
  if (figures.pressure) {
    s.extremes.min_pressure = figures.pressure->min;
    s.extremes.max_pressure = figures.pressure->max;
    s.extremes.mean_pressure = figures.pressure->mean;
  }
  if (figures.books) {
    keep_largest(s.balance.mass_error_max, figures.books->mass_error);
    keep_largest(s.balance.energy_violation_max, figures.books->energy_violation);
  }
}

void report_step(const Log& log, const Model& model, const solver::StepRecord& r, const StepFigures& figures) {
  std::string text =
      fmt::format("step {}  t = {:g}  dt = {:g}  Newton {}  Krylov {}", r.number, r.time, r.size, r.newton, r.krylov);
  if (model.mechanics())
    text += fmt::format("  max slip {:.4e} m  max opening {:.4e} m", figures.extremes.max_slip, figures.extremes.max_opening);
  if (figures.pressure)
    text += fmt::format("  p {:.6g} to {:.6g} Pa  mass error {:.1e}", figures.pressure->min, figures.pressure->max,
                        figures.books->mass_error);
  log.line("{}", text);
}

void report_newton(const Log& log, const Model& model, const solver::NewtonRecord& r) {
  const auto& n = r.counts.faces;
  if (r.iteration == 0 && !r.remedy.empty()) log.line("  remedy: {}", r.remedy);
  if (model.has_contact())
    log.line("  Newton {:2d}  momentum {:.2e}  contact {:.2e}  open {} stick {} slip {}  changed {}  alpha {:.3g}  Krylov {}{}",
             r.iteration, r.momentum, r.contact, n[0], n[1], n[2], r.changed, r.step_length, r.krylov,
             r.window_steps > 0 ? fmt::format("  windows {}", r.window_steps) : "");
  else
    log.line("  iteration {:2d}  momentum {:.2e}  Krylov {}", r.iteration, r.momentum, r.krylov);
}

void report_errors(const Log& log, io::Summary& s, const Scene& scene, const Model& model, double time) {
  const auto report = [&](const char* name, const std::optional<double>& value, std::optional<double>& entry) {
    entry = value;
    if (value) log.line("relative L2 error of {}: {:.5e}", name, *value);
  };
  if (scene.exact) {
    const auto e = assembly::error_norms(*model.mechanics(), *scene.exact, time, model.displacement().accepted);
    report("displacement", e.displacement, s.errors.displacement_l2);
    report("gradient", e.gradient, s.errors.gradient_l2);
    report("normal multiplier", e.multiplier_normal, s.errors.multiplier_normal_l2);
    report("tangential multiplier", e.multiplier_tangential, s.errors.multiplier_tangential_l2);
    report("normal jump", e.jump_normal, s.errors.jump_normal_l2);
    report("tangential jump", e.jump_tangential, s.errors.jump_tangential_l2);
  }
  if (scene.exact_flow) {
    const auto e = assembly::flow_error_norms(*model.flow(), *scene.exact_flow, time, model.pressure().accepted);
    report("pressure", e.pressure, s.errors.pressure_l2);
    report("flux", e.flux, s.errors.flux_l2);
  }
}

void add_solver_counters(io::Summary& s, const Model& model) {
  const solver::LinearCounts counts = model.linear_counts();
  s.krylov.total += counts.iterations;
  s.krylov.max_per_solve = std::max(s.krylov.max_per_solve, counts.max_per_solve);
  s.setups.preconditioner += counts.setups;
  s.setups.factorisation += counts.factorisations;
  s.active_set.cycles_detected += model.cycles();
}

void add_counters(io::Summary& s, const Model& model, const solver::StepperResult& result, const solver::StepperState& steps) {
  using End = solver::StepperResult::End;
  s.status = result.end == End::finished ? "finished" : result.end == End::stopped ? "stopped" : "diverged";
  s.message = result.message;
  s.steps.accepted = steps.accepted;
  s.steps.rejected = steps.rejected;
  s.newton.total = steps.newton_total;
  s.newton.max_per_step = steps.newton_max;
  add_solver_counters(s, model);
  s.seconds.condense = model.seconds_condensing();
  s.seconds.solve = model.seconds_solving();
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  s.peak_memory_mb_per_rank = mpi::all_gather(model.mesh().comm, static_cast<double>(usage.ru_maxrss) / 1024);
}

std::string closing_line(const io::Summary& s) {
  std::string text = fmt::format("{}: {} step{}, {} Newton iterations, {:.2f} s", s.status, s.steps.accepted,
                                 s.steps.accepted == 1 ? "" : "s", s.newton.total, s.seconds.total);
  if (const auto bytes = s.bytes_per_unknown()) text += fmt::format(", {:.0f} bytes per unknown at most", *bytes);
  return s.message.empty() ? text : text + ": " + s.message;
}

std::string duration(double seconds) {
  const auto whole = static_cast<long long>(std::llround(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  return fmt::format("{} h {} min", whole / 3600, whole / 60 % 60);
}

}  // namespace polyslip::scene
