// General polygonal (2D) and polyhedral (3D) meshes in compact arrays, with fracture sides and node copies (scheme.md sections 2, 3).
// The same structure holds a whole mesh (serial, before distribution) and the part of a rank (owned cells first, then ghosts).
#pragma once

#include <array>
#include <string>
#include <vector>

#include "polyslip/common/types.hpp"

namespace polyslip::mesh {

/// Cells -> faces -> nodes, and what is known about them. Filled in three steps:
///  1. readers and generators: topology, coordinates, regions, tags;   2. mark_fractures: face_fracture, + sides;
///  3. build_copies: cell_nodes, cell_copies.
struct PolyMesh {
  int dim = 3;

  std::vector<Vec3> nodes;                       ///< Coordinates [m].
  Csr face_nodes;                                ///< 2D: the two ends. 3D: the nodes in cyclic order.
                                                 ///< Orientation: the normal points OUT of face_cells[f][0]. 3D: right-hand rule;
                                                 ///< 2D: with t = x_1 - x_0 the normal is (t_y, -t_x).
  std::vector<std::array<Index, 2>> face_cells;  ///< Second is -1 on the boundary. On a fracture face the FIRST is the + side,
                                                 ///< so that the face normal is n^+ (out of the + side).
  Csr cell_faces;

  std::vector<Index> cell_region;         ///< Number in region_names, one a cell.
  std::vector<std::string> region_names;  ///< "rock" where nothing else is said.
  std::vector<Index> face_tag;            ///< Number in tag_names (box side or physical group), -1 for none, one a face.
  std::vector<std::string> tag_names;

  // Fractures; empty vectors where there is none.
  std::vector<Index> face_fracture;            ///< Number in fracture_names, -1 off Gamma, one a face.
  std::vector<std::string> fracture_names;
  std::vector<double> fracture_length;         ///< Length (2D) or square root of the area (3D) of each fracture [m].
  std::vector<double> face_tip_distance;       ///< Distance of the face centre to the nearest tip of its fracture [m]; infinite
                                               ///< where the fracture has no tip; one a face, 0 off Gamma.

  // Node copies: one for each node s and each set of cells around s connected without crossing Gamma.
  Csr cell_nodes;                  ///< Distinct nodes of each cell.
  std::vector<Index> cell_copies;  ///< Copy that the cell sees at each of its nodes, aligned with cell_nodes.values.
  std::vector<Index> copy_node;    ///< Node of each copy. Without fractures copies and nodes coincide.

  [[nodiscard]] Index n_nodes() const { return static_cast<Index>(nodes.size()); }
  [[nodiscard]] Index n_faces() const { return face_nodes.rows(); }
  [[nodiscard]] Index n_cells() const { return cell_faces.rows(); }
  [[nodiscard]] Index n_copies() const { return static_cast<Index>(copy_node.size()); }
  [[nodiscard]] bool on_fracture(Index face) const { return !face_fracture.empty() && face_fracture[face] >= 0; }
  [[nodiscard]] bool on_boundary(Index face) const { return face_cells[face][1] < 0; }
  /// +1 if the face normal points out of the cell, -1 if into it.
  [[nodiscard]] double orientation(Index cell, Index face) const { return face_cells[face][0] == cell ? 1.0 : -1.0; }
  /// Copies that the cell sees at its nodes, in the order of cell_nodes[cell].
  [[nodiscard]] std::span<const Index> copies_of(Index cell) const {
    return {cell_copies.data() + cell_nodes.offsets[cell], static_cast<std::size_t>(cell_nodes.row_size(cell))};
  }
};

/// Average of the nodes of a cell [m].
Vec3 cell_node_average(const PolyMesh& mesh, Index cell);
/// h_K: largest distance between two nodes [m].
double cell_diameter(const PolyMesh& mesh, Index cell);

/// Makes face_nodes point out of face_cells[f][0], whatever order a reader left; needs topology and coordinates only.
/// Throws InputError naming the cell where faces do not close or the volume is not positive; of a piece of a larger mesh by the number
/// that cells and faces have there.
void orient_faces(PolyMesh& mesh, const std::vector<Index>& cell_numbers = {}, const std::vector<Index>& face_numbers = {});

/// Fills cell_nodes, cell_copies and copy_node from the topology and face_fracture.
void build_copies(PolyMesh& mesh);

}  // namespace polyslip::mesh
