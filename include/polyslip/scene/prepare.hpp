// What comes before a run: scene and mesh read on rank 0, the output folder, and beside the results what was actually run.
#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>

#include "polyslip/mesh/distributed_mesh.hpp"
#include "polyslip/scene/command_line.hpp"
#include "polyslip/scene/log.hpp"
#include "polyslip/scene/scene.hpp"

namespace polyslip::scene {

/// The scene of the command line with its overrides, on all ranks. Throws InputError on all ranks alike, as do all functions here.
Scene read_scene(MPI_Comm comm, const CommandLine& line);

/// What is possible in the scene, but unusual.
void report_unusual_values(const Log& log, const Scene& scene);

/// The whole mesh with fractures and copies, on rank 0; checked against the scene, and written into `directory` (not when that is
/// empty) where the scene says so. For a mesh that may be read in slices see mesh_input.hpp.
mesh::PolyMesh build_serial_mesh(MPI_Comm comm, const Scene& scene, const std::filesystem::path& directory);

/// What the unknowns of the scene need of the parts of its mesh.
mesh::PartitionOptions partition_options(const Scene& scene);

/// The folder of the results. A run that is refused leaves it as it was: nothing in it may pass for a result.
class OutputFolder {
 public:
  /// Makes the folder.
  OutputFolder(MPI_Comm comm, std::filesystem::path path);
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// Puts away what an earlier run has left and a reader could take for results of this one: its summary, and its checkpoint where this run
  /// starts from the beginning.
  void begin_run(bool goes_on) const;
  /// Removes all that was not there before, and the folder if it was not.
  void restore() const;

 private:
  MPI_Comm comm_;
  std::filesystem::path path_;
  bool was_there_ = false;
  std::set<std::filesystem::path> before_;  ///< Entries; on rank 0.
};

/// scene.resolved.yaml and options.resolved.
void write_resolved(MPI_Comm comm, const Scene& scene, const std::filesystem::path& directory);

/// PETSc options that nothing has read so far, with their values.
std::map<std::string, std::string> unused_options();
/// One warning for each of the options `given` that still nothing has read.
void report_unused_options(const Log& log, const std::map<std::string, std::string>& given);

}  // namespace polyslip::scene
