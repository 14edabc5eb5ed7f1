// What comes before a run: scene and mesh read on rank 0, the output folder, and beside the results what was actually run.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "polyslip/mesh/poly_mesh.hpp"
#include "polyslip/scene/command_line.hpp"
#include "polyslip/scene/log.hpp"
#include "polyslip/scene/scene.hpp"

namespace polyslip::scene {

/// The scene of the command line with its overrides, on all ranks. Throws InputError on all ranks alike, as do all functions here.
Scene read_scene(MPI_Comm comm, const CommandLine& line);

/// The whole mesh with fractures and copies, on rank 0; checked against the scene, and written into `directory` (not when that is
/// empty) where the scene says so.
mesh::PolyMesh build_serial_mesh(MPI_Comm comm, const Scene& scene, const std::filesystem::path& directory);

void make_directory(MPI_Comm comm, const std::filesystem::path& directory);

/// scene.resolved.yaml and options.resolved.
void write_resolved(MPI_Comm comm, const Scene& scene, const std::filesystem::path& directory);

/// PETSc options that nothing has read so far, with their values.
std::map<std::string, std::string> unused_options();
/// One warning for each of the options `given` that still nothing has read.
void report_unused_options(const Log& log, const std::map<std::string, std::string>& given);

}  // namespace polyslip::scene
