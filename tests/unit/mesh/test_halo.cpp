// Exchange between owners and ghosts.
#include <gtest/gtest.h>

#include "polyslip/common/mpi.hpp"
#include "polyslip/mesh/halo.hpp"
#include "unit/mesh/grid.hpp"

namespace polyslip::mesh {
namespace {

const MPI_Comm world = MPI_COMM_WORLD;

DistributedMesh sample() { return distribute(world, grid(2, {8, 6, 0}, crossing())); }

TEST(halo, brings_the_owners_values_block_by_block) {
  const DistributedMesh part = sample();
  const Halo halo(world, part.copies);
  for (const int block : {1, 2, 3}) {
    std::vector<double> values(static_cast<std::size_t>(part.copies.local()) * block, -1.0);
    for (Index i = 0; i < part.copies.owned; ++i) {
      for (int b = 0; b < block; ++b) values[i * block + b] = part.copies.global(i) + 0.1 * b;
    }
    halo.owner_to_ghost(std::span<double>(values), block);
    for (Index i = 0; i < part.copies.local(); ++i) {
      for (int b = 0; b < block; ++b) EXPECT_EQ(values[i * block + b], part.copies.global(i) + 0.1 * b);
    }
  }
}

TEST(halo, adds_every_ghost_to_its_owner_once_and_leaves_the_ghosts) {
  const DistributedMesh part = sample();
  const Halo halo(world, part.copies);
  // First component: each rank counts 1 for each copy here, so that owners hold the number of ranks that have the copy. Second:
  // each rank gives the copy's global number, so that owners hold as many times that.
  std::vector<double> values;
  for (Index i = 0; i < part.copies.local(); ++i) values.insert(values.end(), {1.0, static_cast<double>(part.copies.global(i))});
  const std::vector<double> before = values;
  halo.add_ghost_to_owner(values, 2);
  double ranks = 0;
  for (Index i = 0; i < part.copies.owned; ++i) {
    ranks += values[2 * i];
    EXPECT_EQ(values[2 * i + 1], values[2 * i] * part.copies.global(i));
  }
  EXPECT_EQ(mpi::sum(world, ranks), mpi::sum(world, static_cast<double>(part.copies.local())));
  for (std::size_t i = part.copies.owned * 2; i < values.size(); ++i) EXPECT_EQ(values[i], before[i]);
}

TEST(halo, works_where_ranks_are_empty) {
  const PolyMesh serial = grid(2, {4, 4, 0});
  const DistributedMesh part = distribute(world, PolyMesh(serial), std::vector<Index>(16, mpi::size(world) - 1));
  const Halo halo(world, part.cells);
  std::vector<Index> values(part.cells.local(), 7);
  halo.owner_to_ghost(std::span<Index>(values));
  EXPECT_EQ(values, std::vector<Index>(part.cells.local(), 7));
}

TEST(halo, can_be_moved) {
  const DistributedMesh part = sample();
  Halo first(world, part.cells);
  const Halo second = std::move(first);
  std::vector<Index> values = part.cell_input;
  std::fill(values.begin() + part.cells.owned, values.end(), -1);
  second.owner_to_ghost(std::span<Index>(values));
  EXPECT_EQ(values, part.cell_input);
}

}  // namespace
}  // namespace polyslip::mesh
