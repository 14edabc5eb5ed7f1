#include "polyslip/mesh/halo.hpp"

#include <cassert>

#include "polyslip/common/mpi.hpp"

namespace polyslip::mesh {

namespace {

static_assert(sizeof(PetscInt) == sizeof(GlobalIndex), "PETSc must be built with 32-bit indices");

/// Roots are the owned entries, leaves the ghosts behind them in the same array.
template <class T>
void send_to_ghosts(PetscSF sf, MPI_Datatype base, std::span<T> values, Index owned, int block) {
  const mpi::BlockType type(base, block);  // PETSc keeps a duplicate of its own, so this one may be short-lived
  T* ghosts = values.data() + static_cast<std::size_t>(owned) * block;
  POLYSLIP_PETSC(PetscSFBcastBegin(sf, type, values.data(), ghosts, MPI_REPLACE));
  POLYSLIP_PETSC(PetscSFBcastEnd(sf, type, values.data(), ghosts, MPI_REPLACE));
}

}  // namespace

Halo::Halo(MPI_Comm comm, const Numbering& numbering) : owned_(numbering.owned), local_(numbering.local()) {
  if (mpi::size(comm) == 1) return;  // No ghosts, no graph: exchanges return at once.
  PetscLayout layout = nullptr;
  POLYSLIP_PETSC(PetscLayoutCreateFromSizes(comm, numbering.owned, numbering.total, 1, &layout));
  POLYSLIP_PETSC(PetscSFCreate(comm, sf_.put()));
  POLYSLIP_PETSC(PetscSFSetGraphLayout(sf_, layout, static_cast<PetscInt>(numbering.ghosts.size()), nullptr, PETSC_COPY_VALUES,
                                       numbering.ghosts.data()));
  POLYSLIP_PETSC(PetscLayoutDestroy(&layout));
  POLYSLIP_PETSC(PetscSFSetUp(sf_));
}

void Halo::owner_to_ghost(std::span<double> values, int block) const {
  assert(values.size() == static_cast<std::size_t>(local_) * block);
  if (sf_.get() != nullptr) send_to_ghosts(sf_, MPI_DOUBLE, values, owned_, block);
}

void Halo::owner_to_ghost(std::span<Index> values, int block) const {
  assert(values.size() == static_cast<std::size_t>(local_) * block);
  if (sf_.get() != nullptr) send_to_ghosts(sf_, MPIU_INT, values, owned_, block);
}

void Halo::add_ghost_to_owner(std::span<double> values, int block) const {
  assert(values.size() == static_cast<std::size_t>(local_) * block);
  if (sf_.get() == nullptr) return;
  const mpi::BlockType type(MPI_DOUBLE, block);
  const double* ghosts = values.data() + static_cast<std::size_t>(owned_) * block;
  POLYSLIP_PETSC(PetscSFReduceBegin(sf_, type, ghosts, values.data(), MPI_SUM));
  POLYSLIP_PETSC(PetscSFReduceEnd(sf_, type, ghosts, values.data(), MPI_SUM));
}

}  // namespace polyslip::mesh
