#include "polyslip/assembly/layout.hpp"

#include <algorithm>

namespace polyslip::assembly {

namespace {
la::Handle<Vec> create(MPI_Comm comm, Index size, int block) {
  la::Handle<Vec> v;
  POLYSLIP_PETSC(VecCreate(comm, v.put()));
  POLYSLIP_PETSC(VecSetSizes(v, size, PETSC_DETERMINE));
  POLYSLIP_PETSC(VecSetBlockSize(v, block));
  POLYSLIP_PETSC(VecSetType(v, VECSTANDARD));
  return v;
}
}  // namespace

Layout::Layout(const mesh::DistributedMesh& mesh)
    : comm_(mesh.comm),
      dim_(mesh.mesh.dim),
      copies_(mesh.copies.owned),
      local_copies_(mesh.copies.local()),
      fractures_(mesh.fractures.owned),
      local_fractures_(mesh.fractures.local()),
      copy_halo_(mesh.comm, mesh.copies),
      fracture_halo_(mesh.comm, mesh.fractures) {}

la::Handle<Vec> Layout::create_vector() const { return create(comm_, size(), dim_); }
la::Handle<Vec> Layout::create_nodal_vector() const { return create(comm_, nodal_size(), dim_); }

MechanicalState Layout::create_state() const {
  MechanicalState state;
  state.nodal.assign(static_cast<std::size_t>(dim_) * local_copies_, 0.0);
  state.bubble.assign(static_cast<std::size_t>(dim_) * local_fractures_, 0.0);
  state.multiplier = state.bubble;
  return state;
}

void Layout::gather(Vec x, MechanicalState& state) const {
  const VecRead a(x);
  std::copy_n(a.data(), nodal_size(), state.nodal.begin());
  std::copy_n(a.data() + bubble_start(), fracture_size(), state.bubble.begin());
  std::copy_n(a.data() + multiplier_start(), fracture_size(), state.multiplier.begin());
  copy_halo_.owner_to_ghost(state.nodal, dim_);
  fracture_halo_.owner_to_ghost(state.bubble, dim_);
  fracture_halo_.owner_to_ghost(state.multiplier, dim_);
}

void Layout::scatter(const MechanicalState& state, Vec x) const {
  const VecWrite a(x);
  std::copy_n(state.nodal.begin(), nodal_size(), a.data());
  std::copy_n(state.bubble.begin(), fracture_size(), a.data() + bubble_start());
  std::copy_n(state.multiplier.begin(), fracture_size(), a.data() + multiplier_start());
}

}  // namespace polyslip::assembly
