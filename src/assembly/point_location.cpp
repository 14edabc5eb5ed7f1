#include "polyslip/assembly/point_location.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "polyslip/common/mpi.hpp"
#include "polyslip/spaces/hfv_cell.hpp"

namespace polyslip::assembly {

namespace {

/// Candidates whose distances differ by less, in units of the extent of the mesh, are equally near: round-off differs between
/// ranks.
constexpr double tie = 1e-10;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// What one rank has to offer for one point.
class Search {
 public:
  struct Candidate {
    Index local;
    GlobalIndex input;
    double distance;
  };
  void offer(Index local, GlobalIndex input, double distance) { candidates_.push_back({local, input, distance}); }

  [[nodiscard]] double nearest() const {
    double nearest = infinity;
    for (const Candidate& c : candidates_) nearest = std::min(nearest, c.distance);
    return nearest;
  }
  /// Of the candidates that are no farther than `limit`, that with the lowest number; null where there is none.
  [[nodiscard]] const Candidate* lowest_within(double limit) const {
    const Candidate* lowest = nullptr;
    for (const Candidate& c : candidates_)
      if (c.distance <= limit && (lowest == nullptr || c.input < lowest->input)) lowest = &c;
    return lowest;
  }

 private:
  std::vector<Candidate> candidates_;
};

/// The best candidate of each search over all ranks.
std::vector<Located> best_of(const std::vector<Search>& searches, MPI_Comm comm, double extent) {
  std::vector<double> nearest, lowest;
  for (const Search& search : searches) nearest.push_back(search.nearest());
  mpi::min_in_place(comm, nearest);  // all points of a line cost one message
  std::vector<const Search::Candidate*> own;
  for (std::size_t k = 0; k < searches.size(); ++k) {
    own.push_back(searches[k].lowest_within(nearest[k] + tie * extent));
    lowest.push_back(own[k] != nullptr ? own[k]->input : infinity);
  }
  mpi::min_in_place(comm, lowest);
  std::vector<Located> located(searches.size());
  for (std::size_t k = 0; k < searches.size(); ++k)
    if (nearest[k] < infinity)
      located[k] = {own[k] != nullptr && own[k]->input == lowest[k] ? own[k]->local : -1, nearest[k], true};
  return located;
}

double extent(const mesh::DistributedMesh& mesh) {
  double longest = 0;
  for (const Vec3& x : mesh.mesh.nodes) longest = std::max(longest, x.cwiseAbs().maxCoeff());
  return mpi::max(mesh.comm, longest);
}

/// The planes of a cell's faces, normals outwards.
void planes_of(const mesh::PolyMesh& m, Index cell, std::vector<Eigen::Hyperplane<double, 3>>& planes) {
  planes.clear();
  for (Index face : m.cell_faces[cell]) {
    const auto geometry = spaces::face_geometry(m, face);
    planes.emplace_back(m.orientation(cell, face) * geometry.normal, geometry.centre);
  }
}

Eigen::AlignedBox3d bounds_of(const mesh::PolyMesh& m, Index cell) {
  Eigen::AlignedBox3d box;
  for (Index face : m.cell_faces[cell])
    for (Index node : m.face_nodes[face]) box.extend(m.nodes[node]);
  return box;
}

/// Offers each owned cell to the searches for those `chosen` points that its bounds hold, which are widened by `slack`. Its distance
/// is the largest beyond the planes of its faces, at least 0: 0 inside a convex cell.
void offer_cells(const mesh::DistributedMesh& mesh, std::span<const Vec3> points, std::span<const std::size_t> chosen, double slack,
                 std::vector<Search>& searches) {
  std::vector<Eigen::Hyperplane<double, 3>> planes;
  for (Index cell = 0; cell < mesh.cells.owned; ++cell) {
    planes.clear();
    Eigen::AlignedBox3d box = bounds_of(mesh.mesh, cell);
    box.min().array() -= slack;
    box.max().array() += slack;
    for (const std::size_t k : chosen) {
      if (!box.contains(points[k])) continue;
      if (planes.empty()) planes_of(mesh.mesh, cell, planes);
      double outside = 0;
      for (const auto& plane : planes) outside = std::max(outside, plane.signedDistance(points[k]));
      searches[k].offer(cell, mesh.cell_input[cell], outside);
    }
  }
}

/// Distance from a convex face, measured across and along its plane; `hfv` is a buffer.
double distance_from_face(const mesh::PolyMesh& m, Index face, const Vec3& at, spaces::HfvCell& hfv) {
  hfv.build_fracture_face(face);
  double outside = 0;
  for (const spaces::HfvFace& ridge : hfv.faces()) outside = std::max(outside, ridge.normal.dot(at - ridge.centre));
  return std::hypot(outside, spaces::face_geometry(m, face).normal.dot(at - hfv.centre()));
}

}  // namespace

std::vector<Located> locate_in_cells(const mesh::DistributedMesh& mesh, std::span<const Vec3> points) {
  const double size = extent(mesh), slack = tie * size;
  std::vector<Located> located(points.size());
  std::vector<std::size_t> chosen(points.size());
  std::iota(chosen.begin(), chosen.end(), 0);
  // Nearly every point lies in a cell, which its bounds tell; for the rest all cells are candidates.
  for (const double reach : {2 * slack, infinity}) {
    std::vector<Search> searches(points.size());
    offer_cells(mesh, points, chosen, reach, searches);
    const std::vector<Located> best = best_of(searches, mesh.comm, size);
    for (const std::size_t k : chosen) located[k] = best[k];
    std::erase_if(chosen, [&](std::size_t k) { return located[k].found && located[k].distance <= slack; });
    if (chosen.empty()) break;
  }
  return located;
}

Located locate_in_cells(const mesh::DistributedMesh& mesh, const Vec3& at) { return locate_in_cells(mesh, std::span(&at, 1))[0]; }

Located locate_on_fracture(const mesh::DistributedMesh& mesh, const std::string& fracture, const Vec3& at) {
  std::vector<Search> search(1);
  spaces::HfvCell hfv(mesh.mesh);
  for (Index f = 0; f < mesh.fractures.owned; ++f) {
    const Index face = mesh.fracture_faces[f];
    if (mesh.mesh.fracture_names[mesh.mesh.face_fracture[face]] != fracture) continue;
    search[0].offer(f, mesh.fracture_face_input[f], distance_from_face(mesh.mesh, face, at, hfv));
  }
  return best_of(search, mesh.comm, extent(mesh))[0];
}

}  // namespace polyslip::assembly
