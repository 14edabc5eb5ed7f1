#include "polyslip/assembly/mechanics_fields.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::assembly {

std::vector<FractureFaceValues> fracture_values(const MechanicsSystem& system, Vec x) {
  MechanicalState state = system.layout().create_state();
  system.layout().gather(x, state);
  const auto states = system.states(x);
  const int dim = system.layout().dim();
  std::vector<FractureFaceValues> values;
  for (Index f = 0; f < system.mesh().fractures.owned; ++f) {
    const Eigen::Matrix3d& frame = system.contact_cells().faces()[f].frame;
    const Vec3 jump = system.contact_cells().jump(f, state);
    Vec3 lam = Vec3::Zero();
    for (int a = 0; a < dim; ++a) lam[a] = state.multiplier[static_cast<std::size_t>(dim) * f + a];
    const auto tangential = [&](const Vec3& v) { return Vec3(frame.transpose() * Vec3(0, v[1], v[2])); };
    values.push_back({states[f], lam[0], tangential(lam), jump[0], tangential(jump), (jump - system.initial_jumps()[f]).tail<2>().norm()});
  }
  return values;
}

CellLoop::CellLoop(const MechanicsSystem& system, Vec x)
    : system_(system), state_(system.layout().create_state()), fracture_of_face_(mesh::fracture_numbers(system.mesh())) {
  system.layout().gather(x, state_);
}

void CellLoop::values(const spaces::VemCell& vem, std::vector<double>& v) const {
  const int dim = system_.layout().dim();
  v.clear();
  for (Index copy : system_.mesh().mesh.copies_of(vem.cell()))
    for (int a = 0; a < dim; ++a) v.push_back(state_.displacement[system_.layout().of_copy(copy) + a]);
  for (int k = 0; k < vem.n_normals(); ++k) {
    const double value = state_.displacement[system_.layout().of_normal(vem.normal_faces()[k])];
    for (int a = 0; a < dim; ++a) v.push_back(value * vem.normal(vem.n_nodes() + k)[a]);
  }
  for (Index face : vem.bubble_faces())
    for (int a = 0; a < dim; ++a) v.push_back(state_.bubble[static_cast<std::size_t>(dim) * fracture_of_face_[face] + a]);
}

std::vector<double> cell_stresses(const MechanicsSystem& system, Vec x) {
  const CellLoop loop(system, x);
  spaces::VemCell vem(system.mesh().mesh, system.layout().bubbles());
  std::vector<double> v, stresses;
  for (Index cell = 0; cell < system.mesh().cells.owned; ++cell) {
    vem.build(cell);
    loop.values(vem, v);
    Eigen::Matrix3d s = physics::stress(system.moduli()[cell], vem.gradient(v));
    if (const auto& initial = system.problem().initial_stress) s += physics::initial_stress(*initial, {.x = vem.xbar()});
    stresses.insert(stresses.end(), {s(0, 0), s(1, 1), s(2, 2), s(0, 1), s(1, 2), s(0, 2)});
  }
  return stresses;
}

std::vector<double> copy_displacements(const MechanicsSystem& system, Vec x) {
  const la::VecRead a(x);
  const int dim = system.layout().dim();
  std::vector<double> u(3 * static_cast<std::size_t>(system.mesh().copies.owned), 0.0);
  for (Index copy = 0; copy < system.mesh().copies.owned; ++copy)
    for (int i = 0; i < dim; ++i) u[3 * static_cast<std::size_t>(copy) + i] = a[dim * copy + i];
  return u;
}

FractureExtremes fracture_extremes(const MechanicsSystem& system, std::span<const FractureFaceValues> values) {
  FractureExtremes e;
  std::array<double, 4> integrals{};
  const mesh::DistributedMesh& mesh = system.mesh();
  for (std::size_t f = 0; f < values.size(); ++f) {
    const double area = system.contact_cells().faces()[f].area, size = mesh.mesh.dim == 2 ? area : std::sqrt(area);
    const auto [plus, minus] = mesh.mesh.face_cells[mesh.fracture_faces[f]];
    e.max_slip = std::max(e.max_slip, values[f].slip);
    e.max_opening = std::max(e.max_opening, -values[f].jump_normal);
    integrals[0] += area * values[f].slip;
    integrals[1] -= area * values[f].jump_normal;
    if (values[f].slip > has_slipped * size) integrals[2] += area;
    integrals[3] += 0.5 * (system.moduli()[plus].mu + system.moduli()[minus].mu) * area * values[f].slip;
  }
  mpi::sum_in_place(mesh.comm, integrals);
  return {mpi::max(mesh.comm, e.max_slip), mpi::max(mesh.comm, e.max_opening), integrals[0], integrals[1], integrals[2], integrals[3]};
}

std::vector<double> DisplacementProbes::displacements(const MechanicsSystem& system, Vec x) const {
  const CellLoop loop(system, x);
  spaces::VemCell vem(system.mesh().mesh, system.layout().bubbles());
  std::vector<double> v, u(3 * points_.size(), 0.0);
  for (std::size_t k = 0; k < points_.size(); ++k) {
    if (cells_[k].local < 0) continue;
    vem.build(cells_[k].local);
    loop.values(vem, v);
    const Vec3 value = vem.value(vem.gradient(v), v, points_[k]);
    std::copy(value.begin(), value.end(), u.begin() + static_cast<std::ptrdiff_t>(3 * k));
  }
  mpi::sum_in_place(system.mesh().comm, u);
  return u;
}

}  // namespace polyslip::assembly
