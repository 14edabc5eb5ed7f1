// Exchange of values from owners to ghosts over a Numbering, by PetscSF.
#pragma once

#include <span>

#include "polyslip/la/handle.hpp"
#include "polyslip/mesh/distributed_mesh.hpp"

namespace polyslip::mesh {

/// Sends owners' values to the ghosts of other ranks (and back, added).
class Halo {
 public:
  Halo() = default;
  Halo(MPI_Comm comm, const Numbering& numbering);

  /// values has block * numbering.local() entries; the ghosts' are overwritten by their owners'.
  void owner_to_ghost(std::span<double> values, int block = 1) const;
  void owner_to_ghost(std::span<Index> values, int block = 1) const;
  /// Adds the ghosts' values to their owners'; the ghosts' values stay.
  void add_ghost_to_owner(std::span<double> values, int block = 1) const;

 private:
  la::Handle<PetscSF> sf_;
  Index owned_ = 0, local_ = 0;
};

}  // namespace polyslip::mesh
