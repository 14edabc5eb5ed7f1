#include "polyslip/mesh/poly_mesh.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

#include "polyslip/common/error.hpp"
#include "polyslip/mesh/face_tools.hpp"

namespace polyslip::mesh {
namespace {

/// Sets that know for each member whether it is turned like the representative of its set.
class SignedSets {
 public:
  void reset(Index size) {
    parent_.resize(size);
    std::iota(parent_.begin(), parent_.end(), 0);
    turned_.assign(size, false);
  }
  /// Representative and whether i is turned against it.
  std::pair<Index, bool> find(Index i) {
    bool turned = false;
    while (parent_[i] != i) {
      turned ^= static_cast<bool>(turned_[i]);
      i = parent_[i];
    }
    return {i, turned};
  }
  /// States that a and b are turned alike (or not); false if that contradicts an earlier statement.
  bool unite(Index a, Index b, bool alike) {
    const auto [root_a, turned_a] = find(a);
    const auto [root_b, turned_b] = find(b);
    const bool turned = (turned_a != turned_b) == alike;
    if (root_a == root_b) return !turned;
    parent_[std::max(root_a, root_b)] = std::min(root_a, root_b);
    turned_[std::max(root_a, root_b)] = turned;
    return true;
  }

 private:
  std::vector<Index> parent_;
  std::vector<char> turned_;
};

Index number_of(Index i, const std::vector<Index>& numbers) { return numbers.empty() ? i : numbers[i]; }

/// Turns the faces of one cell outwards: pairs its faces at their rims, then looks at the sign of the volume.
class CellOrienter {
 public:
  CellOrienter(const PolyMesh& mesh, const std::vector<Index>& numbers) : mesh_(mesh), numbers_(numbers) {}

  /// One entry a face of the cell: true where face_nodes already gives the outward normal.
  const std::vector<char>& outward(Index cell) {
    const auto faces = mesh_.cell_faces[cell];
    sort_rims(mesh_, faces, rims_);
    turn_alike(cell, static_cast<Index>(faces.size()));
    if (signed_volume(cell) < 0.0) {
      for (char& out : outward_) out = !out;
    }
    return outward_;
  }

 private:
  void turn_alike(Index cell, Index n_faces) {
    sets_.reset(n_faces);
    for_each_shared_rim(rims_, [&](std::span<const Rim> rims) {
      if (rims.size() != 2) fail(cell, open_rim(rims));
      if (!sets_.unite(rims[0].member, rims[1].member, rims[0].forward != rims[1].forward)) {
        fail(cell, "its faces close to a one-sided surface");
      }
    });
    outward_.resize(n_faces);
    for (Index i = 0; i < n_faces; ++i) {
      const auto [root, turned] = sets_.find(i);
      if (root != 0) fail(cell, "its faces close to more than one surface");
      outward_[i] = !turned;
    }
  }

  [[nodiscard]] std::string open_rim(std::span<const Rim> rims) const {
    const Vec3 middle = 0.5 * (mesh_.nodes[rims[0].low] + mesh_.nodes[rims[0].high]);
    return fmt::format("its faces do not close: {} of them at the {} about ({:g}, {:g}, {:g}), where two must meet", rims.size(),
                       mesh_.dim == 2 ? "node" : "edge", middle.x(), middle.y(), middle.z());
  }

  /// Volume enclosed by the faces turned as in outward_, each a fan of triangles about its node average.
  double signed_volume(Index cell) const {
    const auto faces = mesh_.cell_faces[cell];
    const Vec3 origin = mesh_.nodes[mesh_.face_nodes[faces[0]][0]];
    double volume = 0.0, extent = 0.0;
    for (std::size_t i = 0; i < faces.size(); ++i) {
      const auto nodes = mesh_.face_nodes[faces[i]];
      volume += (outward_[i] ? 1.0 : -1.0) * volume_below(nodes, origin);
      for (const Index s : nodes) extent = std::max(extent, (mesh_.nodes[s] - origin).norm());
    }
    if (!(std::abs(volume) > 1e-14 * std::pow(extent, mesh_.dim))) {
      fail(cell, fmt::format("its volume is {:g}, not positive, with an extent of {:g} m", volume, extent));
    }
    return volume;
  }

  double volume_below(std::span<const Index> nodes, const Vec3& origin) const {
    Vec3 from = mesh_.nodes[nodes.back()] - origin;
    if (mesh_.dim == 2) {
      const Vec3 to = mesh_.nodes[nodes.front()] - origin;  // the edge runs from front to back
      return 0.5 * to.cross(from).z();
    }
    Vec3 centre = Vec3::Zero();
    for (const Index s : nodes) centre += (mesh_.nodes[s] - origin) / static_cast<double>(nodes.size());
    double volume = 0.0;
    for (const Index s : nodes) {
      const Vec3 to = mesh_.nodes[s] - origin;
      volume += centre.dot(from.cross(to)) / 6.0;
      from = to;
    }
    return volume;
  }

  [[noreturn]] void fail(Index cell, const std::string& what) const {
    const Vec3 at = mesh_.nodes[mesh_.face_nodes[mesh_.cell_faces[cell][0]][0]];
    throw InputError(what, fmt::format("cell {} at ({:g}, {:g}, {:g})", number_of(cell, numbers_), at.x(), at.y(), at.z()),
                     "Repair this cell in the mesh file or generate the mesh again");
  }

  const PolyMesh& mesh_;
  const std::vector<Index>& numbers_;
  std::vector<Rim> rims_;
  SignedSets sets_;
  std::vector<char> outward_;
};

}  // namespace

Vec3 cell_node_average(const PolyMesh& mesh, Index cell) {
  Vec3 c = Vec3::Zero();
  for (Index s : mesh.cell_nodes[cell]) c += mesh.nodes[s];
  return c / mesh.cell_nodes.row_size(cell);
}

double cell_diameter(const PolyMesh& mesh, Index cell) {
  const auto nodes = mesh.cell_nodes[cell];
  double longest = 0;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) longest = std::max(longest, (mesh.nodes[nodes[i]] - mesh.nodes[nodes[j]]).squaredNorm());
  return std::sqrt(longest);
}

void orient_faces(PolyMesh& mesh, const std::vector<Index>& cell_numbers, const std::vector<Index>& face_numbers) {
  CellOrienter orienter(mesh, cell_numbers);
  enum : char { kUnseen = 2 };
  std::vector<std::array<char, 2>> outward(mesh.n_faces(), {kUnseen, kUnseen});  // as seen from the first and the second cell
  for (Index c = 0; c < mesh.n_cells(); ++c) {
    const auto& of_cell = orienter.outward(c);
    const auto faces = mesh.cell_faces[c];
    for (std::size_t i = 0; i < faces.size(); ++i) outward[faces[i]][mesh.face_cells[faces[i]][0] == c ? 0 : 1] = of_cell[i];
  }
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    if (outward[f][0] == outward[f][1]) {
      const Vec3 at = mesh.nodes[mesh.face_nodes[f][0]];
      throw InputError("both cells lie on the same side of the face they share, so they overlap",
                       fmt::format("cells {} and {}, face {} at ({:g}, {:g}, {:g})", number_of(mesh.face_cells[f][0], cell_numbers),
                                   number_of(mesh.face_cells[f][1], cell_numbers), number_of(f, face_numbers), at.x(), at.y(), at.z()),
                       "Repair these cells in the mesh file or generate the mesh again");
    }
    if (!outward[f][0]) std::reverse(mesh.face_nodes[f].begin(), mesh.face_nodes[f].end());
  }
}

}  // namespace polyslip::mesh
