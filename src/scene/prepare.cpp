#include "polyslip/scene/prepare.hpp"

#include <unistd.h>

#include <cerrno>
#include <fstream>

#include "polyslip/common/error.hpp"
#include "polyslip/io/checkpoint.hpp"
#include "polyslip/la/handle.hpp"
#include "polyslip/mesh/readers.hpp"

namespace polyslip::scene {

namespace {

void write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file);
  out << text;
  out.flush();
  if (!out) throw ResourceError(file.string() + ": the file cannot be written. Check free space and permissions, or choose another -o DIR");
}

}  // namespace

Scene read_scene(MPI_Comm comm, const CommandLine& line) {
  std::string text;
  mpi::on_root(comm, [&] { text = read_scene_text(line.scene); });
  return parse_scene(mpi::broadcast(comm, text), line.scene, line.overrides);
}

void report_unusual_values(const Log& log, const Scene& scene) {
  for (const std::string& warning : scene.warnings) log.line("warning: {}", warning);
}

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

mesh::PartitionOptions partition_options(const Scene& scene) {
  mesh::PartitionOptions options;
  options.flow = scene.flow.has_value() || scene.mechanics.bubbles == spaces::Bubbles::all;
  return options;
}

OutputFolder::OutputFolder(MPI_Comm comm, std::filesystem::path path) : comm_(comm), path_(std::move(path)) {
  mpi::on_root(comm, [&] {
    std::error_code error;
    was_there_ = std::filesystem::exists(path_, error);
    std::filesystem::create_directories(path_, error);
    if (error || !std::filesystem::is_directory(path_))
      throw InputError("the output directory cannot be made: " + error.message(), path_.string(), "Choose another with -o DIR");
    if (access(path_.c_str(), W_OK | X_OK) != 0)
      throw InputError(fmt::format("the output directory cannot be written to: {}", std::generic_category().message(errno)),
                       path_.string(), "Change its permissions, or choose another with -o DIR");
    for (const auto& entry : std::filesystem::directory_iterator(path_)) before_.insert(entry.path());
  });
}

void OutputFolder::begin_run(bool goes_on) const {
  mpi::on_root(comm_, [&] {
    std::filesystem::remove(path_ / "summary.json");
    const std::filesystem::path checkpoint = path_ / "checkpoint.h5";
    if (!goes_on && std::filesystem::exists(checkpoint)) std::filesystem::rename(checkpoint, io::previous_checkpoint(checkpoint));
  });
}

void OutputFolder::restore() const {
  if (mpi::rank(comm_) != 0) return;
  std::error_code error;  // what cannot be removed stays
  for (const auto& entry : std::filesystem::directory_iterator(path_, error))
    if (!before_.contains(entry.path())) std::filesystem::remove(entry.path(), error);
  if (!was_there_) std::filesystem::remove(path_, error);
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

std::map<std::string, std::string> unused_options() {
  PetscInt n = 0;
  char **names = nullptr, **values = nullptr;
  std::map<std::string, std::string> unused;
  POLYSLIP_PETSC(PetscOptionsLeftGet(nullptr, &n, &names, &values));
  for (PetscInt i = 0; i < n; ++i) unused[names[i]] = values[i] != nullptr ? values[i] : "";
  POLYSLIP_PETSC(PetscOptionsLeftRestore(nullptr, &n, &names, &values));
  return unused;
}

void report_unused_options(const Log& log, const std::map<std::string, std::string>& given) {
  for (const auto& [name, value] : unused_options())
    if (given.contains(name))
      log.line("warning: the option -{}{}{} was not used; check its spelling and prefix (polyslip -help)", name, value.empty() ? "" : " ", value);
}

}  // namespace polyslip::scene
