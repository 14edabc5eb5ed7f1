// Node copies: the unknowns of the displacement jump across Gamma (scheme.md section 3, first point).
#include <algorithm>
#include <numeric>

#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::mesh {
namespace {

/// Distinct nodes of each cell, in the order in which its faces name them.
Csr distinct_nodes_of_cells(const PolyMesh& mesh) {
  Csr rows;
  rows.offsets.reserve(mesh.n_cells() + 1);
  std::vector<Index> last_cell(mesh.n_nodes(), -1);
  for (Index c = 0; c < mesh.n_cells(); ++c) {
    for (const Index f : mesh.cell_faces[c]) {
      for (const Index s : mesh.face_nodes[f]) {
        if (last_cell[s] != c) rows.values.push_back(s);
        last_cell[s] = c;
      }
    }
    rows.offsets.push_back(static_cast<Index>(rows.values.size()));
  }
  return rows;
}

std::vector<char> nodes_on_fractures(const PolyMesh& mesh) {
  std::vector<char> on_fracture(mesh.n_nodes(), false);
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    if (!mesh.on_fracture(f)) continue;
    for (const Index s : mesh.face_nodes[f]) on_fracture[s] = true;
  }
  return on_fracture;
}

/// Sets of corners. A corner is a (cell, node) pair, numbered by its place in cell_nodes.values.
class Corners {
 public:
  explicit Corners(const PolyMesh& mesh) : mesh_(mesh), parent_(mesh.cell_nodes.values.size()) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  void unite(Index node, Index cell, Index neighbour) {
    const Index a = find(corner(cell, node)), b = find(corner(neighbour, node));
    parent_[std::max(a, b)] = std::min(a, b);
  }
  Index find(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }

 private:
  [[nodiscard]] Index corner(Index cell, Index node) const {
    const auto nodes = mesh_.cell_nodes[cell];
    return mesh_.cell_nodes.offsets[cell] + static_cast<Index>(std::find(nodes.begin(), nodes.end(), node) - nodes.begin());
  }
  const PolyMesh& mesh_;
  std::vector<Index> parent_;
};

/// Corners at each node, in the order of the cells.
Csr corners_by_node(const PolyMesh& mesh) {
  Csr rows;
  const auto& corner_node = mesh.cell_nodes.values;
  rows.offsets.assign(mesh.n_nodes() + 1, 0);
  for (const Index s : corner_node) ++rows.offsets[s + 1];
  std::partial_sum(rows.offsets.begin(), rows.offsets.end(), rows.offsets.begin());
  rows.values.resize(corner_node.size());
  std::vector<Index> next(rows.offsets.begin(), rows.offsets.end() - 1);
  for (Index i = 0; i < static_cast<Index>(corner_node.size()); ++i) rows.values[next[corner_node[i]]++] = i;
  return rows;
}

}  // namespace

void build_copies(PolyMesh& mesh) {
  mesh.cell_nodes = distinct_nodes_of_cells(mesh);
  mesh.copy_node.clear();
  if (mesh.face_fracture.empty()) {
    mesh.cell_copies = mesh.cell_nodes.values;
    mesh.copy_node.resize(mesh.n_nodes());
    std::iota(mesh.copy_node.begin(), mesh.copy_node.end(), 0);
    return;
  }

  const std::vector<char> on_fracture = nodes_on_fractures(mesh);
  Corners corners(mesh);
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    if (mesh.on_boundary(f) || mesh.on_fracture(f)) continue;
    for (const Index s : mesh.face_nodes[f]) {
      if (on_fracture[s]) corners.unite(s, mesh.face_cells[f][0], mesh.face_cells[f][1]);
    }
  }

  const Csr at_node = corners_by_node(mesh);
  mesh.cell_copies.assign(mesh.cell_nodes.values.size(), -1);
  for (Index s = 0; s < mesh.n_nodes(); ++s) {
    if (!on_fracture[s]) {
      for (const Index corner : at_node[s]) mesh.cell_copies[corner] = mesh.n_copies();
      mesh.copy_node.push_back(s);
      continue;
    }
    for (const Index corner : at_node[s]) {  // the representative of a set is its smallest corner, so it is met before the others
      const Index root = corners.find(corner);
      if (root == corner) mesh.copy_node.push_back(s);
      mesh.cell_copies[corner] = root == corner ? mesh.n_copies() - 1 : mesh.cell_copies[root];
    }
  }
}

}  // namespace polyslip::mesh
