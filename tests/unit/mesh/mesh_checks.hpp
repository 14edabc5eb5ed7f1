// What every good mesh satisfies, measured without the geometry module: fans of triangles about the node average of each face.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include "polyslip/mesh/generators.hpp"
#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::mesh::checks {

struct FaceMoments {
  Vec3 area = Vec3::Zero();  ///< Area vector out of face_cells[f][0].
  double moment = 0.0;       ///< Integral of (x - origin).n
};

inline FaceMoments face_moments(const PolyMesh& mesh, Index face, const Vec3& origin) {
  const auto s = mesh.face_nodes[face];
  FaceMoments result;
  if (mesh.dim == 2) {
    const Vec3 t = mesh.nodes[s[1]] - mesh.nodes[s[0]];
    result.area = Vec3(t.y(), -t.x(), 0.0);
    result.moment = result.area.dot(mesh.nodes[s[0]] - origin);
    return result;
  }
  Vec3 centre = Vec3::Zero();
  for (const Index i : s) centre += (mesh.nodes[i] - origin) / static_cast<double>(s.size());
  for (std::size_t i = 0; i < s.size(); ++i) {
    const Vec3 a = mesh.nodes[s[i]] - origin, b = mesh.nodes[s[(i + 1) % s.size()]] - origin;
    const Vec3 triangle = 0.5 * (a - centre).cross(b - centre);
    result.area += triangle;
    result.moment += triangle.dot(centre);
  }
  return result;
}

struct CellMoments {
  Vec3 area_sum = Vec3::Zero();
  double area = 0.0, volume = 0.0;
};

inline CellMoments cell_moments(const PolyMesh& mesh, Index cell) {
  CellMoments result;
  const Vec3 origin = mesh.nodes[mesh.face_nodes[mesh.cell_faces[cell][0]][0]];
  for (const Index f : mesh.cell_faces[cell]) {
    const FaceMoments face = face_moments(mesh, f, origin);
    result.area_sum += mesh.orientation(cell, f) * face.area;
    result.area += face.area.norm();
    result.volume += mesh.orientation(cell, f) * face.moment / mesh.dim;
  }
  return result;
}

/// Nodes - edges + faces - cells (3D) or nodes - edges + cells (2D); 1 for a ball or a disc.
inline Index euler_characteristic(const PolyMesh& mesh) {
  std::set<Index> nodes(mesh.face_nodes.values.begin(), mesh.face_nodes.values.end());
  const auto n_nodes = static_cast<Index>(nodes.size());
  if (mesh.dim == 2) return n_nodes - mesh.n_faces() + mesh.n_cells();
  std::set<std::pair<Index, Index>> edges;
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    const auto s = mesh.face_nodes[f];
    for (std::size_t i = 0; i < s.size(); ++i) edges.insert(std::minmax({s[i], s[(i + 1) % s.size()]}));
  }
  return n_nodes - static_cast<Index>(edges.size()) + mesh.n_faces() - mesh.n_cells();
}

inline BoxSpec cube(const std::string& shape, Index n, int dim = 3) {
  BoxSpec spec;
  spec.dim = dim;
  spec.shape = shape;
  spec.min = {-1.0, -1.0, dim == 3 ? -1.0 : 0.0};
  spec.max = {1.0, 1.0, dim == 3 ? 1.0 : 0.0};
  spec.cells = {n, n, dim == 3 ? n : 0};
  return spec;
}

}  // namespace polyslip::mesh::checks
