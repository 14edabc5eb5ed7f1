#include "polyslip/mesh/fractures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "polyslip/common/error.hpp"
#include "polyslip/geometry/faces.hpp"
#include "polyslip/mesh/face_tools.hpp"
#include "polyslip/mesh/fracture_parts.hpp"

namespace polyslip::mesh {
namespace {

void claim_faces(PolyMesh& mesh, const std::vector<FractureFace>& matched, Index number,
                 const std::vector<FractureGeometry>& fractures) {
  for (const auto& [face, turn] : matched) {
    const std::string at = point_text(node_average(mesh, face), mesh.dim);
    if (mesh.on_boundary(face)) {
      throw InputError(
          fmt::format("its face at {} lies on the boundary of the domain", at), place_text(fractures[number]),
          "A fracture needs cells on both sides: move it inside, extend the domain, or, if the mesh was split along the fracture, "
          "merge its doubled nodes");
    }
    if (mesh.face_fracture[face] >= 0) {
      throw InputError(fmt::format("its face at {} belongs to fracture '{}' too", at, fractures[mesh.face_fracture[face]].name),
                       place_text(fractures[number]), "Let one of the two fractures end where the other begins");
    }
    mesh.face_fracture[face] = number;
    if (!turn) continue;
    std::swap(mesh.face_cells[face][0], mesh.face_cells[face][1]);
    const auto nodes = mesh.face_nodes[face];
    std::reverse(nodes.begin(), nodes.end());
  }
}

/// Box around all fractures given by points, a little larger.
Eigen::AlignedBox3d box_around(const std::vector<FractureGeometry>& fractures) {
  Eigen::AlignedBox3d box;
  for (const FractureGeometry& fracture : fractures) {
    for (const Vec3& x : fracture.points) box.extend(x);
  }
  const double margin = 1e-3 * box.diagonal().norm();
  box.min().array() -= margin;
  box.max().array() += margin;
  return box;
}

/// Rims of all boundary faces.
std::vector<Rim> boundary_rims(const PolyMesh& mesh) {
  std::vector<Index> faces;
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    if (mesh.on_boundary(f)) faces.push_back(f);
  }
  return sorted_rims(mesh, faces);
}

/// Rims of one face of the fracture only, inside the domain.
std::vector<Rim> find_tips(const PolyMesh& mesh, std::span<const Index> faces, const std::vector<Rim>& boundary) {
  std::vector<Rim> tips;
  const auto before = [](const Rim& a, const Rim& b) { return a.ends() < b.ends(); };
  for_each_shared_rim(sorted_rims(mesh, faces), [&](std::span<const Rim> rims) {
    if (rims.size() == 1 && !std::binary_search(boundary.begin(), boundary.end(), rims[0], before)) tips.push_back(rims[0]);
  });
  return tips;
}

/// Size of the fracture and distance of each of its faces to its nearest tip.
void measure_fracture(PolyMesh& mesh, std::span<const Index> faces, const std::vector<Rim>& boundary) {
  const std::vector<Rim> tips = find_tips(mesh, faces, boundary);
  double size = 0.0;
  std::vector<Vec3> points, g;
  std::vector<double> w;
  for (const Index face : faces) {
    points.clear();
    for (const Index s : mesh.face_nodes[face]) points.push_back(mesh.nodes[s]);
    g.resize(points.size());
    w.resize(points.size());
    geometry::vector_weights(mesh.dim, points, g);
    const geometry::FaceGeometry geometry = geometry::face_geometry(points, g, w);
    size += geometry.area;
    double distance = std::numeric_limits<double>::infinity();
    for (const Rim& tip : tips)
      distance = std::min(distance, distance_to_segment(geometry.centre, mesh.nodes[tip.low], mesh.nodes[tip.high]));
    mesh.face_tip_distance[face] = distance;
  }
  mesh.fracture_length.push_back(mesh.dim == 2 ? size : std::sqrt(size));
}

}  // namespace

void mark_fractures(PolyMesh& mesh, const std::vector<FractureGeometry>& fractures) {
  if (fractures.empty()) return;
  mesh.face_fracture.assign(mesh.n_faces(), -1);
  mesh.face_tip_distance.assign(mesh.n_faces(), 0.0);
  mesh.fracture_names.clear();
  mesh.fracture_length.clear();

  const std::vector<Rim> boundary = boundary_rims(mesh);
  std::optional<FaceFinder> finder;
  std::vector<Index> faces;
  for (const FractureGeometry& fracture : fractures) {
    const auto number = static_cast<Index>(mesh.fracture_names.size());
    if (fracture.group.empty() && !finder) finder.emplace(mesh, box_around(fractures));
    const auto matched = fracture.group.empty() ? match_points(mesh, *finder, fracture) : match_group(mesh, fracture);
    claim_faces(mesh, matched, number, fractures);
    faces.clear();
    for (const FractureFace& face : matched) faces.push_back(face.face);
    std::sort(faces.begin(), faces.end());
    measure_fracture(mesh, faces, boundary);
    mesh.fracture_names.push_back(fracture.name);
  }
}

}  // namespace polyslip::mesh
