#include "polyslip/solver/registration.hpp"

#include "polyslip/la/incomplete_cholesky.hpp"
#include "polyslip/solver/active_set_search.hpp"

namespace polyslip::solver {

PetscErrorCode register_types() {
  PetscFunctionBeginUser;
  PetscCall(register_active_set_search());
  PetscCall(la::register_block_icc());
  PetscFunctionReturn(0);
}

}  // namespace polyslip::solver
