// The exact condensed operator of a system, as a shell: with the frictional terms that a symmetric matrix leaves out.
#pragma once

#include <petscmat.h>

#include "polyslip/common/types.hpp"
#include "polyslip/la/handle.hpp"

namespace polyslip::solver {

/// Applies System::apply_condensed, of this class whatever `system` is besides, to vectors of `n` owned entries. The system must outlive it.
template <class System>
la::Handle<Mat> condensed_operator(System& system, Index n) {
  const auto apply = +[](Mat shell, Vec x, Vec y) -> PetscErrorCode {
    PetscFunctionBeginUser;
    System* applied = nullptr;
    PetscCall(MatShellGetContext(shell, &applied));
    PetscCallCXX(applied->System::apply_condensed(x, y));
    PetscFunctionReturn(0);
  };
  la::Handle<Mat> shell;
  POLYSLIP_PETSC(MatCreateShell(system.mesh().comm, n, n, PETSC_DETERMINE, PETSC_DETERMINE, &system, shell.put()));
  POLYSLIP_PETSC(MatShellSetOperation(shell, MATOP_MULT, reinterpret_cast<void (*)()>(apply)));
  return shell;
}

}  // namespace polyslip::solver
