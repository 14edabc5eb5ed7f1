// Multigrid for displacements with bubbles on all faces: algebraic multigrid with the rigid-body modes for what is nodal, and, before and
// after it, a smoother for the bubbles along normals (PCFIELDSPLIT, symmetric multiplicative, fields `normal` and `nodal`).
#pragma once

#include <string>

#include "polyslip/assembly/mechanics_system.hpp"

namespace polyslip::solver {

/// Sets defaults of the options of a preconditioner with this prefix for the displacements of a system, and returns the
/// prefix of the multigrid of what is nodal: the same where bubbles are on fracture faces only.
std::string default_displacement_split(const assembly::MechanicsSystem& system, const std::string& prefix);

/// Hands the fields to a preconditioner that splits displacements with bubbles on all faces; others are left as they are.
void split_displacement(const assembly::MechanicsSystem& system, PC pc);

}  // namespace polyslip::solver
