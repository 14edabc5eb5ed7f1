// Fields of PCFIELDSPLIT that are known by their rows.
#pragma once

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

inline bool is_field_split(PC pc) {
  PetscBool splits = PETSC_FALSE;
  POLYSLIP_PETSC(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCFIELDSPLIT, &splits));
  return splits == PETSC_TRUE;
}

/// Names the rows of a field, once for all: PETSc would take the same field, told again at a later set-up, for one more.
inline void define_field(PC pc, const char* name, IS rows) {
  IS known = nullptr;
  POLYSLIP_PETSC(PCFieldSplitGetIS(pc, name, &known));
  if (known == nullptr) POLYSLIP_PETSC(PCFieldSplitSetIS(pc, name, rows));
}

/// visit(KSP) of each field; none where a preconditioner does not split.
template <class Visit>
void for_each_field(PC pc, Visit&& visit) {
  if (!is_field_split(pc)) return;
  PetscInt n = 0;
  KSP* fields = nullptr;
  POLYSLIP_PETSC(PCFieldSplitGetSubKSP(pc, &n, &fields));
  for (PetscInt i = 0; i < n; ++i) visit(fields[i]);
  POLYSLIP_PETSC(PetscFree(fields));
}

/// Sets a solver up for its matrix as it is, the solvers of its fields and blocks too; PETSc leaves those to their first solve.
inline void set_up_with_fields(KSP ksp) {
  PC pc = nullptr;
  POLYSLIP_PETSC(KSPSetUp(ksp));
  POLYSLIP_PETSC(KSPSetUpOnBlocks(ksp));
  POLYSLIP_PETSC(KSPGetPC(ksp, &pc));
  for_each_field(pc, [](KSP field) { POLYSLIP_PETSC(KSPSetUp(field)); });
}

}  // namespace polyslip::la
