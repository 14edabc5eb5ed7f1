// Checkpoints of runs: everything that a continuation needs, equal to the bit on the same number of ranks.
//
//   tables   displacement (node copies); bubble, multiplier, previous_jump, initial_jump (fracture faces); pressure_cell,
//            pressure_trace, pressure_fracture, pressure_ridge
//            and what they are with the prefix before_ in the state before
//   scalars  steps, sizes and counters so far, what Model::Memory holds
//   texts    scene: the resolved scene, which must be that of the continuation but for its end and its output
#pragma once

#include <filesystem>

#include "polyslip/io/checkpoint.hpp"
#include "polyslip/io/summary.hpp"
#include "polyslip/scene/model.hpp"

namespace polyslip::scene {

/// Writes the accepted state; `summary` gives counters of earlier runs and the largest errors of the books so far. Collective.
void save_run(const std::filesystem::path& file, const Scene& scene, const Model& model, const solver::StepperState& steps,
              const io::Summary& summary);

/// Reads what save_run has written into the model and the summary. Collective; throws InputError, on all ranks alike, where the
/// checkpoint cannot be read, is of another mesh, or of another scene and that is not allowed.
solver::StepperState resume_run(const io::Checkpoint& checkpoint, const std::string& name, const Scene& scene, Model& model,
                                io::Summary& summary, bool may_differ);

/// Where two resolved scenes differ beyond name, description, output, time.end and time.outputs: path and both values, for
/// messages; empty where nowhere.
std::string scene_difference(const std::string& was, const std::string& is);

}  // namespace polyslip::scene
