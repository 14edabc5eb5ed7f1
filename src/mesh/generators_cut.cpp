// Hexahedra whose warped faces are cut into planar triangles.
#include <Eigen/Geometry>
#include <array>
#include <numeric>
#include <utility>

#include "polyslip/mesh/box_parts.hpp"

namespace polyslip::mesh {
namespace {

using Quad = std::array<Vec3, 4>;

bool is_planar(const Quad& x) {
  const Vec3 first = x[2] - x[0], second = x[3] - x[1];  // the diagonals: their distance tells how far the nodes are from one plane
  const Vec3 normal = first.cross(second);
  return std::abs(normal.dot(x[1] - x[0])) <= 1e-12 * normal.norm() * first.norm();
}

/// Faces in place of one quad, with its orientation.
std::vector<std::vector<Index>> cut_quad(const PolyMesh& mesh, std::span<const Index> s) {
  const Quad x{mesh.nodes[s[0]], mesh.nodes[s[1]], mesh.nodes[s[2]], mesh.nodes[s[3]]};
  if (is_planar(x)) return {{s.begin(), s.end()}};
  if ((x[2] - x[0]).squaredNorm() <= (x[3] - x[1]).squaredNorm()) return {{s[0], s[1], s[2]}, {s[0], s[2], s[3]}};
  return {{s[0], s[1], s[3]}, {s[1], s[2], s[3]}};
}

}  // namespace

void cut_warped_quads(PolyMesh& mesh) {
  Csr face_nodes, cell_faces;
  std::vector<std::array<Index, 2>> face_cells;
  std::vector<Index> first_piece{0};
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    for (const auto& piece : cut_quad(mesh, std::as_const(mesh.face_nodes)[f])) {
      face_nodes.push_row(piece);
      face_cells.push_back(mesh.face_cells[f]);
    }
    first_piece.push_back(face_nodes.rows());
  }
  for (Index c = 0; c < mesh.n_cells(); ++c) {
    for (const Index f : mesh.cell_faces[c]) {
      for (Index piece = first_piece[f]; piece < first_piece[f + 1]; ++piece) cell_faces.values.push_back(piece);
    }
    cell_faces.offsets.push_back(static_cast<Index>(cell_faces.values.size()));
  }
  mesh.face_nodes = std::move(face_nodes);
  mesh.face_cells = std::move(face_cells);
  mesh.cell_faces = std::move(cell_faces);
}

}  // namespace polyslip::mesh
