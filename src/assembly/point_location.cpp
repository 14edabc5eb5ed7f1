#include "polyslip/assembly/point_location.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "polyslip/common/mpi.hpp"
#include "polyslip/spaces/hfv_cell.hpp"

namespace polyslip::assembly {

namespace {

/// Candidates whose distances differ by less, in units of the extent of the mesh, are equally near: round-off differs between
/// ranks.
constexpr double tie = 1e-10;

class Search {
 public:
  void offer(Index local, GlobalIndex input, double distance) { candidates_.push_back({local, input, distance}); }

  [[nodiscard]] Located best(MPI_Comm comm, double extent) const {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    double nearest = infinity;
    for (const Candidate& c : candidates_) nearest = std::min(nearest, c.distance);
    nearest = mpi::min(comm, nearest);
    if (nearest == infinity) return {};
    const Candidate* chosen = nullptr;
    for (const Candidate& c : candidates_)
      if (c.distance <= nearest + tie * extent && (chosen == nullptr || c.input < chosen->input)) chosen = &c;
    const double lowest = mpi::min(comm, chosen != nullptr ? chosen->input : infinity);
    return {chosen != nullptr && chosen->input == lowest ? chosen->local : -1, nearest, true};
  }

 private:
  struct Candidate {
    Index local;
    GlobalIndex input;
    double distance;
  };
  std::vector<Candidate> candidates_;
};

double extent(const mesh::DistributedMesh& mesh) {
  double longest = 0;
  for (const Vec3& x : mesh.mesh.nodes) longest = std::max(longest, x.cwiseAbs().maxCoeff());
  return mpi::max(mesh.comm, longest);
}

/// Largest distance beyond the planes of the cell's faces; at most 0 inside a convex cell.
double distance_outside(const mesh::PolyMesh& m, Index cell, const Vec3& at) {
  double outside = -std::numeric_limits<double>::infinity();
  for (Index face : m.cell_faces[cell]) {
    const auto geometry = spaces::face_geometry(m, face);
    outside = std::max(outside, m.orientation(cell, face) * geometry.normal.dot(at - geometry.centre));
  }
  return outside;
}

/// Distance from a convex face, measured across and along its plane; `hfv` is a buffer.
double distance_from_face(const mesh::PolyMesh& m, Index face, const Vec3& at, spaces::HfvCell& hfv) {
  hfv.build_fracture_face(face);
  double outside = 0;
  for (const spaces::HfvFace& ridge : hfv.faces()) outside = std::max(outside, ridge.normal.dot(at - ridge.centre));
  return std::hypot(outside, spaces::face_geometry(m, face).normal.dot(at - hfv.centre()));
}

}  // namespace

Located locate_in_cells(const mesh::DistributedMesh& mesh, const Vec3& at) {
  Search search;
  for (Index cell = 0; cell < mesh.cells.owned; ++cell)
    search.offer(cell, mesh.cell_input[cell], std::max(0.0, distance_outside(mesh.mesh, cell, at)));
  return search.best(mesh.comm, extent(mesh));
}

Located locate_on_fracture(const mesh::DistributedMesh& mesh, const std::string& fracture, const Vec3& at) {
  Search search;
  spaces::HfvCell hfv(mesh.mesh);
  for (Index f = 0; f < mesh.fractures.owned; ++f) {
    const Index face = mesh.fracture_faces[f];
    if (mesh.mesh.fracture_names[mesh.mesh.face_fracture[face]] != fracture) continue;
    search.offer(f, mesh.fracture_face_input[f], distance_from_face(mesh.mesh, face, at, hfv));
  }
  return search.best(mesh.comm, extent(mesh));
}

}  // namespace polyslip::assembly
