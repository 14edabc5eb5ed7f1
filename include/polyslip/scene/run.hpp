// The run of a scene from mesh to summary: the only place that knows all modules.
#pragma once

#include <mpi.h>

#include "polyslip/scene/command_line.hpp"

namespace polyslip::scene {

enum ExitCode : int { exit_finished = 0, exit_bad_input = 2, exit_diverged = 3, exit_internal_error = 4, exit_stopped = 143 };

/// Validates or runs the scene of the command line; results and messages as interface.md says. Throws InputError for bad input.
ExitCode run_scene(MPI_Comm comm, const CommandLine& line);

}  // namespace polyslip::scene
