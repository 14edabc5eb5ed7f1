// Multigrid for pressures on cells, faces and fractures: classical algebraic multigrid (BoomerAMG).
#pragma once

#include <string>

namespace polyslip::solver {

/// Sets defaults of its options; `prefix` is that of the preconditioner.
void default_pressure_multigrid(const std::string& prefix, int dim);

}  // namespace polyslip::solver
