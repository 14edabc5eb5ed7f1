// Keeping the set-up of a preconditioner while its matrix changes.
#pragma once

#include <petsc/private/pcimpl.h>  // whether a preconditioner is set up

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// Like KSPSetReusePreconditioner, and for the blocks of block Jacobi at once: PETSc tells them only when they are applied, and a set-up in
/// between would leave them as they were.
inline void reuse_preconditioner(KSP ksp, bool reuse) {
  const PetscBool flag = reuse ? PETSC_TRUE : PETSC_FALSE;
  PC pc = nullptr;
  PetscBool has_blocks = PETSC_FALSE;
  POLYSLIP_PETSC(KSPSetReusePreconditioner(ksp, flag));
  POLYSLIP_PETSC(KSPGetPC(ksp, &pc));
  POLYSLIP_PETSC(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCBJACOBI, &has_blocks));
  if (!has_blocks || !pc->setupcalled) return;
  PetscInt n = 0;
  KSP* blocks = nullptr;
  POLYSLIP_PETSC(PCBJacobiGetSubKSP(pc, &n, nullptr, &blocks));
  for (PetscInt i = 0; i < n; ++i) POLYSLIP_PETSC(KSPSetReusePreconditioner(blocks[i], flag));
}

}  // namespace polyslip::la
