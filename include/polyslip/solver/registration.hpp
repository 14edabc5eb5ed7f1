// What this program adds to the types of PETSc's objects that options can name.
#pragma once

#include "polyslip/la/handle.hpp"

namespace polyslip::solver {

/// The active-set line search and the preconditioner block_icc; to be called after PetscInitialize.
PetscErrorCode register_types();

}  // namespace polyslip::solver
