// Multigrid for pressures: classical algebraic multigrid (BoomerAMG) on cells, faces and fractures alike, or on faces and fractures alone. A
// cell touches none but its own faces, so that its pressure can be condensed out exactly (PCFIELDSPLIT, Schur, fields `cells` and `faces`):
// the set-up takes longer, each application less.
#pragma once

#include <string>

#include "polyslip/assembly/flow_system.hpp"

namespace polyslip::solver {

/// Sets defaults of the options of BoomerAMG on all pressures; `prefix` is that of the preconditioner.
void default_pressure_multigrid(const std::string& prefix, int dim);

/// The same with the pressures of cells condensed out; sets the type of the preconditioner too. Its set-up needs split_pressure.
void default_condensed_multigrid(const std::string& prefix, int dim);

/// Hands the fields to a preconditioner that splits pressures; others are left as they are.
void split_pressure(const assembly::FlowSystem& system, PC pc);

}  // namespace polyslip::solver
