// A mesh in slices, one a rank, as a native file is read in parallel, and its way into parts without a rank that holds it whole.
#pragma once

#include <filesystem>
#include <vector>

#include "polyslip/mesh/distributed_mesh.hpp"
#include "polyslip/mesh/native_mesh.hpp"

namespace polyslip::mesh {

/// Some cells with all their faces and nodes, each in the order of the whole mesh, so that what orders by number orders alike. A face
/// whose second cell is not here looks like one on the boundary; where the first is not here, the two are exchanged.
struct Piece {
  PolyMesh mesh;
  std::vector<Index> nodes, faces, cells;  ///< Numbers in the whole mesh, ascending.
  std::vector<Index> face_entries;         ///< Place of the first node of each face in face_nodes.values of the whole mesh.
  std::vector<Index> part;                 ///< Rank of each cell.
};

/// Nodes, faces and cells in slices, and what the ranks look up there. All functions but those of `slice` are collective.
class SlicedMesh {
 public:
  /// `sides` and `cell_nodes` (distinct, ascending) are those of the slice's cells.
  SlicedMesh(MPI_Comm comm, NativeSlice slice, CellSides sides, Csr cell_nodes);

  [[nodiscard]] MPI_Comm comm() const { return comm_; }
  [[nodiscard]] const NativeSlice& slice() const { return slice_; }

  /// Rank of each cell of the slice: the same parts as partition_cells gives. Rank 0 holds the graph of all cells until METIS has split
  /// it, though nothing else of the mesh (MatPartitioning with PT-Scotch would split it in slices too, into other parts).
  [[nodiscard]] std::vector<Index> partition(const PartitionOptions& options) const;

  /// The cells of the part of this rank, ghosts included, and all cells around their nodes; part[c] is the rank of the slice's cell c.
  /// So the piece has every cell that sees a copy, trace or ridge of the part: owner, order and copies follow as in the whole mesh.
  [[nodiscard]] Piece piece(const std::vector<Index>& part) const;

 private:
  [[nodiscard]] Csr cells_around_nodes() const;
  [[nodiscard]] Csr cells_across_fractures() const;
  [[nodiscard]] std::vector<Index> owned_cells(const std::vector<Index>& part) const;
  /// Cells around the nodes of the cells, but for those around `seen` nodes, to which the nodes are added. All ascending.
  [[nodiscard]] std::vector<Index> around(const std::vector<Index>& cells, std::vector<Index>& seen) const;
  [[nodiscard]] std::vector<Index> first_entries() const;
  void fill_cells(Piece& piece, const std::vector<Index>& part) const;
  void fill_faces(Piece& piece) const;

  MPI_Comm comm_;
  NativeSlice slice_;
  CellSides sides_;
  Csr cell_nodes_;  ///< Distinct nodes of each cell of the slice, ascending.
  Csr node_cells_;  ///< Cells around each node of the slice, ascending.
  Csr across_;      ///< Cells on both sides of the fracture faces of each cell of the slice.
};

/// Reads a native file (.h5), each rank its slice. Throws InputError on all ranks alike.
SlicedMesh read_sliced(MPI_Comm comm, const std::filesystem::path& file);

/// The same part of each rank as distribute() makes of the whole mesh, entry by entry, but no rank holds more than its slice, its part
/// and the layers around it, and rank 0 the graph of the cells. Consumes the mesh. Throws InputError on all ranks alike.
DistributedMesh distribute(SlicedMesh&& mesh, const PartitionOptions& options = {});

/// The same with the ranks of the slice's cells given; for tests.
DistributedMesh distribute(SlicedMesh&& mesh, const std::vector<Index>& part, const PartitionOptions& options = {});

}  // namespace polyslip::mesh
