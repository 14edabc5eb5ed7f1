// The command line of polyslip (interface.md): our own arguments; everything else belongs to PETSc.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace polyslip::scene {

struct CommandLine {
  std::filesystem::path scene;
  std::filesystem::path output;          ///< Empty: <scene name>.out
  std::vector<std::string> overrides;    ///< KEY=VALUE, in order.
  bool validate = false, help = false, version = false;
  bool restart = false;              ///< From a checkpoint.
  std::filesystem::path checkpoint;  ///< Empty: checkpoint.h5 of the output folder.
  bool restart_changed_scene = false;  ///< The scene of the checkpoint may be another.
  std::vector<std::string> petsc;        ///< Program name and all that is not ours.
};

/// Throws InputError for a missing scene, a missing value, more than one scene.
CommandLine parse_command_line(int argc, char** argv);

/// Usage, our arguments and PETSc options by group, then the scene keys.
std::string full_help();

std::string petsc_version();

/// Version of polyslip, PETSc and the packages it was built with.
std::string version_text();

}  // namespace polyslip::scene
