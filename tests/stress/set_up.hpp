// What a run does with scene and mesh before its first output.
#pragma once

#include "polyslip/mesh/poly_mesh.hpp"
#include "polyslip/scene/scene.hpp"

namespace polyslip::stress {

/// Once, behind PetscInitialize.
void prepare();

/// Sets up the systems and, where asked for, attempts the first step. In read_inputs_only it does nothing.
void set_up(const scene::Scene& scene, mesh::PolyMesh serial, bool first_step);

}  // namespace polyslip::stress
