// Fractures from physical groups: the + side carried from face to face over the rims they share.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "polyslip/common/error.hpp"
#include "polyslip/mesh/face_tools.hpp"
#include "polyslip/mesh/fracture_parts.hpp"

namespace polyslip::mesh {
namespace {

constexpr double kSmooth =
    0.866;  ///< Cosine of the largest turn, 30 degrees, over which a side is carried where three or more faces meet.

std::vector<Index> faces_of_group(const PolyMesh& mesh, const FractureGeometry& fracture) {
  const auto tag = std::find(mesh.tag_names.begin(), mesh.tag_names.end(), fracture.group);
  if (tag == mesh.tag_names.end()) {
    throw InputError(fmt::format("the mesh has no physical group '{}'", fracture.group), place_text(fracture),
                     mesh.tag_names.empty() ? "It has no groups of faces at all"
                                            : fmt::format("Its groups are {}", fmt::join(mesh.tag_names, ", ")));
  }
  std::vector<Index> faces;
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    if (mesh.face_tag[f] == tag - mesh.tag_names.begin()) faces.push_back(f);
  }
  if (faces.empty()) {
    throw InputError(fmt::format("no face is in the physical group '{}'", fracture.group), place_text(fracture),
                     "Mesh the group's lines (2D) or surfaces (3D) together with the domain");
  }
  return faces;
}

/// Two members of the list of faces that continue each other, and whether they are turned alike now.
struct Link {
  Index a, b;
  bool alike;
};

/// Direction from the rim into the face, perpendicular to the rim.
Vec3 inward(const PolyMesh& mesh, const Rim& rim, Index face) {
  Vec3 into = node_average(mesh, face) - mesh.nodes[rim.low];
  if (rim.low != rim.high) {
    const Vec3 along = (mesh.nodes[rim.high] - mesh.nodes[rim.low]).normalized();
    into -= into.dot(along) * along;
  }
  return into.normalized();
}

/// Where two faces meet they are linked; where more meet, those that are each other's straightest continuation with no sharp turn.
std::vector<Link> find_links(const PolyMesh& mesh, const std::vector<Index>& faces) {
  std::vector<Link> links;
  for_each_shared_rim(sorted_rims(mesh, faces), [&](std::span<const Rim> rims) {
    const auto link = [&](const Rim& a, const Rim& b) { links.push_back({a.member, b.member, a.forward != b.forward}); };
    if (rims.size() == 2) link(rims[0], rims[1]);
    if (rims.size() < 3) return;
    std::vector<Vec3> into;
    for (const Rim& rim : rims) into.push_back(inward(mesh, rim, faces[rim.member]));
    const auto straightest = [&](std::size_t i) {
      return std::min_element(into.begin(), into.end(),
                              [&](const Vec3& a, const Vec3& b) { return a.dot(into[i]) < b.dot(into[i]); }) -
             into.begin();
    };
    for (std::size_t i = 0; i < into.size(); ++i) {
      const auto j = static_cast<std::size_t>(straightest(i));
      if (i < j && static_cast<std::size_t>(straightest(j)) == i && into[i].dot(into[j]) < -kSmooth) link(rims[i], rims[j]);
    }
  });
  return links;
}

/// Links of each member.
Csr links_by_member(const std::vector<Link>& links, Index members) {
  std::vector<std::vector<Index>> rows(members);
  for (Index l = 0; l < static_cast<Index>(links.size()); ++l) {
    rows[links[l].a].push_back(l);
    rows[links[l].b].push_back(l);
  }
  Csr result;
  for (const auto& row : rows) result.push_row(row);
  return result;
}

/// n^+ of the first face shall have a negative last component (the last that is not zero).
bool first_must_turn(const PolyMesh& mesh, Index face) {
  const Vec3 normal = area_vector(mesh, face);
  for (const int axis : {2, 1, 0}) {
    if (std::abs(normal[axis]) > 1e-9 * normal.norm()) return normal[axis] > 0.0;
  }
  return false;
}

}  // namespace

std::vector<FractureFace> match_group(const PolyMesh& mesh, const FractureGeometry& fracture) {
  const std::vector<Index> faces = faces_of_group(mesh, fracture);
  const std::vector<Link> links = find_links(mesh, faces);
  const Csr links_of = links_by_member(links, static_cast<Index>(faces.size()));

  std::vector<FractureFace> result;
  for (const Index face : faces) result.push_back({face, false});
  std::vector<char> done(faces.size(), false);
  std::vector<Index> front;
  for (Index start = 0; start < static_cast<Index>(faces.size()); ++start) {
    if (done[start]) continue;
    done[start] = true;
    result[start].turn = first_must_turn(mesh, faces[start]);
    for (front = {start}; !front.empty();) {
      const Index i = front.back();
      front.pop_back();
      for (const Index l : links_of[i]) {
        const Index next = links[l].a == i ? links[l].b : links[l].a;
        if (done[next]) continue;
        done[next] = true;
        result[next].turn = result[i].turn == links[l].alike;
        front.push_back(next);
      }
    }
  }
  return result;
}

}  // namespace polyslip::mesh
