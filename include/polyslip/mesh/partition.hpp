// The parts of a serial mesh: METIS on the graph of cells joined by faces.
#pragma once

#include <vector>

#include "polyslip/mesh/distributed_mesh.hpp"

namespace polyslip::mesh {

/// Rank of each cell, 0 .. ranks-1. Deterministic. Ranks may get no cell when cells are few.
/// Throws InputError when METIS fails.
std::vector<Index> partition_cells(const PolyMesh& mesh, Index ranks, const PartitionOptions& options);

}  // namespace polyslip::mesh
