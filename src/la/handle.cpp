#include "polyslip/la/handle.hpp"

#include <fmt/format.h>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"

namespace polyslip::la {

namespace {

bool memory_has_run_out = false;

}  // namespace

bool solvers_are_whole() { return !memory_has_run_out; }

void fail(PetscErrorCode code, const char* where) {
  if (code == PETSC_ERR_MEM) {
    memory_has_run_out = true;
    throw ResourceError(mpi::out_of_memory());
  }
  throw std::runtime_error(fmt::format("PETSc error {} in {}", static_cast<int>(code), where));
}

}  // namespace polyslip::la
