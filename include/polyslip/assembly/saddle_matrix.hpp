// The whole Jacobian of the mechanical problem as one assembled matrix: nodal unknowns, bubbles and multipliers (the saddle formulation).
#pragma once

#include "polyslip/assembly/mechanics_system.hpp"

namespace polyslip::assembly {

/// Creates the AIJ matrix with its final pattern, in the order of Layout's Vec.
la::Handle<Mat> create_saddle_matrix(const MechanicsSystem& system);

/// Writes the values for the contact laws linearised last; the system's matrix must hold the bulk only.
void fill_saddle_matrix(const MechanicsSystem& system, Mat matrix);

}  // namespace polyslip::assembly
