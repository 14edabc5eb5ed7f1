#include "polyslip/scene/tables.hpp"

#include <fmt/format.h>

#include <array>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"

namespace polyslip::scene {

namespace {

/// Behind the name of a window, in the order of Tables::add_windows.
constexpr std::array window_columns{"_normal",   "_tangential", "_slip",           "_pressure",
                                    "_aperture", "_ratio",      "_nearest_normal", "_nearest_tangential"};

std::vector<std::string> history_columns(const Scene& scene) {
  std::vector<std::string> columns{"step",  "time", "step_size", "newton",      "krylov",        "open",
                                   "stick", "slip", "max_slip",  "max_opening", "slip_integral", "opening_integral",
                                   "slipped_area", "seismic_moment"};
  for (const Probe& probe : scene.output.probes)
    for (const char* c : {"_ux", "_uy", "_uz"})
      if (scene.has_mechanics) columns.push_back(probe.name + c);
  if (scene.flow) {
    const auto books = Model::book_names(scene);
    columns.insert(columns.end(), books.begin(), books.end());
    columns.insert(columns.end(), {"min_pressure", "mean_pressure", "max_pressure"});
    for (const std::string& name : assembly::boundary_names(*scene.flow))
      for (const char* c : {"_outflow", "_pressure"}) columns.push_back(name + c);
    for (const Probe& probe : scene.output.probes) columns.push_back(probe.name + "_p");
  }
  for (const Window& window : scene.output.windows)
    for (const char* column : window_columns) columns.push_back(window.name + column);
  return columns;
}

const std::vector<std::string> newton_columns{"step",  "iteration", "residual_momentum", "residual_contact", "open",
                                              "stick", "slip",      "changed",           "step_length",      "krylov", "window_steps"};

double number(long long count) { return static_cast<double>(count); }

}  // namespace

StepFigures figures_of(const Model& model) {
  StepFigures figures;
  if (model.has_contact()) {
    const assembly::MechanicsSystem& system = *model.mechanics();
    figures.fractures = assembly::fracture_values(system, model.displacement().trial);
    figures.extremes = assembly::fracture_extremes(system, figures.fractures);
    figures.counts = system.count(system.states(model.displacement().trial));
  }
  if (model.flow()) figures.pressure = assembly::pressure_extremes(*model.flow(), model.pressure().trial);
  return figures;
}

Tables::Tables(const mesh::DistributedMesh& mesh, const Scene& scene, const std::filesystem::path& directory,
               std::optional<double> kept_steps) {
  std::vector<Vec3> points;
  for (const Probe& probe : scene.output.probes) points.push_back(probe.at);
  if (scene.has_mechanics) displacement_probes_.emplace(mesh, points);
  if (scene.flow) pressure_probes_.emplace(mesh, points);
  for (const Window& window : scene.output.windows) {
    windows_.emplace_back(mesh, window.rule);
    if (windows_.back().area() == 0)
      throw InputError(fmt::format("the window \"{}\" holds no fracture face", window.name), window.place,
                       "Choose a where that is non-zero at centres of fracture faces");
  }
  mpi::on_root(mesh.comm, [&] {
    history_ = io::CsvTable(directory / "history.csv", history_columns(scene), kept_steps);
    newton_ = io::CsvTable(directory / "newton.csv", newton_columns, kept_steps);
  });
}

void Tables::step(const Model& model, const solver::StepRecord& record, const StepFigures& figures) {
  const auto& faces = figures.counts.faces;
  std::vector<double> row{number(record.number),
                          record.time,
                          record.size,
                          number(record.newton),
                          number(record.krylov),
                          number(faces[0]),
                          number(faces[1]),
                          number(faces[2]),
                          figures.extremes.max_slip,
                          figures.extremes.max_opening,
                          figures.extremes.slip_integral,
                          figures.extremes.opening_integral,
                          figures.extremes.slipped_area,
                          figures.extremes.seismic_moment};
  const auto append = [&row](const std::vector<double>& values) { row.insert(row.end(), values.begin(), values.end()); };
  if (displacement_probes_) append(displacement_probes_->displacements(*model.mechanics(), model.displacement().trial));
  if (model.flow()) {
    append(figures.books->values);
    row.insert(row.end(), {figures.pressure->min, figures.pressure->mean, figures.pressure->max});
    for (const auto& [outflow, pressure] : assembly::boundary_figures(*model.flow(), model.pressure().trial))
      row.insert(row.end(), {outflow, pressure});
    append(pressure_probes_->pressures(*model.flow(), model.pressure().trial));
  }
  if (!windows_.empty()) add_windows(model, figures, row);
  history_.row(row);
}

void Tables::add_windows(const Model& model, const StepFigures& figures, std::vector<double>& row) const {
  std::vector<double> pressures;
  if (model.flow()) pressures = assembly::fracture_pressures(*model.flow(), model.pressure().trial);
  const std::vector<double> apertures = model.apertures();
  for (const assembly::FractureWindow& window : windows_) {
    const auto v = window.values(*model.mechanics(), figures.fractures, pressures, apertures);
    row.insert(row.end(), {v.traction_normal, v.traction_tangential, v.slip, v.pressure, v.aperture, v.nearest_ratio, v.nearest_normal,
                           v.nearest_tangential});
  }
}

void Tables::newton(int step, const solver::NewtonRecord& r) {
  const auto& faces = r.counts.faces;
  newton_.row({number(step), number(r.iteration), r.momentum, r.contact, number(faces[0]), number(faces[1]), number(faces[2]),
               number(r.changed), r.step_length, number(r.krylov), number(r.window_steps)});
}

}  // namespace polyslip::scene
