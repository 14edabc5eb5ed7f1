// The mesh of one rank: owned cells and one layer of ghosts, with global numbers for cells, node copies and fracture faces.
#pragma once

#include <mpi.h>

#include <array>
#include <vector>

#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::mesh {

/// Owned entities come first (local 0 .. owned-1, global first .. first+owned-1), then ghosts with their global numbers.
struct Numbering {
  Index owned = 0;
  GlobalIndex first = 0;            ///< Global number of the first owned entity.
  GlobalIndex total = 0;            ///< Over all ranks.
  std::vector<GlobalIndex> ghosts;  ///< Global numbers of the ghosts, local number owned + i.

  [[nodiscard]] Index local() const { return owned + static_cast<Index>(ghosts.size()); }
  [[nodiscard]] GlobalIndex global(Index i) const { return i < owned ? first + i : ghosts[i - owned]; }
};

/// Entities that carry flow unknowns beside cells and fracture faces (scheme.md section 4); empty where a scene has no flow.
/// Traces: one a matrix face off Gamma, one for each side of a fracture face. Ridges: what fracture faces are bounded by and meet
/// at, the nodes (2D) or edges (3D) of the network, one for all fracture faces that share it.
struct FlowEntities {
  std::vector<std::array<Index, 2>> face_traces;  ///< Trace that face_cells[f][0] and [1] see (equal off Gamma), -1 where that cell
                                                  ///< is not here or does not exist; one pair a local face.
  Numbering traces;                      ///< A trace belongs to a rank that owns a cell which sees it (Sharers in cut.hpp).
  std::vector<Index> trace_face;         ///< Local face of each local trace.
  std::vector<GlobalIndex> trace_input;  ///< Number of each local trace in the serial mesh: independent of the rank count.

  Csr fracture_ridges;  ///< Ridges of each local fracture face, aligned with its nodes: 2D ridge i is node i, 3D ridge i joins
                        ///< nodes i and i + 1 (cyclic).
  Numbering ridges;     ///< A ridge belongs to the lowest rank that owns a fracture face which has it.
  std::vector<std::array<Index, 2>> ridge_nodes;  ///< Local nodes; 2D: the second is -1.
  Csr ridge_boundary_faces;  ///< Local faces on the boundary of the domain that hold the ridge's nodes; empty rows inside. All that
                             ///< there are for an owned ridge.
  std::vector<GlobalIndex> ridge_input;  ///< Number of each local ridge in the serial mesh: independent of the rank count.

  /// Whether no flow was asked for; the same on all ranks, those without cells included.
  [[nodiscard]] bool empty() const { return traces.total == 0; }
};

/// Part of a rank. The ghost layer holds every cell that shares a node (geometric, across Gamma too) with an owned cell, and then
/// the cells across the fracture faces of all these. So the rows of every owned copy can be assembled without communication,
/// condensed fracture blocks included; so can those of every owned trace and ridge, since both cells of each fracture face around
/// an owned ridge hold its nodes, as does the owned + cell by which the ridge is owned. Ranks may own no cell.
struct DistributedMesh {
  MPI_Comm comm = MPI_COMM_SELF;
  PolyMesh mesh;  ///< Owned cells first. Faces of ghosts whose neighbour is not here have face_cells[f][1] = -1 and are not
                  ///< boundary (see face_is_boundary); if the serial mesh had the missing cell first, the face is turned.
                  ///< Fracture faces are never turned: one of an outer ghost whose + side is not here has
                  ///< face_cells[f][0] = -1, and is not listed in fracture_faces.
  std::vector<char> face_is_boundary;  ///< 1 on faces on the boundary of the whole domain, one a local face.

  Numbering cells;
  Numbering copies;                 ///< A copy belongs to a rank that owns a cell which sees it (Sharers in cut.hpp).
  Numbering fractures;              ///< Fracture faces with both sides here; a face belongs to the rank that owns its + cell.
  std::vector<Index> fracture_faces;  ///< Local face of each local fracture face, in the order of `fractures`.
  FlowEntities flow;                ///< Only where PartitionOptions::flow asks for it.

  std::vector<GlobalIndex> cell_input;           ///< Number of each local cell in the serial mesh: independent of the rank count.
  std::vector<GlobalIndex> copy_input;           ///< Number of each local copy in the serial mesh.
  std::vector<GlobalIndex> fracture_face_input;  ///< Number in the serial mesh of each local fracture face's face.

  GlobalIndex total_faces = 0;  ///< Over all ranks, each face once.
  GlobalIndex total_nodes = 0;
};

/// Local number of each local face among the fracture faces, -1 elsewhere.
std::vector<Index> fracture_numbers(const DistributedMesh& mesh);

struct PartitionOptions {
  Index fracture_cell_weight = 2;  ///< Work of a cell that touches Gamma, in units of a plain cell.
  Index fracture_edge_weight = 8;  ///< Cost of cutting a fracture face, in units of a plain face.
  bool flow = false;               ///< Whether to number the entities of the flow space.
};

/// Splits the serial mesh (rank 0's; ignored elsewhere) into parts with METIS and sends each rank its part; the serial mesh is
/// consumed and freed. Until then rank 0 holds a whole mesh, the one place where global-size data lives on a rank; a native file can do
/// without (sliced_mesh.hpp).
/// Cells, copies, fracture faces, traces and ridges keep, within a rank, the order of the serial mesh (flow_entities.hpp).
/// Throws InputError on all ranks alike.
DistributedMesh distribute(MPI_Comm comm, PolyMesh&& serial, const PartitionOptions& options = {});

/// The same with the parts given (part[c] is the rank of serial cell c); for tests: empty ranks, scattered parts. Of the options
/// only `flow` matters.
DistributedMesh distribute(MPI_Comm comm, PolyMesh&& serial, const std::vector<Index>& part, const PartitionOptions& options = {});

}  // namespace polyslip::mesh
