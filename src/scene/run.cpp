#include "polyslip/scene/run.hpp"

#include <csignal>
#include <new>

#include "polyslip/common/error.hpp"
#include "polyslip/la/log_stage.hpp"
#include "polyslip/scene/fields.hpp"
#include "polyslip/scene/lines.hpp"
#include "polyslip/scene/mesh_input.hpp"
#include "polyslip/scene/prepare.hpp"
#include "polyslip/scene/report.hpp"
#include "polyslip/scene/restart.hpp"
#include "polyslip/scene/warnings.hpp"

namespace polyslip::scene {

namespace {

volatile std::sig_atomic_t stop_signal = 0;

/// One run from mesh to summary, and what it keeps between its steps.
class Run {
 public:
  Run(MPI_Comm comm, const Scene& scene, const CommandLine& line, const OutputFolder& folder)
      : comm_(comm), scene_(scene), line_(line), folder_(folder), directory_(folder.path()), log_(comm) {}
  ExitCode execute();
  [[nodiscard]] bool has_results() const { return stepper_ && stepper_->state().accepted > begin_accepted_; }

 private:
  void read_and_partition();
  void assemble();
  void resume();
  void open_outputs();
  solver::StepperResult start();
  solver::StepperResult step();
  solver::StepperResult step_or_explain();
  void explain_failure(const std::string& why);
  void on_newton(const solver::NewtonRecord& record);
  void on_solved(const solver::StepRecord& record);
  void on_accepted(const solver::StepRecord& record);
  void write_fields(double time);
  void write_checkpoint();
  void show_progress() const;
  void finish(const solver::StepperResult& result);
  [[nodiscard]] bool is_stopping() const { return mpi::any(comm_, stop_signal != 0); }

  MPI_Comm comm_;
  const Scene& scene_;
  const CommandLine& line_;
  const OutputFolder& folder_;
  std::filesystem::path directory_;
  Log log_;
  io::Summary summary_;
  double begin_ = MPI_Wtime(), begin_steps_ = 0;  ///< Clock.
  double begin_time_ = 0;                         ///< Time of the scene at begin_steps_ [s].
  int begin_accepted_ = 0;                        ///< Steps accepted before this run.
  std::optional<mesh::DistributedMesh> mesh_;
  std::optional<Model> model_;
  std::optional<solver::TimeStepper> stepper_;
  std::optional<io::FieldWriter> writer_;
  std::optional<Tables> tables_;
  std::optional<LineTables> lines_;
  const std::map<std::string, std::string> given_options_ = unused_options();  ///< The user's: our defaults come later.
  StepFigures figures_;                 ///< Of the last accepted step.
  std::optional<double> last_written_;  ///< Time of the last fields [s].
  int last_checkpoint_ = -1;            ///< Its number of steps.
};

void Run::read_and_partition() {
  MeshInput input;
  {
    const la::LogStage stage("read", summary_.seconds.read);
    input = read_mesh(comm_, scene_, directory_);
  }
  const la::LogStage stage("partition", summary_.seconds.partition);
  mesh_ = distribute(comm_, std::move(input), scene_);
}

void Run::assemble() {
  const la::LogStage stage("assemble", summary_.seconds.assemble);
  model_.emplace(*mesh_, scene_);
  stepper_.emplace(model_->steps(), scene_.time);
}

/// Takes over what a checkpoint holds, where one is asked for.
void Run::resume() {
  if (!line_.restart) return;
  const la::LogStage stage("read", summary_.seconds.read);
  const std::filesystem::path file = line_.checkpoint.empty() ? directory_ / "checkpoint.h5" : line_.checkpoint;
  const io::Checkpoint checkpoint(comm_, file);
  stepper_->restore(resume_run(checkpoint, file.string(), scene_, *model_, summary_, line_.restart_changed_scene));
  figures_ = figures_of(*model_);
  add_figures(summary_, *model_, figures_);
}

void Run::open_outputs() {
  const la::LogStage stage("write", summary_.seconds.write);
  const solver::StepperState& state = stepper_->state();
  const bool goes_on = line_.restart;
  begin_accepted_ = state.accepted;
  folder_.begin_run(goes_on);
  writer_.emplace(*mesh_, directory_, goes_on ? std::optional(state.time) : std::nullopt);
  tables_.emplace(*mesh_, scene_, directory_, goes_on ? std::optional<double>(state.accepted) : std::nullopt);
  lines_.emplace(*mesh_, scene_, directory_, goes_on ? std::optional(state.time) : std::nullopt);
  last_written_ = writer_->last_time();
  write_resolved(comm_, scene_, directory_);
  if (goes_on) log_.line("going on from step {} at t = {:g}", state.accepted, state.time);
}

void Run::on_newton(const solver::NewtonRecord& record) {
  report_newton(log_, *model_, record);
  tables_->newton(stepper_->state().accepted + 1, record);
}

void Run::on_solved(const solver::StepRecord& record) {
  figures_ = figures_of(*model_);
  figures_.books = model_->books(record.size);
  add_figures(summary_, *model_, figures_);
  report_step(log_, *model_, record, figures_);
  tables_->step(*model_, record, figures_);
  const auto& outputs = scene_.time.outputs;
  if (record.number % scene_.output.every == 0 || std::find(outputs.begin(), outputs.end(), record.time) != outputs.end())
    write_fields(record.time);
}

void Run::write_fields(double time) {
  if (time == last_written_) return;
  const la::LogStage stage("write", summary_.seconds.write);
  scene::write_fields(*writer_, scene_, *model_, figures_, time);
  lines_->write(*model_, time);
  last_written_ = time;
}

void Run::on_accepted(const solver::StepRecord& record) {
  const int every = scene_.output.checkpoint_every;
  if (every > 0 && record.number % every == 0) write_checkpoint();
  show_progress();
}

void Run::write_checkpoint() {
  if (last_checkpoint_ == stepper_->state().accepted) return;
  const la::LogStage stage("write", summary_.seconds.write);
  save_run(directory_ / "checkpoint.h5", scene_, *model_, stepper_->state(), summary_);
  last_checkpoint_ = stepper_->state().accepted;
}

/// How far the run is, and how long the rest takes if it goes on as so far.
void Run::show_progress() const {
  const double time = stepper_->state().time, done = time - begin_time_, left = scene_.time.end - time;
  if (!log_.shows_progress() || left <= 0) return;
  log_.progress(fmt::format("{:.0f} % of the time, about {} left", 100 * (1 - left / (scene_.time.end - scene_.time.start)),
                            duration((MPI_Wtime() - begin_steps_) / done * left)));
}

solver::StepperResult Run::step() {
  if (model_->newton()) {
    model_->newton()->monitor = [this](const solver::NewtonRecord& record) { on_newton(record); };
    model_->newton()->stop_requested = [this] { return is_stopping(); };
  }
  stepper_->solved = [this](const solver::StepRecord& record) { on_solved(record); };
  stepper_->rejected = [this](double time, double size, const std::string& reason) {
    log_.line("step to t = {:g} with dt = {:g} rejected: {}", time, size, reason);
  };
  stepper_->stop_requested = [this] { return is_stopping(); };
  stepper_->accepted = [this](const solver::StepRecord& record) { on_accepted(record); };
  begin_steps_ = MPI_Wtime();
  begin_time_ = stepper_->state().time;
  double seconds = 0;
  const la::LogStage stage("contact", seconds);
  const solver::StepperResult started = start();
  return started.end == solver::StepperResult::End::finished ? stepper_->run() : started;
}

/// Input that only a later time shows to be bad (an expression that is not finite there) ends the run like a step that does not converge.
solver::StepperResult Run::step_or_explain() {
  try {
    return step();
  } catch (const InputError& error) {
    if (!has_results()) throw;
    return {solver::StepperResult::End::diverged, std::string(error.what()) + "; then go on with -restart_changed_scene"};
  } catch (const ResourceError& error) {
    explain_failure(error.what());
    throw;
  } catch (const std::bad_alloc&) {
    explain_failure(mpi::out_of_memory());
    throw;
  }
}

/// As much of a summary as the machine still lets us write.
void Run::explain_failure(const std::string& why) {
  const solver::StepperState& state = stepper_->state();
  log_.line("stopped after step {} at t = {:g}; {}", state.accepted, state.time,
            last_checkpoint_ < 0 ? std::string("no checkpoint has been written (output.checkpoint_every)")
                                 : fmt::format("-restart goes on from step {}", last_checkpoint_));
  if (mpi::rank(comm_) != 0) return;
  summary_.status = "stopped";
  summary_.message = why;
  summary_.steps = {state.accepted, state.rejected};
  try {
    io::write_summary(summary_, directory_ / "summary.json");
  } catch (const std::exception&) {  // what goes wrong has been said
  }
}

/// The equilibrium that a scene may ask for, at the beginning of the first run.
solver::StepperResult Run::start() {
  if (line_.restart) return {};
  const solver::StepOutcome found = model_->find_equilibrium([this](const solver::NewtonRecord& record) { on_newton(record); });
  if (found.converged) return {};
  return {solver::StepperResult::End::diverged, "no equilibrium to start from: " + found.message};
}

void Run::finish(const solver::StepperResult& result) {
  const solver::StepperState& state = stepper_->state();
  if (state.accepted > 0) {
    write_fields(state.time);
    try {
      report_errors(log_, summary_, scene_, *model_, state.time);
    } catch (const InputError& error) {  // the results are there all the same
      log_.line("warning: no errors are given: {}", error.what());
    }
  }
  if (state.accepted > 0 || result.end == solver::StepperResult::End::stopped) write_checkpoint();
  add_counters(summary_, *model_, result, state);
  summary_.seconds.total = MPI_Wtime() - begin_;
  mpi::on_root(comm_, [&] { io::write_summary(summary_, directory_ / "summary.json"); });
  log_.line("{}", closing_line(summary_));
}

ExitCode Run::execute() {
  read_and_partition();
  assemble();
  report_start(log_, summary_, scene_, *model_);
  report_unusual_values(log_, scene_);
  report_warnings(log_, scene_, *model_);
  resume();
  open_outputs();
  const solver::StepperResult result = step_or_explain();
  finish(result);
  report_unused_options(log_, given_options_);
  using End = solver::StepperResult::End;
  return result.end == End::finished ? exit_finished : result.end == End::stopped ? exit_stopped : exit_diverged;
}

/// All that a run does, and may be refused for, before it resumes and steps.
ExitCode validate(MPI_Comm comm, const Scene& scene, const std::filesystem::path& file) {
  const mesh::DistributedMesh mesh = distribute(comm, read_mesh(comm, scene, {}), scene);
  const Model model(mesh, scene);
  const Log log(comm);
  report_unusual_values(log, scene);
  report_warnings(log, scene, model);
  log.line("{}: the scene and its mesh are valid", file.string());
  return exit_finished;
}

}  // namespace

ExitCode run_scene(MPI_Comm comm, const CommandLine& line) {
  const Scene scene = read_scene(comm, line);
  if (line.validate) return validate(comm, scene, line.scene);
  const std::filesystem::path directory = line.output.empty() ? std::filesystem::path(scene.name + ".out") : line.output;
  const OutputFolder folder(comm, directory);
  for (int signal : {SIGTERM, SIGINT}) std::signal(signal, [](int) { stop_signal = 1; });
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files then is an error like a full disk
  Run run(comm, scene, line, folder);
  try {
    return run.execute();
  } catch (const InputError&) {
    if (!run.has_results()) folder.restore();
    throw;
  }
}

}  // namespace polyslip::scene
