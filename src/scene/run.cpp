#include "polyslip/scene/run.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <sys/resource.h>

#include <csignal>
#include <fstream>
#include <iostream>

#include "polyslip/assembly/error_norms.hpp"
#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/io/csv.hpp"
#include "polyslip/io/field_writer.hpp"
#include "polyslip/io/summary.hpp"
#include "polyslip/la/log_stage.hpp"
#include "polyslip/mesh/readers.hpp"
#include "polyslip/scene/scene.hpp"
#include "polyslip/solver/mechanics_step.hpp"

namespace polyslip::scene {

namespace {

volatile std::sig_atomic_t stop_signal = 0;

/// Lines on rank 0, flushed at once.
class Log {
 public:
  explicit Log(MPI_Comm comm) : speaks_(mpi::rank(comm) == 0) {}
  template <class... Args>
  void line(fmt::format_string<Args...> format, Args&&... args) const {
    if (speaks_) fmt::print(std::cout, "{}\n", fmt::format(format, std::forward<Args>(args)...));
    if (speaks_) std::cout.flush();
  }

 private:
  bool speaks_;
};

Scene read_scene(MPI_Comm comm, const CommandLine& line) {
  std::string text;
  mpi::on_root(comm, [&] {
    std::ifstream in(line.scene, std::ios::binary);
    if (!in) throw InputError("the file cannot be read", line.scene.string(), "Check the path of the scene");
    text.assign(std::istreambuf_iterator<char>(in), {});
  });
  return parse_scene(mpi::broadcast(comm, text), line.scene, line.overrides);
}

/// The whole mesh with fractures and copies, on rank 0.
mesh::PolyMesh build_serial_mesh(MPI_Comm comm, const Scene& scene, const std::filesystem::path& directory) {
  mesh::PolyMesh mesh;
  mpi::on_root(comm, [&] {
    mesh = scene.mesh.box ? mesh::make_box(*scene.mesh.box) : mesh::read_mesh(scene.mesh.file);
    check_against_mesh(scene, mesh);
    mesh::mark_fractures(mesh, scene.fractures);
    mesh::build_copies(mesh);
    if (!scene.mesh.write.empty() && !directory.empty()) mesh::write_native(mesh, directory / scene.mesh.write);
  });
  return mesh;
}

void make_directory(MPI_Comm comm, const std::filesystem::path& directory) {
  mpi::on_root(comm, [&] {
    std::error_code error;
    std::filesystem::create_directories(directory, error);
    if (error || !std::filesystem::is_directory(directory))
      throw InputError("the output directory cannot be made: " + error.message(), directory.string(), "Choose another with -o DIR");
  });
}

void write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file);
  out << text;
  out.flush();
  if (!out)
    throw InputError("the file cannot be written", file.string(), "Check free space and permissions, or choose another -o DIR");
}

/// Everything that one run keeps between its steps.
class Run {
 public:
  Run(MPI_Comm comm, const Scene& scene, const std::filesystem::path& directory);
  ExitCode execute();

 private:
  void describe();
  void open_tables();
  void on_newton(const solver::NewtonRecord& record);
  void on_solved(const solver::StepRecord& record);
  void write_fields(double time);
  void summarise(const solver::StepperResult& result, const solver::StepperState& steps);

  MPI_Comm comm_;
  const Scene& scene_;
  std::filesystem::path directory_;
  Log log_;
  io::Summary summary_;
  double begin_ = MPI_Wtime();
  std::optional<mesh::DistributedMesh> mesh_;
  std::optional<assembly::MechanicsSystem> system_;
  std::optional<solver::ContactNewton> newton_;
  std::optional<solver::MechanicsStep> steps_;
  std::optional<io::FieldWriter> writer_;
  std::vector<assembly::PointProbe> probes_;
  Vec x_ = nullptr;  ///< The state to show.
  io::CsvTable history_, newton_table_;
  int step_ = 1;
  double last_time_ = 0, last_written_ = -1e300;
};

Run::Run(MPI_Comm comm, const Scene& scene, const std::filesystem::path& directory)
    : comm_(comm), scene_(scene), directory_(directory), log_(comm) {
  auto& seconds = summary_.seconds;
  mesh::PolyMesh serial;
  {
    const la::LogStage stage("read", seconds.read);
    serial = build_serial_mesh(comm, scene, directory);
  }
  {
    const la::LogStage stage("partition", seconds.partition);
    mesh_ = mesh::distribute(comm, std::move(serial));
  }
  {
    const la::LogStage stage("assemble", seconds.assemble);
    system_.emplace(*mesh_, scene.mechanics);
    newton_.emplace(*system_);
    steps_.emplace(*system_, *newton_);
    x_ = steps_->trial();
  }
  {
    const la::LogStage stage("write", seconds.write);
    writer_.emplace(*mesh_, directory);
    open_tables();
  }
  for (const Probe& probe : scene.output.probes) probes_.emplace_back(*mesh_, probe.at);
  newton_->monitor = [this](const solver::NewtonRecord& record) { on_newton(record); };
  describe();
}

void Run::describe() {
  auto& s = summary_;
  const mesh::DistributedMesh& m = *mesh_;
  double smallest = 1e300, largest = 0;
  spaces::VemCell vem(m.mesh);
  for (Index cell = 0; cell < m.cells.owned; ++cell) {
    vem.build(cell);
    smallest = std::min(smallest, vem.diameter());
    largest = std::max(largest, vem.diameter());
  }
  const long long dim = m.mesh.dim;
  s.scene = scene_.name;
  s.version = POLYSLIP_VERSION;
  s.ranks = mpi::size(comm_);
  s.mesh = {static_cast<int>(dim),    m.cells.total, m.total_faces, m.total_nodes, m.fractures.total, mpi::max(comm_, largest),
            mpi::min(comm_, smallest)};
  s.dofs.displacement_nodal = dim * m.copies.total;
  s.dofs.displacement_bubble = s.dofs.multiplier = dim * m.fractures.total;
  s.dofs.total = s.dofs.displacement_nodal + 2 * s.dofs.multiplier;
  s.dofs.solved = scene_.mechanics.formulation == physics::Formulation::condensed ? s.dofs.displacement_nodal : s.dofs.total;
  log_.line("polyslip {} on {} rank{}: {}", POLYSLIP_VERSION, s.ranks, s.ranks == 1 ? "" : "s", scene_.name);
  log_.line("mesh: {}D, {} cells, {} faces, {} nodes, {} fracture faces, h {:.3g} to {:.3g} m", dim, s.mesh.cells, s.mesh.faces,
            s.mesh.nodes, s.mesh.fracture_faces, s.mesh.h_min, s.mesh.h_max);
  log_.line("unknowns: {} nodal + {} bubble + {} multiplier, {} solved", s.dofs.displacement_nodal, s.dofs.displacement_bubble,
            s.dofs.multiplier, s.dofs.solved);
  log_.line("{}", newton_->linear_choice());
}

void Run::open_tables() {
  if (mpi::rank(comm_) != 0) return;
  std::vector<std::string> columns{"step", "time",  "step_size", "newton",   "krylov",
                                   "open", "stick", "slip",      "max_slip", "max_opening"};
  for (const Probe& probe : scene_.output.probes)
    for (const char* c : {"_ux", "_uy", "_uz"}) columns.push_back(probe.name + c);
  history_ = io::CsvTable(directory_ / "history.csv", columns);
  newton_table_ = io::CsvTable(directory_ / "newton.csv", {"step", "iteration", "residual_momentum", "residual_contact", "open",
                                                           "stick", "slip", "changed", "step_length", "krylov"});
}

void Run::on_newton(const solver::NewtonRecord& r) {
  const auto& n = r.counts.faces;
  if (r.iteration == 0 && !r.remedy.empty()) log_.line("  remedy: {}", r.remedy);
  if (mesh_->fractures.total > 0)
    log_.line("  Newton {:2d}  momentum {:.2e}  contact {:.2e}  open {} stick {} slip {}  changed {}  alpha {:.3g}  Krylov {}",
              r.iteration, r.momentum, r.contact, n[0], n[1], n[2], r.changed, r.step_length, r.krylov);
  else
    log_.line("  iteration {:2d}  momentum {:.2e}  Krylov {}", r.iteration, r.momentum, r.krylov);
  if (mpi::rank(comm_) == 0)
    newton_table_.row({static_cast<double>(step_), static_cast<double>(r.iteration), r.momentum, r.contact,
                       static_cast<double>(n[0]), static_cast<double>(n[1]), static_cast<double>(n[2]),
                       static_cast<double>(r.changed), r.step_length, static_cast<double>(r.krylov)});
}

void Run::on_solved(const solver::StepRecord& record) {
  const auto values = assembly::fracture_values(*system_, x_);
  const auto extremes = assembly::fracture_extremes(*system_, values);
  const auto counts = system_->count(system_->states(x_));
  if (mesh_->fractures.total > 0) {
    summary_.extremes.max_slip = extremes.max_slip;
    summary_.extremes.max_opening = extremes.max_opening;
  }
  summary_.active_set.open = counts.faces[0];
  summary_.active_set.stick = counts.faces[1];
  summary_.active_set.slip = counts.faces[2];
  log_.line("step {}  t = {:g}  dt = {:g}  Newton {}  Krylov {}  max slip {:.4e} m  max opening {:.4e} m", record.number,
            record.time, record.size, record.newton, record.krylov, extremes.max_slip, extremes.max_opening);
  std::vector<double> row{static_cast<double>(record.number),
                          record.time,
                          record.size,
                          static_cast<double>(record.newton),
                          static_cast<double>(record.krylov),
                          static_cast<double>(counts.faces[0]),
                          static_cast<double>(counts.faces[1]),
                          static_cast<double>(counts.faces[2]),
                          extremes.max_slip,
                          extremes.max_opening};
  for (const assembly::PointProbe& probe : probes_) {
    const Vec3 u = probe.displacement(*system_, x_);
    row.insert(row.end(), {u[0], u[1], u[2]});
  }
  if (mpi::rank(comm_) == 0) history_.row(row);
  last_time_ = record.time;
  step_ = record.number + 1;
  if (record.number % scene_.output.every == 0) write_fields(record.time);
}

void Run::write_fields(double time) {
  if (time == last_written_) return;
  const la::LogStage stage("write", summary_.seconds.write);
  last_written_ = time;
  const auto stress = assembly::cell_stresses(*system_, x_);
  const auto displacement = assembly::copy_displacements(*system_, x_);
  std::vector<double> region, rank(static_cast<std::size_t>(mesh_->cells.owned), mpi::rank(comm_));
  for (Index cell = 0; cell < mesh_->cells.owned; ++cell) region.push_back(mesh_->mesh.cell_region[cell]);
  std::vector<io::Field> fields{{"displacement", io::Location::copy, 3, displacement},
                                {"stress", io::Location::cell, 6, stress},
                                {"region", io::Location::cell, 1, region},
                                {"rank", io::Location::cell, 1, rank}};
  // Fracture faces.
  std::vector<double> state, lam_n, lam_t, jump_n, jump_t, aperture, pressure, fracture, friction;
  const auto values = assembly::fracture_values(*system_, x_);
  for (Index f = 0; f < mesh_->fractures.owned; ++f) {
    const auto& v = values[f];
    state.push_back(static_cast<double>(v.state));
    lam_n.push_back(v.traction_normal);
    jump_n.push_back(v.jump_normal);
    lam_t.insert(lam_t.end(), v.traction_tangential.begin(), v.traction_tangential.end());
    jump_t.insert(jump_t.end(), v.jump_tangential.begin(), v.jump_tangential.end());
    aperture.push_back(-v.jump_normal);
    pressure.push_back(system_->loads().fracture_pressure[f]);
    fracture.push_back(mesh_->mesh.face_fracture[mesh_->fracture_faces[f]]);
    friction.push_back(system_->contact_cells().faces()[f].law.friction);
  }
  const auto on_face = io::Location::fracture_face;
  for (io::Field field : {io::Field{"friction_state", on_face, 1, state},
                          {"traction_normal", on_face, 1, lam_n},
                          {"traction_tangential", on_face, 3, lam_t},
                          {"jump_normal", on_face, 1, jump_n},
                          {"jump_tangential", on_face, 3, jump_t},
                          {"aperture", on_face, 1, aperture},
                          {"pressure", on_face, 1, pressure},
                          {"fracture", on_face, 1, fracture},
                          {"friction_coefficient", on_face, 1, friction}})
    fields.push_back(field);
  assembly::ExactFaceFields exact;
  if (scene_.exact) {
    exact = assembly::exact_face_fields(*system_, *scene_.exact, time);
    if (scene_.exact->jump_normal) fields.push_back({"jump_normal_exact", on_face, 1, exact.jump_normal});
    if (scene_.exact->jump_tangential) fields.push_back({"jump_tangential_exact", on_face, 3, exact.jump_tangential});
    if (scene_.exact->multiplier_normal) fields.push_back({"traction_normal_exact", on_face, 1, exact.traction_normal});
  }
  if (mesh_->fractures.total == 0) std::erase_if(fields, [&](const io::Field& field) { return field.on == on_face; });
  writer_->write(time, fields);
}

ExitCode Run::execute() {
  solver::TimeStepper stepper(*steps_, scene_.time);
  stepper.solved = [this](const solver::StepRecord& record) { on_solved(record); };
  stepper.rejected = [this](double time, double size, const std::string& reason) {
    log_.line("step to t = {:g} with dt = {:g} rejected: {}", time, size, reason);
  };
  stepper.stop_requested = newton_->stop_requested = [this] { return mpi::any(comm_, stop_signal != 0); };
  double contact_seconds = 0;
  solver::StepperResult result;
  {
    const la::LogStage stage("contact", contact_seconds);
    result = stepper.run();
  }
  if (stepper.state().accepted > 0) write_fields(last_time_);
  summarise(result, stepper.state());
  using End = solver::StepperResult::End;
  return result.end == End::finished ? exit_finished : result.end == End::stopped ? exit_stopped : exit_diverged;
}

void Run::summarise(const solver::StepperResult& result, const solver::StepperState& steps) {
  auto& s = summary_;
  using End = solver::StepperResult::End;
  s.status = result.end == End::finished ? "finished" : result.end == End::stopped ? "stopped" : "diverged";
  s.message = result.message;
  s.steps.accepted = steps.accepted;
  s.steps.rejected = steps.rejected;
  s.newton.total = steps.newton_total;
  s.newton.max_per_step = steps.newton_max;
  const solver::LinearCounts counts = newton_->linear_counts();
  s.krylov.total = counts.iterations;
  s.krylov.max_per_solve = counts.max_per_solve;
  s.setups.preconditioner = counts.setups;
  s.setups.factorisation = counts.factorisations;
  s.active_set.cycles_detected = newton_->cycles();
  s.seconds.condense = newton_->seconds().condense;
  s.seconds.solve = newton_->seconds().solve;
  if (scene_.exact && steps.accepted > 0) {
    const auto e = assembly::error_norms(*system_, *scene_.exact, last_time_, x_);
    s.errors.displacement_l2 = e.displacement;
    s.errors.gradient_l2 = e.gradient;
    s.errors.multiplier_normal_l2 = e.multiplier_normal;
    s.errors.multiplier_tangential_l2 = e.multiplier_tangential;
    s.errors.jump_normal_l2 = e.jump_normal;
    s.errors.jump_tangential_l2 = e.jump_tangential;
    const auto report = [&](const char* name, const std::optional<double>& value) {
      if (value) log_.line("relative L2 error of {}: {:.5e}", name, *value);
    };
    report("displacement", e.displacement);
    report("gradient", e.gradient);
    report("normal multiplier", e.multiplier_normal);
    report("tangential multiplier", e.multiplier_tangential);
    report("normal jump", e.jump_normal);
    report("tangential jump", e.jump_tangential);
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  s.peak_memory_mb_per_rank = mpi::all_gather(comm_, static_cast<double>(usage.ru_maxrss) / 1024);
  s.seconds.total = MPI_Wtime() - begin_;
  mpi::on_root(comm_, [&] { io::write_summary(s, directory_ / "summary.json"); });
  log_.line("{}: {} step{}, {} Newton iterations, {:.2f} s{}{}", s.status, s.steps.accepted, s.steps.accepted == 1 ? "" : "s",
            s.newton.total, s.seconds.total, s.message.empty() ? "" : ": ", s.message);
}

void write_resolved(MPI_Comm comm, const Scene& scene, const std::filesystem::path& directory) {
  mpi::on_root(comm, [&] {
    write_text(directory / "scene.resolved.yaml", resolved_yaml(scene));
    char* options = nullptr;
    POLYSLIP_PETSC(PetscOptionsGetAll(nullptr, &options));
    const std::string text = fmt::format("# polyslip {} on {} ranks\n{}\n", POLYSLIP_VERSION, mpi::size(comm), options);
    POLYSLIP_PETSC(PetscFree(options));
    write_text(directory / "options.resolved", text);
  });
}

void report_unused_options(const Log& log) {
  PetscInt n = 0;
  char **names = nullptr, **values = nullptr;
  POLYSLIP_PETSC(PetscOptionsLeftGet(nullptr, &n, &names, &values));
  for (PetscInt i = 0; i < n; ++i)
    log.line("warning: the option -{}{}{} was not used; check its spelling and prefix (polyslip -help)", names[i],
             values[i] != nullptr ? " " : "", values[i] != nullptr ? values[i] : "");
  POLYSLIP_PETSC(PetscOptionsLeftRestore(nullptr, &n, &names, &values));
}

}  // namespace

ExitCode run_scene(MPI_Comm comm, const CommandLine& line) {
  const Log log(comm);
  const Scene scene = read_scene(comm, line);
  if (line.validate) {
    build_serial_mesh(comm, scene, {});
    log.line("{}: the scene and its mesh are valid", line.scene.string());
    return exit_finished;
  }
  const std::filesystem::path directory = line.output.empty() ? std::filesystem::path(scene.name + ".out") : line.output;
  make_directory(comm, directory);
  for (int signal : {SIGTERM, SIGINT}) std::signal(signal, [](int) { stop_signal = 1; });
  Run run(comm, scene, directory);
  write_resolved(comm, scene, directory);
  const ExitCode code = run.execute();
  report_unused_options(log);
  return code;
}

}  // namespace polyslip::scene
