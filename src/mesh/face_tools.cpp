#include "polyslip/mesh/face_tools.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace polyslip::mesh {

Vec3 node_average(const PolyMesh& mesh, Index face) {
  Vec3 sum = Vec3::Zero();
  for (const Index s : mesh.face_nodes[face]) sum += mesh.nodes[s];
  return sum / static_cast<double>(mesh.face_nodes.row_size(face));
}

Vec3 area_vector(const PolyMesh& mesh, Index face) {
  const auto s = mesh.face_nodes[face];
  if (mesh.dim == 2) {
    const Vec3 t = mesh.nodes[s[1]] - mesh.nodes[s[0]];
    return {t.y(), -t.x(), 0.0};
  }
  Vec3 area = Vec3::Zero();
  for (std::size_t i = 1; i + 1 < s.size(); ++i) {
    area += 0.5 * (mesh.nodes[s[i]] - mesh.nodes[s[0]]).cross(mesh.nodes[s[i + 1]] - mesh.nodes[s[0]]);
  }
  return area;
}

CellSides cell_sides(const PolyMesh& mesh) {
  CellSides sides;
  sides.cells.reserve(mesh.cell_faces.values.size());
  for (const Index face : mesh.cell_faces.values) {
    sides.cells.push_back(mesh.face_cells[face]);
    if (!mesh.face_fracture.empty()) sides.fracture.push_back(mesh.face_fracture[face]);
  }
  return sides;
}

void sort_rims(const PolyMesh& mesh, std::span<const Index> faces, std::vector<Rim>& rims) {
  rims.clear();
  for (Index i = 0; i < static_cast<Index>(faces.size()); ++i) {
    const auto nodes = mesh.face_nodes[faces[i]];
    if (mesh.dim == 2) {
      rims.push_back({nodes[0], nodes[0], i, false});
      rims.push_back({nodes[1], nodes[1], i, true});
      continue;
    }
    Index from = nodes.back();
    for (const Index to : nodes) {
      rims.push_back({std::min(from, to), std::max(from, to), i, from < to});
      from = to;
    }
  }
  std::sort(rims.begin(), rims.end(),
            [](const Rim& a, const Rim& b) { return std::pair(a.ends(), a.member) < std::pair(b.ends(), b.member); });
}

std::vector<Rim> sorted_rims(const PolyMesh& mesh, std::span<const Index> faces) {
  std::vector<Rim> rims;
  sort_rims(mesh, faces, rims);
  return rims;
}

}  // namespace polyslip::mesh
