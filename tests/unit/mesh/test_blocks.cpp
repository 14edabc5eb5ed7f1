// Blocks of rock that a network cuts the domain into.
#include <gtest/gtest.h>

#include "polyslip/mesh/blocks.hpp"
#include "unit/mesh/part_cases.hpp"

namespace polyslip::mesh {
namespace {

/// Cells in turn to all ranks: every block is spread over all of them.
std::vector<Index> scattered(const PolyMesh& serial) {
  std::vector<Index> part(static_cast<std::size_t>(serial.n_cells()));
  for (std::size_t cell = 0; cell < part.size(); ++cell) part[cell] = static_cast<Index>(cell) % mpi::size(world);
  return part;
}

TEST(blocks, planes_through_the_box_leave_quadrants_and_octants) {
  for (const int dim : {2, 3}) {
    const PolyMesh serial = grid(dim, {4, 4, 4}, three_planes());
    const DistributedMesh part = distribute(world, PolyMesh(serial), scattered(serial));
    const Blocks found = find_blocks(part);
    ASSERT_EQ(found.blocks.size(), dim == 2 ? 4u : 8u);
    for (const Block& block : found.blocks) EXPECT_EQ(block.cells, dim == 2 ? 4 : 8);
    for (Index cell = 0; cell < part.mesh.n_cells(); ++cell) {
      const Vec3& at = found.blocks[found.of_cell[cell]].point;
      for (const Index s : part.mesh.cell_nodes[cell])
        for (int axis = 0; axis < dim; ++axis) EXPECT_GE((part.mesh.nodes[s][axis] - 0.5) * (at[axis] - 0.5), 0) << "a cell's block is in its octant";
    }
  }
}

TEST(blocks, a_fracture_that_ends_inside_cuts_nothing_off) {
  const FractureMark half = [](const Vec3& x, int axis) { return axis == 1 && std::abs(x[1] - 0.5) < 1e-9 && x[0] < 0.7; };
  const PolyMesh serial = grid(2, {8, 8, 0}, half);
  const Blocks found = find_blocks(distribute(world, PolyMesh(serial), scattered(serial)));
  ASSERT_EQ(found.blocks.size(), 1u);
  EXPECT_EQ(found.blocks[0].cells, 64);
}

TEST(blocks, a_winding_block_is_one_however_many_ranks_it_passes) {
  // Walls from alternate sides leave one passage from the first to the last column.
  const FractureMark maze = [](const Vec3& x, int axis) {
    const int wall = static_cast<int>(std::lround(8 * x[0]));
    return axis == 0 && std::abs(8 * x[0] - wall) < 1e-9 && (wall % 2 == 0 ? x[1] < 0.8 : x[1] > 0.2);
  };
  const PolyMesh serial = grid(2, {8, 8, 0}, maze);
  std::vector<Index> columns(64);  // to as many ranks from left to right: most cells are far from the first cell of their block
  for (Index cell = 0; cell < 64; ++cell) columns[cell] = cell % 8 * mpi::size(world) / 8;
  const Blocks found = find_blocks(distribute(world, PolyMesh(serial), columns));
  ASSERT_EQ(found.blocks.size(), 1u);
  EXPECT_EQ(found.blocks[0].cells, 64);
  EXPECT_EQ(found.of_cell, std::vector<Index>(found.of_cell.size(), 0));
}

}  // namespace
}  // namespace polyslip::mesh
