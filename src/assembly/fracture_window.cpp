#include "polyslip/assembly/fracture_window.hpp"

#include <algorithm>
#include <array>
#include <limits>

#include "polyslip/common/mpi.hpp"
#include "polyslip/spaces/hfv_cell.hpp"

namespace polyslip::assembly {

namespace {

/// Ratios that differ by less are equally near: faces that slip are on the bound to the accuracy of Newton's method.
constexpr double tie = 1e-6;

double friction_bound(const physics::ContactLaw& law, double normal) {
  switch (law.kind) {
    case physics::FrictionLaw::tresca: return law.friction;
    case physics::FrictionLaw::coulomb: return law.friction * normal;
    default: return 0;
  }
}

}  // namespace

FractureWindow::FractureWindow(const mesh::DistributedMesh& mesh, const WindowRule& rule) : mesh_(mesh) {
  const mesh::PolyMesh& m = mesh.mesh;
  mpi::together(mesh.comm, [&] {
    for (Index f = 0; f < mesh.fractures.owned; ++f) {
      const Index face = mesh.fracture_faces[f], fracture = m.face_fracture[face];
      if (!rule.fracture.empty() && m.fracture_names[fracture] != rule.fracture) continue;
      const auto geometry = spaces::face_geometry(m, face);
      const EvalPoint at{.x = geometry.centre, .tip_distance = m.face_tip_distance[face], .fracture_length = m.fracture_length[fracture]};
      if (rule.where && (*rule.where)(at) == 0) continue;
      faces_.push_back(f);
      areas_.push_back(geometry.area);
      area_ += geometry.area;
    }
  });
  area_ = mpi::sum(mesh.comm, area_);
}

WindowValues FractureWindow::values(const MechanicsSystem& system, std::span<const FractureFaceValues> faces,
                                    std::span<const double> pressures, std::span<const double> apertures) const {
  std::array<double, 5> sums{};
  std::vector<double> ratios;
  double largest = 0;
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    const auto f = static_cast<std::size_t>(faces_[i]);
    const FractureFaceValues& face = faces[f];
    const double shear = face.traction_tangential.norm();
    const std::array<double, 5> entries{face.traction_normal, shear, face.slip, pressures.empty() ? 0 : pressures[f],
                                        apertures.empty() ? 0 : apertures[f]};
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += areas_[i] * entries[k];
    const double bound = friction_bound(system.contact_cells().faces()[f].law, face.traction_normal);
    ratios.push_back(face.state != physics::ContactState::open && bound > 0 ? shear / bound : 0);
    largest = std::max(largest, ratios.back());
  }
  mpi::sum_in_place(mesh_.comm, sums);
  largest = mpi::max(mesh_.comm, largest);

  constexpr double none = std::numeric_limits<double>::infinity();
  std::array<double, 3> nearest{};
  double first = none;
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    const auto input = static_cast<double>(mesh_.fracture_face_input[faces_[i]]);
    if (largest == 0 || ratios[i] < largest - tie || input >= first) continue;
    first = input;
    const FractureFaceValues& face = faces[static_cast<std::size_t>(faces_[i])];
    nearest = {ratios[i], face.traction_normal, face.traction_tangential.norm()};
  }
  if (first != mpi::min(mesh_.comm, first)) nearest = {};
  mpi::sum_in_place(mesh_.comm, nearest);
  const double scale = area_ > 0 ? 1 / area_ : 0;
  return {scale * sums[0], scale * sums[1], scale * sums[2], scale * sums[3], scale * sums[4], nearest[0], nearest[1], nearest[2]};
}

}  // namespace polyslip::assembly
