// Sentences of warning at the start of a run: what may spoil its result, where, and what helps.
#pragma once

#include "polyslip/scene/log.hpp"
#include "polyslip/scene/model.hpp"

namespace polyslip::scene {

/// Into the log. Collective. Throws InputError where the rock can move as a whole whatever its fractures do.
void report_warnings(const Log& log, const Scene& scene, const Model& model);

}  // namespace polyslip::scene
