#include "polyslip/io/summary.hpp"

#include <nlohmann/json.hpp>
#include <numeric>

#include "polyslip/io/atomic_file.hpp"

namespace polyslip::io {

namespace {

using Json = nlohmann::ordered_json;  // keys stay in the order of interface.md

Json number(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json run_section(const Summary& s) {
  return {{"scene", s.scene}, {"version", s.version}, {"ranks", s.ranks}, {"status", s.status}, {"message", s.message},
          {"build", {{"petsc", s.build.petsc}, {"type", s.build.type}}}};
}

Json mesh_section(const Summary& s) {
  return {{"dimension", s.mesh.dimension},           {"cells", s.mesh.cells}, {"faces", s.mesh.faces}, {"nodes", s.mesh.nodes},
          {"fracture_faces", s.mesh.fracture_faces}, {"h_max", s.mesh.h_max}, {"h_min", s.mesh.h_min}};
}

Json dofs_section(const Summary& s) {
  return {{"displacement_nodal", s.dofs.displacement_nodal},
          {"displacement_bubble", s.dofs.displacement_bubble},
          {"multiplier", s.dofs.multiplier},
          {"pressure", s.dofs.pressure},
          {"total", s.dofs.total},
          {"solved", s.dofs.solved}};
}

Json active_set_section(const Summary& s) {
  return {{"open", s.active_set.open},
          {"stick", s.active_set.stick},
          {"slip", s.active_set.slip},
          {"cycles_detected", s.active_set.cycles_detected}};
}

Json errors_section(const Summary& s) {
  return {{"displacement_l2", number(s.errors.displacement_l2)},
          {"gradient_l2", number(s.errors.gradient_l2)},
          {"multiplier_normal_l2", number(s.errors.multiplier_normal_l2)},
          {"multiplier_tangential_l2", number(s.errors.multiplier_tangential_l2)},
          {"jump_normal_l2", number(s.errors.jump_normal_l2)},
          {"jump_tangential_l2", number(s.errors.jump_tangential_l2)},
          {"pressure_l2", number(s.errors.pressure_l2)},
          {"flux_l2", number(s.errors.flux_l2)}};
}

Json extremes_section(const Summary& s) {
  return {{"max_slip", number(s.extremes.max_slip)},
          {"max_opening", number(s.extremes.max_opening)},
          {"min_pressure", number(s.extremes.min_pressure)},
          {"max_pressure", number(s.extremes.max_pressure)},
          {"mean_pressure", number(s.extremes.mean_pressure)}};
}

Json seconds_section(const Summary& s) {
  return {{"total", s.seconds.total},       {"read", s.seconds.read},         {"partition", s.seconds.partition},
          {"assemble", s.seconds.assemble}, {"condense", s.seconds.condense}, {"solve", s.seconds.solve},
          {"write", s.seconds.write}};
}

Json imbalance_section(const Summary& s) {
  return {{"cells", number(s.imbalance.cells)},
          {"unknowns", number(s.imbalance.unknowns)},
          {"assembly", number(s.imbalance.assembly)}};
}

Json kernels_section(const Summary& s) {
  Json section = Json::object();
  for (const Summary::Kernel& kernel : s.kernels)
    section[kernel.field][kernel.name] = {{"seconds", kernel.seconds}, {"flops", kernel.flops}, {"bytes", kernel.bytes}};
  return section;
}

}  // namespace

std::optional<double> Summary::bytes_per_unknown() const {
  if (peak_memory_mb_per_rank.empty() || dofs.total == 0) return std::nullopt;
  const double megabytes = std::accumulate(peak_memory_mb_per_rank.begin(), peak_memory_mb_per_rank.end(), 0.0);
  return megabytes * 1024 * 1024 / static_cast<double>(dofs.total);
}

void write_summary(const Summary& s, const std::filesystem::path& file) {
  Json json = run_section(s);
  json["mesh"] = mesh_section(s);
  json["dofs"] = dofs_section(s);
  json["steps"] = {{"accepted", s.steps.accepted}, {"rejected", s.steps.rejected}};
  json["newton"] = {{"total", s.newton.total}, {"max_per_step", s.newton.max_per_step}};
  json["krylov"] = {{"total", s.krylov.total}, {"max_per_solve", s.krylov.max_per_solve}};
  json["setups"] = {{"preconditioner", s.setups.preconditioner}, {"factorisation", s.setups.factorisation}};
  json["active_set"] = active_set_section(s);
  json["balance"] = {{"mass_error_max", number(s.balance.mass_error_max)},
                     {"energy_violation_max", number(s.balance.energy_violation_max)}};
  json["errors"] = errors_section(s);
  json["extremes"] = extremes_section(s);
  json["seconds"] = seconds_section(s);
  json["imbalance"] = imbalance_section(s);
  json["kernels"] = kernels_section(s);
  json["peak_memory_mb_per_rank"] = s.peak_memory_mb_per_rank;
  json["bytes_per_unknown"] = number(s.bytes_per_unknown());
  // `replace`: a message with broken UTF-8 (a path, say) must not cost the summary.
  write_atomically(file, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace polyslip::io
