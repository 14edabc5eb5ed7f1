// The fields of a run for ParaView: what is written of rock and fluid, in the rock and on its fractures.
#pragma once

#include "polyslip/io/field_writer.hpp"
#include "polyslip/scene/tables.hpp"

namespace polyslip::scene {

/// Writes the state of the model at `time`; `figures` are those of its last step. Collective.
void write_fields(io::FieldWriter& writer, const Scene& scene, const Model& model, const StepFigures& figures, double time);

}  // namespace polyslip::scene
