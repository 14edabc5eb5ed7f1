// Memory that runs out inside a library becomes a ResourceError: MUMPS reports it like a singular matrix, PETSc by an error code, and
// OpenBLAS by asking for its work space for ever.
#pragma once

#include <petscksp.h>

#include <string>

namespace polyslip::la {

/// Has BLAS take its work space, which it keeps, while it can be told whether there is any, and room for MPI's start. To be called before
/// MPI starts; throws ResourceError.
void reserve_work_space();

/// From now on PETSc returns PETSC_ERR_MEM, without a word, whenever memory has run out in it or in what it has called.
void return_lack_of_memory();

/// Of the factorisations within a solver that has just been run: a sentence if one lacked memory, otherwise nothing. `remedy` says what
/// needs less.
[[nodiscard]] std::string lack_of_memory(KSP ksp, const std::string& remedy);

}  // namespace polyslip::la
