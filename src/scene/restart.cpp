#include "polyslip/scene/restart.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/la/vec_access.hpp"
#include "polyslip/scene/report.hpp"
#include "polyslip/scene/value.hpp"

namespace polyslip::scene {

namespace {

using io::Checkpoint;
using io::CheckpointTable;

std::span<const GlobalIndex> owned(std::span<const GlobalIndex> numbers, Index count) {
  return numbers.first(static_cast<std::size_t>(count));
}

std::vector<double> slice(Vec v, Index first, Index count) {
  const la::VecRead a(v);
  return {a.data() + first, a.data() + first + count};
}

/// The table that holds the pressures of one kind of entity.
struct PressureTable {
  const char* name;
  const mesh::Numbering& numbering;
  std::span<const GlobalIndex> numbers;
  Index (assembly::FlowLayout::*unknown)(Index) const;
};

std::vector<PressureTable> pressure_tables(const assembly::FlowSystem& flow) {
  const mesh::DistributedMesh& mesh = flow.mesh();
  using assembly::FlowLayout;
  std::vector<PressureTable> tables{{"pressure_cell", mesh.cells, mesh.cell_input, &FlowLayout::cell},
                                    {"pressure_trace", mesh.flow.traces, mesh.flow.trace_input, &FlowLayout::trace}};
  if (!flow.layout().with_fractures()) return tables;
  tables.push_back({"pressure_fracture", mesh.fractures, mesh.fracture_face_input, &FlowLayout::fracture});
  tables.push_back({"pressure_ridge", mesh.flow.ridges, mesh.flow.ridge_input, &FlowLayout::ridge});
  return tables;
}

/// Names of tables of the state before the accepted one begin with this.
constexpr const char* before = "before_";

void save_displacement(const assembly::MechanicsSystem& system, Vec x, const std::string& prefix, std::vector<CheckpointTable>& tables) {
  const assembly::Layout& layout = system.layout();
  const mesh::DistributedMesh& mesh = system.mesh();
  tables.push_back({prefix + "displacement", layout.dim(), owned(mesh.copy_input, mesh.copies.owned), slice(x, 0, layout.nodal_size())});
  if (layout.bubbles() == spaces::Bubbles::all)
    tables.push_back({prefix + "normal_bubble", 1, layout.normal_input(),
                      slice(x, layout.nodal_size(), layout.displacement_size() - layout.nodal_size())});
  if (mesh.fractures.total == 0) return;
  const auto faces = owned(mesh.fracture_face_input, mesh.fractures.owned);
  tables.push_back({prefix + "bubble", layout.dim(), faces, slice(x, layout.bubble_start(), layout.fracture_size())});
  tables.push_back({prefix + "multiplier", layout.dim(), faces, slice(x, layout.multiplier_start(), layout.fracture_size())});
}

void save_mechanics(const assembly::MechanicsSystem& system, Vec x, std::vector<CheckpointTable>& tables) {
  save_displacement(system, x, "", tables);
  const mesh::DistributedMesh& mesh = system.mesh();
  if (mesh.fractures.total == 0) return;
  const auto faces = owned(mesh.fracture_face_input, mesh.fractures.owned);
  const auto save_jumps = [&](const char* name, std::span<const Vec3> jumps) {
    std::vector<double> values;
    for (const Vec3& jump : jumps.first(faces.size())) values.insert(values.end(), jump.begin(), jump.end());
    tables.push_back({name, 3, faces, std::move(values)});
  };
  save_jumps("previous_jump", system.previous_jumps());
  save_jumps("initial_jump", system.initial_jumps());
}

void resume_displacement(const Checkpoint& checkpoint, const assembly::MechanicsSystem& system, const std::string& prefix, Vec x) {
  const mesh::DistributedMesh& mesh = system.mesh();
  const int dim = system.layout().dim();
  assembly::MechanicalState state = system.layout().create_state();
  const auto resume = [&](const char* table, int components, std::span<const GlobalIndex> numbers, Index first) {
    const std::vector<double> values = checkpoint.rows(prefix + table, components, numbers);
    std::copy(values.begin(), values.end(), state.displacement.begin() + first);
  };
  resume("displacement", dim, owned(mesh.copy_input, mesh.copies.owned), 0);
  if (system.layout().bubbles() == spaces::Bubbles::all) resume("normal_bubble", 1, system.layout().normal_input(), system.layout().nodal_size());
  if (mesh.fractures.total > 0) {
    state.bubble = checkpoint.rows(prefix + "bubble", dim, mesh.fracture_face_input);
    state.multiplier = checkpoint.rows(prefix + "multiplier", dim, mesh.fracture_face_input);
  }
  system.layout().scatter(state, x);
}

void resume_mechanics(const Checkpoint& checkpoint, assembly::MechanicsSystem& system, Vec x) {
  resume_displacement(checkpoint, system, "", x);
  const mesh::DistributedMesh& mesh = system.mesh();
  const auto& faces = mesh.fracture_face_input;
  if (mesh.fractures.total > 0) {
    const auto jumps = [&](const char* name) {
      const std::vector<double> values = checkpoint.rows(name, 3, faces);
      std::vector<Vec3> vectors;
      for (std::size_t f = 0; f < faces.size(); ++f) vectors.emplace_back(values[3 * f], values[3 * f + 1], values[3 * f + 2]);
      return vectors;
    };
    system.set_previous_jumps(jumps("previous_jump"));
    system.set_initial_jumps(jumps("initial_jump"));
  }
}

void save_flow(const assembly::FlowSystem& flow, Vec q, const std::string& prefix, std::vector<CheckpointTable>& tables) {
  const la::VecRead a(q);
  for (const PressureTable& table : pressure_tables(flow)) {
    std::vector<double> values;
    for (Index i = 0; i < table.numbering.owned; ++i) values.push_back(a[(flow.layout().*table.unknown)(i)]);
    tables.push_back({prefix + table.name, 1, owned(table.numbers, table.numbering.owned), std::move(values)});
  }
}

void resume_flow(const Checkpoint& checkpoint, const assembly::FlowSystem& flow, const std::string& prefix, Vec q) {
  const la::VecWrite a(q);
  for (const PressureTable& table : pressure_tables(flow)) {
    const auto values = checkpoint.rows(prefix + table.name, 1, owned(table.numbers, table.numbering.owned));
    for (Index i = 0; i < table.numbering.owned; ++i) a[(flow.layout().*table.unknown)(i)] = values[static_cast<std::size_t>(i)];
  }
}

/// What a coupled step starts from beside the accepted state; nothing where there is no such state.
void save_before(const solver::CoupledStep& step, const Model& model, io::CheckpointValues& values, std::vector<CheckpointTable>& tables) {
  const solver::CoupledStep::Before state = step.before();
  if (state.size <= 0) return;
  values.scalars["before_size"] = state.size;
  save_displacement(*model.mechanics(), state.x, before, tables);
  save_flow(*model.flow(), state.q, before, tables);
}

void resume_before(const Checkpoint& checkpoint, const Model& model, solver::CoupledStep& step) {
  if (!checkpoint.has_scalar("before_size")) return;
  solver::CoupledStep::Before state = step.before();
  state.size = checkpoint.scalar("before_size");
  resume_displacement(checkpoint, *model.mechanics(), before, state.x);
  resume_flow(checkpoint, *model.flow(), before, state.q);
  step.restore_before(state);
}

/// The counters of all runs so far by their names in the checkpoint.
template <class Visit>
void visit_counters(io::Summary& s, Visit&& visit) {
  visit("krylov_total", s.krylov.total);
  visit("krylov_max", s.krylov.max_per_solve);
  visit("preconditioner_setups", s.setups.preconditioner);
  visit("factorisations", s.setups.factorisation);
  visit("cycles", s.active_set.cycles_detected);
}

template <class Visit>
void visit_steps(solver::StepperState& s, Visit&& visit) {
  visit("time", s.time);
  visit("step_size", s.size);
  visit("steps_accepted", s.accepted);
  visit("steps_rejected", s.rejected);
  visit("newton_total", s.newton_total);
  visit("newton_max", s.newton_max);
}

void check_mesh(const Checkpoint& checkpoint, const std::string& name, const Model& model) {
  const mesh::DistributedMesh& mesh = model.mesh();
  const auto check = [&](const char* table, GlobalIndex total, const char* entities) {
    if (const GlobalIndex found = checkpoint.total_rows(table); found != total)
      throw InputError(fmt::format("the checkpoint is of another mesh: it has {} {}, the mesh {}", found, entities, total), name,
                       "Restore the mesh, or run from the beginning without -restart");
  };
  if (model.mechanics()) check("displacement", mesh.copies.total, "node copies");
  if (model.flow()) check("pressure_cell", mesh.cells.total, "cells");
}

void check_scene(const Checkpoint& checkpoint, const std::string& name, const Scene& scene) {
  const std::string difference = scene_difference(checkpoint.text("scene"), resolved_yaml(scene));
  if (!difference.empty())
    throw InputError("the checkpoint is of another scene: " + difference, name,
                     "Restore the scene (time.end and output may change), or go on with the new one by -restart_changed_scene");
}

std::string text_of(const Value& value) {
  return value.is_scalar() ? "\"" + value.text + "\"" : value.is_null() ? "nothing" : value.is_map() ? "a map" : "a list";
}

std::string difference(const Value& was, const Value& is, const std::string& path) {
  if (was.kind != is.kind || was.text != is.text) return fmt::format("{} was {} and is {}", path, text_of(was), text_of(is));
  const Value nothing = Value::nothing("");
  const auto below = [&](const std::string& key) { return path.empty() ? key : path + "." + key; };
  if (was.is_map()) {
    for (const Value* one : {&was, &is})
      for (const std::string& key : one->keys) {
        const Value *a = was.find(key), *b = is.find(key);
        const std::string found = difference(a != nullptr ? *a : nothing, b != nullptr ? *b : nothing, below(key));
        if (!found.empty()) return found;
      }
    return "";
  }
  if (was.items.size() != is.items.size())
    return fmt::format("{} had {} entries and has {}", path, was.items.size(), is.items.size());
  for (std::size_t i = 0; i < was.items.size(); ++i) {
    const std::string found = difference(was.items[i], is.items[i], fmt::format("{}[{}]", path, i));
    if (!found.empty()) return found;
  }
  return "";
}

/// Without what a continuation may change.
Value fixed_part(const std::string& resolved) {
  Value scene = parse_yaml(resolved, "checkpoint");
  for (const char* key : {"name", "description", "output"}) scene.erase(key);
  if (Value* time = scene.find("time")) {
    time->erase("end");
    time->erase("outputs");
  }
  return scene;
}

}  // namespace

std::string scene_difference(const std::string& was, const std::string& is) {
  return difference(fixed_part(was), fixed_part(is), "");
}

void save_run(const std::filesystem::path& file, const Scene& scene, const Model& model, const solver::StepperState& steps,
              const io::Summary& summary) {
  io::CheckpointValues values;
  values.texts = {{"scene", resolved_yaml(scene)}, {"version", POLYSLIP_VERSION}};
  const auto save = [&](const char* name, auto& value) { values.scalars[name] = static_cast<double>(value); };
  io::Summary counters = summary;
  add_solver_counters(counters, model);
  visit_counters(counters, save);
  solver::StepperState state = steps;
  visit_steps(state, save);
  const Model::Memory memory = model.memory();
  values.scalars["load_fraction"] = memory.load_fraction;
  values.scalars["flow_step"] = memory.flow_step;
  values.scalars["largest_turnover"] = memory.turnover;
  values.scalars["ranks"] = mpi::size(model.mesh().comm);
  if (summary.balance.mass_error_max) values.scalars["mass_error_max"] = *summary.balance.mass_error_max;
  if (summary.balance.energy_violation_max) values.scalars["energy_violation_max"] = *summary.balance.energy_violation_max;
  std::vector<CheckpointTable> tables;
  if (model.mechanics()) save_mechanics(*model.mechanics(), model.displacement().accepted, tables);
  if (model.flow()) save_flow(*model.flow(), model.pressure().accepted, "", tables);
  if (model.coupled_step() != nullptr) save_before(*model.coupled_step(), model, values, tables);
  io::write_checkpoint(model.mesh().comm, file, values, tables);
}

solver::StepperState resume_run(const io::Checkpoint& checkpoint, const std::string& name, const Scene& scene, Model& model,
                                io::Summary& summary, bool may_differ) {
  if (!may_differ) check_scene(checkpoint, name, scene);
  check_mesh(checkpoint, name, model);
  if (model.mechanics()) resume_mechanics(checkpoint, *model.mechanics(), model.displacement().accepted);
  if (model.flow()) resume_flow(checkpoint, *model.flow(), "", model.pressure().accepted);
  const auto resume = [&](const char* scalar, auto& value) {
    value = static_cast<std::remove_reference_t<decltype(value)>>(checkpoint.scalar(scalar));
  };
  solver::StepperState steps;
  visit_steps(steps, resume);
  visit_counters(summary, resume);
  for (auto [scalar, value] : {std::pair("mass_error_max", &summary.balance.mass_error_max),
                               std::pair("energy_violation_max", &summary.balance.energy_violation_max)})
    if (checkpoint.has_scalar(scalar)) *value = checkpoint.scalar(scalar);
  model.resume(steps.time, {checkpoint.scalar("load_fraction"), checkpoint.scalar("flow_step"), checkpoint.scalar("largest_turnover")});
  if (model.coupled_step() != nullptr) resume_before(checkpoint, model, *model.coupled_step());
  return steps;
}

}  // namespace polyslip::scene
