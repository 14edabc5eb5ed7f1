// A PolyMesh from cells given by the nodes of their faces: how readers and generators put meshes together.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::mesh {

/// Collects cells and tagged faces; build() then identifies the faces by their sets of nodes. Nodes are numbered by the caller from
/// 0.
class MeshBuilder {
 public:
  /// `where` (a file name, a scene key) opens every message. In 2D the third coordinates must be 0.
  MeshBuilder(int dim, std::vector<Vec3> nodes, std::string where);

  /// Number of the region or tag of that name, added if it is new.
  Index region(const std::string& name);
  Index tag(const std::string& name);

  void reserve(std::size_t cells, std::size_t faces_of_cells, std::size_t nodes_of_faces);
  /// Opens a cell; without regions every cell is in region 0, "rock". Returns the number of the cell.
  Index add_cell(Index region = 0);
  /// Adds a face to the cell opened last: 3D: three or more nodes in cyclic order, either way round; 2D: two nodes.
  void add_face(std::span<const Index> nodes);
  /// Adds a cell of a 2D mesh: its nodes in cyclic order, either way round.
  Index add_polygon(std::span<const Index> nodes, Index region = 0);
  /// Tags the face with these nodes (any order). The first tag of a face stays.
  void tag_face(Index tag, std::span<const Index> nodes);

  /// Identifies and orients the faces; faces are numbered as the cells first name them, nodes that no cell uses are dropped.
  /// The builder is empty afterwards. Throws InputError: a face of three cells, a repeated node, a tagged face of no cell, and what
  /// orient_faces throws.
  PolyMesh build();

 private:
  void add_row(Index owner, std::span<const Index> nodes);
  std::vector<Index> first_equal_rows() const;
  void number_faces(PolyMesh& mesh, const std::vector<Index>& first_equal);
  void drop_unused_nodes(PolyMesh& mesh);
  [[noreturn]] void fail(const std::string& what, Index row, const std::string& remedy) const;

  int dim_;
  std::string where_;
  std::vector<Vec3> nodes_;
  std::vector<std::string> regions_, tags_;
  std::vector<Index> cell_region_;
  Csr rows_;                  ///< Nodes of every face of every cell and of every tagged face, as they came.
  std::vector<Index> owner_;  ///< Cell of each row, or -1 - tag.
};

/// Gives the tag to the boundary faces without tag whose node average satisfies `inside`.
void tag_boundary(PolyMesh& mesh, const std::string& tag, const std::function<bool(const Vec3&)>& inside);

}  // namespace polyslip::mesh
