#include "polyslip/scene/prepare.hpp"

#include <fstream>

#include "polyslip/common/error.hpp"
#include "polyslip/la/handle.hpp"
#include "polyslip/mesh/readers.hpp"

namespace polyslip::scene {

namespace {

void write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file);
  out << text;
  out.flush();
  if (!out)
    throw InputError("the file cannot be written", file.string(), "Check free space and permissions, or choose another -o DIR");
}

}  // namespace

Scene read_scene(MPI_Comm comm, const CommandLine& line) {
  std::string text;
  mpi::on_root(comm, [&] { text = read_scene_text(line.scene); });
  return parse_scene(mpi::broadcast(comm, text), line.scene, line.overrides);
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

void make_directory(MPI_Comm comm, const std::filesystem::path& directory) {
  mpi::on_root(comm, [&] {
    std::error_code error;
    std::filesystem::create_directories(directory, error);
    if (error || !std::filesystem::is_directory(directory))
      throw InputError("the output directory cannot be made: " + error.message(), directory.string(), "Choose another with -o DIR");
  });
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
