#include "polyslip/assembly/layout.hpp"

#include <algorithm>
#include <cassert>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/vec_access.hpp"

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

Layout::Layout(const mesh::DistributedMesh& mesh, spaces::Bubbles bubbles)
    : comm_(mesh.comm),
      dim_(mesh.mesh.dim),
      bubbles_(bubbles),
      copies_(mesh.copies.owned),
      local_copies_(mesh.copies.local()),
      fractures_(mesh.fractures.owned),
      local_fractures_(mesh.fractures.local()),
      copy_halo_(mesh.comm, mesh.copies),
      fracture_halo_(mesh.comm, mesh.fractures) {
  if (bubbles == spaces::Bubbles::all) number_normals(mesh);
  first_ = static_cast<GlobalIndex>(mpi::exclusive_sum(comm_, displacement_size()));
  number_ghosts(mesh);
}

void Layout::number_normals(const mesh::DistributedMesh& mesh) {
  assert(!mesh.flow.empty());
  normal_of_face_.assign(static_cast<std::size_t>(mesh.mesh.n_faces()), -1);
  const mesh::Numbering& traces = mesh.flow.traces;
  for (Index trace = 0; trace < traces.local(); ++trace) {
    const Index face = mesh.flow.trace_face[trace];
    if (mesh.mesh.on_fracture(face)) continue;
    normal_of_face_[face] = local_normals_++;
    if (trace >= traces.owned) continue;
    ++normals_;
    normal_input_.push_back(mesh.flow.trace_input[trace]);
  }
  total_normals_ = static_cast<GlobalIndex>(mpi::sum(comm_, static_cast<long long>(normals_)));
  widths_.assign(static_cast<std::size_t>(local_copies_ + local_normals_), 1);
  std::fill_n(widths_.begin(), copies_, static_cast<char>(dim_));
  std::fill_n(widths_.begin() + owned_entities(), local_copies_ - copies_, static_cast<char>(dim_));
}

void Layout::number_ghosts(const mesh::DistributedMesh& mesh) {
  std::vector<Index> of_copies(static_cast<std::size_t>(local_copies_));
  for (Index copy = 0; copy < copies_; ++copy) of_copies[copy] = first_ + dim_ * copy;
  copy_halo_.owner_to_ghost(std::span<Index>(of_copies));
  ghost_blocks_.assign(of_copies.begin() + copies_, of_copies.end());
  for (GlobalIndex block : ghost_blocks_)
    for (int a = 0; a < dim_; ++a) ghosts_.push_back(block + a);
  if (bubbles_ == spaces::Bubbles::fracture) return;

  const mesh::Numbering& traces = mesh.flow.traces;
  std::vector<Index> of_traces(static_cast<std::size_t>(traces.local()), -1);
  for (Index trace = 0; trace < traces.owned; ++trace)
    if (const Index k = normal_of_face_[mesh.flow.trace_face[trace]]; k >= 0) of_traces[trace] = first_ + nodal_size() + k;
  mesh::Halo(comm_, traces).owner_to_ghost(std::span<Index>(of_traces));
  for (Index trace = traces.owned; trace < traces.local(); ++trace)
    if (of_traces[trace] >= 0) ghost_blocks_.push_back(of_traces[trace]);
  ghosts_.insert(ghosts_.end(), ghost_blocks_.begin() + (local_copies_ - copies_), ghost_blocks_.end());
  mesh::Numbering numbering;
  numbering.owned = displacement_size();
  numbering.first = first_;
  numbering.total = dim_ * mesh.copies.total + total_normals_;
  numbering.ghosts = ghosts_;
  displacement_halo_ = mesh::Halo(comm_, numbering);
}

void Layout::append_displacements(const mesh::PolyMesh& mesh, Index cell, std::vector<Index>& displacements) const {
  visit_entities(mesh, cell, [&](Index entity) { append_components(entity, displacements); });
}

void Layout::append_components(Index entity, std::vector<Index>& displacements) const {
  const Index first = first_displacement(entity);
  for (int a = 0; a < width(entity); ++a) displacements.push_back(first + a);
}

Index Layout::entity_of(Index displacement) const {
  if (displacement < nodal_size()) return displacement / dim_;
  if (displacement < displacement_size()) return copies_ + displacement - nodal_size();
  const Index behind = displacement - displacement_size(), ghost_copies = local_copies_ - copies_;
  return owned_entities() + (behind < dim_ * ghost_copies ? behind / dim_ : ghost_copies + behind - dim_ * ghost_copies);
}

Index Layout::first_displacement(Index entity) const {
  if (entity < copies_) return dim_ * entity;
  if (entity < owned_entities()) return nodal_size() + entity - copies_;
  const Index ghost = entity - owned_entities(), ghost_copies = local_copies_ - copies_;
  return displacement_size() + (ghost < ghost_copies ? dim_ * ghost : dim_ * ghost_copies + ghost - ghost_copies);
}

la::BlockMatrix::Layout Layout::matrix_layout() const { return {comm_, dim_, owned_entities(), first_, ghost_blocks_, widths_}; }

la::Handle<Vec> Layout::create_vector() const { return create(comm_, size(), block_size()); }
la::Handle<Vec> Layout::create_displacement_vector() const {
  return create(comm_, displacement_size(), block_size());
}

la::Handle<Vec> Layout::create_nodal_vector() const { return create(comm_, nodal_size(), dim_); }

MechanicalState Layout::create_state() const {
  MechanicalState state;
  state.displacement.assign(static_cast<std::size_t>(local_displacements()), 0.0);
  state.bubble.assign(static_cast<std::size_t>(dim_) * local_fractures_, 0.0);
  state.multiplier = state.bubble;
  return state;
}

void Layout::exchange(std::span<double> displacements) const { displacement_halo().owner_to_ghost(displacements, block_size()); }
void Layout::exchange(std::span<Index> displacements) const { displacement_halo().owner_to_ghost(displacements, block_size()); }

void Layout::gather(Vec x, MechanicalState& state) const {
  const la::VecRead a(x);
  std::copy_n(a.data(), displacement_size(), state.displacement.begin());
  std::copy_n(a.data() + bubble_start(), fracture_size(), state.bubble.begin());
  std::copy_n(a.data() + multiplier_start(), fracture_size(), state.multiplier.begin());
  exchange(state.displacement);
  fracture_halo_.owner_to_ghost(state.bubble, dim_);
  fracture_halo_.owner_to_ghost(state.multiplier, dim_);
}

void Layout::scatter(const MechanicalState& state, Vec x) const {
  const la::VecWrite a(x);
  std::copy_n(state.displacement.begin(), displacement_size(), a.data());
  std::copy_n(state.bubble.begin(), fracture_size(), a.data() + bubble_start());
  std::copy_n(state.multiplier.begin(), fracture_size(), a.data() + multiplier_start());
}

}  // namespace polyslip::assembly
