#include "polyslip/assembly/flow_layout.hpp"

#include <algorithm>
#include <cassert>
#include <numeric>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::assembly {

FlowLayout::FlowLayout(const mesh::DistributedMesh& mesh, bool with_fractures) : comm_(mesh.comm), with_fractures_(with_fractures) {
  assert(!mesh.flow.empty());
  static const mesh::Numbering none;
  const std::array<const mesh::Numbering*, 4> kinds{&mesh.cells, &mesh.flow.traces, with_fractures ? &mesh.fractures : &none,
                                                    with_fractures ? &mesh.flow.ridges : &none};
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    ranges_[k].owned = kinds[k]->owned;
    ranges_[k].start = numbering_.owned;
    numbering_.owned += kinds[k]->owned;
    numbering_.total += kinds[k]->total;
  }
  Index ghosts = numbering_.owned;
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    ranges_[k].ghost_start = ghosts;
    ghosts += static_cast<Index>(kinds[k]->ghosts.size());
  }
  numbering_.first = static_cast<GlobalIndex>(mpi::exclusive_sum(comm_, numbering_.owned));
  number_ghosts(kinds);
  halo_ = mesh::Halo(comm_, numbering_);
}

void FlowLayout::number_ghosts(const std::array<const mesh::Numbering*, 4>& kinds) {
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    if (kinds[k]->total == 0) continue;
    std::vector<Index> numbers(static_cast<std::size_t>(kinds[k]->local()));
    std::iota(numbers.begin(), numbers.begin() + kinds[k]->owned, numbering_.first + ranges_[k].start);
    mesh::Halo(comm_, *kinds[k]).owner_to_ghost(std::span<Index>(numbers));
    numbering_.ghosts.insert(numbering_.ghosts.end(), numbers.begin() + kinds[k]->owned, numbers.end());
  }
}

la::Handle<Vec> FlowLayout::create_vector() const {
  la::Handle<Vec> v;
  POLYSLIP_PETSC(VecCreate(comm_, v.put()));
  POLYSLIP_PETSC(VecSetSizes(v, size(), PETSC_DETERMINE));
  POLYSLIP_PETSC(VecSetType(v, VECSTANDARD));
  return v;
}

void FlowLayout::gather(Vec q, std::span<double> local) const {
  const la::VecRead a(q);
  std::copy_n(a.data(), size(), local.begin());
  halo_.owner_to_ghost(local);
}

}  // namespace polyslip::assembly
