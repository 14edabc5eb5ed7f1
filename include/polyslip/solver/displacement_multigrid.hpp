// Multigrid for displacements: smoothed aggregation with the rigid-body modes (GAMG). Where bubbles are on all faces it serves what is
// nodal, and before and after it a smoother serves the bubbles along normals (PCFIELDSPLIT, symmetric multiplicative, fields `normal` and
// `nodal`).
#pragma once

#include <string>

#include "polyslip/assembly/mechanics_system.hpp"

namespace polyslip::solver {

/// Type of the preconditioner: PCGAMG, or PCFIELDSPLIT.
PCType displacement_multigrid(const assembly::MechanicsSystem& system);

/// Sets defaults of its options; `prefix` is that of the preconditioner.
void default_displacement_multigrid(const assembly::MechanicsSystem& system, const std::string& prefix);

/// Hands the fields to a preconditioner that splits displacements with bubbles on all faces; others are left as they are.
void split_displacement(const assembly::MechanicsSystem& system, PC pc);

}  // namespace polyslip::solver
