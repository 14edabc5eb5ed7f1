// The parts of a serial mesh: METIS on the graph of cells joined by faces.
#pragma once

#include <vector>

#include "polyslip/mesh/distributed_mesh.hpp"
#include "polyslip/mesh/face_tools.hpp"

namespace polyslip::mesh {

/// Cells of a mesh, or of a slice of it, and the cells across their faces. Cells that share several faces are joined by one edge with
/// the sum of the weights (METIS wants simple graphs).
struct CellGraph {
  Csr neighbours;
  std::vector<Index> edge_weights;  ///< Aligned with neighbours.values.
  std::vector<Index> cell_weights;
};

/// Graph of the cells first_cell, first_cell + 1 ... with these faces; neighbours in the order of the faces.
CellGraph cell_graph(const Csr& cell_faces, Index first_cell, const CellSides& sides, const PartitionOptions& options);

/// Rank of each cell of a whole graph, 0 .. ranks-1. Deterministic. Ranks may get no cell when cells are few.
/// Throws InputError when METIS fails.
std::vector<Index> split_graph(CellGraph&& graph, Index ranks);

/// Rank of each cell of a whole mesh, by its graph.
std::vector<Index> partition_cells(const PolyMesh& mesh, Index ranks, const PartitionOptions& options);

}  // namespace polyslip::mesh
