// What is composed with an object of PETSc under a name: PETSc keeps it with the object, and knows nothing of it.
#pragma once

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// Composes a pointer; `destroy` is called for it at the end of the object, if it is given.
template <class Object, class Pointer>
void compose(Object object, const char* name, Pointer* pointer, PetscErrorCode (*destroy)(void*) = nullptr) {
  PetscContainer container = nullptr;
  POLYSLIP_PETSC(PetscContainerCreate(comm_of(object), &container));
  if (destroy != nullptr) POLYSLIP_PETSC(PetscContainerSetUserDestroy(container, destroy));
  POLYSLIP_PETSC(PetscContainerSetPointer(container, const_cast<void*>(static_cast<const void*>(pointer))));  // PETSc has no pointers to const
  POLYSLIP_PETSC(PetscObjectCompose(reinterpret_cast<PetscObject>(object), name, reinterpret_cast<PetscObject>(container)));
  POLYSLIP_PETSC(PetscContainerDestroy(&container));
}

/// The pointer; null where there is none of that name.
template <class Pointed, class Object>
Pointed* composed(Object object, const char* name) {
  PetscObject container = nullptr;
  void* pointer = nullptr;
  POLYSLIP_PETSC(PetscObjectQuery(reinterpret_cast<PetscObject>(object), name, &container));
  if (container != nullptr) POLYSLIP_PETSC(PetscContainerGetPointer(reinterpret_cast<PetscContainer>(container), &pointer));
  return static_cast<Pointed*>(pointer);
}

}  // namespace polyslip::la
