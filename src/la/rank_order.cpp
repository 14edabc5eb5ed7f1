#include "polyslip/la/rank_order.hpp"

#include <algorithm>

namespace polyslip::la {

std::vector<Neighbour> find_neighbours(MPI_Comm comm, PetscInt nodes, const std::vector<PetscInt>& ghosts) {
  std::vector<Neighbour> neighbours;
  const auto of_rank = [&](int rank) -> Neighbour& {
    const auto at = std::find_if(neighbours.begin(), neighbours.end(), [&](const Neighbour& n) { return n.rank == rank; });
    return at != neighbours.end() ? *at : neighbours.emplace_back(Neighbour{rank, 0, {}, {}});
  };
  Handle<PetscSF> sf;
  PetscLayout layout = nullptr;
  POLYSLIP_PETSC(PetscLayoutCreateFromSizes(comm, nodes, PETSC_DECIDE, 1, &layout));
  POLYSLIP_PETSC(PetscSFCreate(comm, sf.put()));
  POLYSLIP_PETSC(PetscSFSetGraphLayout(sf, layout, static_cast<PetscInt>(ghosts.size()), nullptr, PETSC_COPY_VALUES, ghosts.data()));
  POLYSLIP_PETSC(PetscLayoutDestroy(&layout));
  POLYSLIP_PETSC(PetscSFSetUp(sf));
  PetscInt n = 0;
  const PetscMPIInt* ranks = nullptr;
  const PetscInt *offsets = nullptr, *items = nullptr, *remote = nullptr;
  POLYSLIP_PETSC(PetscSFGetRootRanks(sf, &n, &ranks, &offsets, &items, &remote));
  for (PetscInt i = 0; i < n; ++i) of_rank(ranks[i]).ghosts.assign(items + offsets[i], items + offsets[i + 1]);
  POLYSLIP_PETSC(PetscSFGetLeafRanks(sf, &n, &ranks, &offsets, &items));
  for (PetscInt i = 0; i < n; ++i) of_rank(ranks[i]).nodes.assign(items + offsets[i], items + offsets[i + 1]);
  std::sort(neighbours.begin(), neighbours.end(), [](const Neighbour& l, const Neighbour& r) { return l.rank < r.rank; });
  return neighbours;
}

int choose_colours(MPI_Comm comm, PetscMPIInt tag, std::span<Neighbour> neighbours) {
  int rank = 0, colour = 0;
  MPI_Comm_rank(comm, &rank);
  const auto is_lower = [&](const Neighbour& n) { return n.rank < rank; };
  const auto lower = neighbours.first(static_cast<std::size_t>(std::count_if(neighbours.begin(), neighbours.end(), is_lower)));
  const auto higher = neighbours.subspan(lower.size());
  const auto hear = [&](Neighbour& n) { MPI_Recv(&n.colour, 1, MPI_INT, n.rank, tag, comm, MPI_STATUS_IGNORE); };
  const auto tell = [&](Neighbour& n) { MPI_Send(&colour, 1, MPI_INT, n.rank, tag, comm); };
  std::for_each(lower.begin(), lower.end(), hear);
  while (std::any_of(lower.begin(), lower.end(), [&](const Neighbour& n) { return n.colour == colour; })) ++colour;
  std::for_each(higher.begin(), higher.end(), tell);
  std::for_each(lower.begin(), lower.end(), tell);
  std::for_each(higher.begin(), higher.end(), hear);
  return colour;
}

}  // namespace polyslip::la
