// Blocks of rock: cells joined by faces off the fractures. A network that cuts the domain leaves more than one.
#pragma once

#include <vector>

#include "polyslip/mesh/distributed_mesh.hpp"

namespace polyslip::mesh {

struct Block {
  GlobalIndex cells = 0;      ///< Over all ranks.
  Vec3 point = Vec3::Zero();  ///< Average of the nodes of its first cell in the serial mesh [m].
};

struct Blocks {
  std::vector<Block> blocks;   ///< In the order of their first cells in the serial mesh; the same on all ranks.
  std::vector<Index> of_cell;  ///< Block of each local cell, ghosts included.
};

/// The same blocks on any number of ranks. Collective.
Blocks find_blocks(const DistributedMesh& mesh);

}  // namespace polyslip::mesh
