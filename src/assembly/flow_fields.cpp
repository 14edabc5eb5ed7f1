#include "polyslip/assembly/flow_fields.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::assembly {

namespace {

/// A flow state made ready for loops over elements.
class Gradients {
 public:
  Gradients(const FlowSystem& system, Vec q)
      : system_(system), q_(static_cast<std::size_t>(system.layout().local_size())), hfv_(system.mesh().mesh) {
    system.layout().gather(q, q_);
  }
  /// G_K q; element() is the cell then.
  Vec3 in_cell(Index cell) {
    const mesh::DistributedMesh& mesh = system_.mesh();
    hfv_.build(cell);
    faces_.clear();
    for (Index face : mesh.mesh.cell_faces[cell])
      faces_.push_back(system_.fluxes().pressure(
          q_, system_.layout().trace(mesh.flow.face_traces[face][mesh.mesh.face_cells[face][0] == cell ? 0 : 1])));
    return hfv_.gradient(q_[system_.layout().cell(cell)], faces_);
  }
  /// V_f = 1/|sigma| sum_e F_{sigma e} (x_e - x_sigma), which is -(C_f/eta) G_sigma q where no ridge is sealed.
  Vec3 flux_in_fracture_face(Index f) {
    hfv_.build_fracture_face(system_.mesh().fracture_faces[f]);
    system_.fluxes().ridge_fluxes(f, q_, faces_);
    Vec3 moment = Vec3::Zero();
    for (int e = 0; e < hfv_.size(); ++e) moment += faces_[e] * (hfv_.faces()[e].centre - hfv_.centre());
    return moment / hfv_.measure();
  }
  [[nodiscard]] const spaces::HfvCell& element() const { return hfv_; }
  [[nodiscard]] double cell_value(Index cell) const { return q_[system_.layout().cell(cell)]; }
  /// p at a point by the unknowns of a cell.
  double pressure(Index cell, const Vec3& at) {
    const Vec3 gradient = in_cell(cell);
    return cell_value(cell) + gradient.dot(at - hfv_.centre()) + system_.reference_at(at);
  }
  /// V_K
  Vec3 flux(Index cell) { return -system_.rock()[cell].permeability / system_.problem().viscosity * in_cell(cell); }

 private:
  const FlowSystem& system_;
  std::vector<double> q_, faces_;
  spaces::HfvCell hfv_;
};

void append(std::vector<double>& values, const Vec3& v) { values.insert(values.end(), {v.x(), v.y(), v.z()}); }

/// Squares of an error and of the exact field, summed over ranks at the end.
struct Squares {
  double error = 0, exact = 0;
  [[nodiscard]] double relative(MPI_Comm comm) const {
    const double e = std::sqrt(std::max(0.0, mpi::sum(comm, error))), n = std::sqrt(std::max(0.0, mpi::sum(comm, exact)));
    return n > 0 ? e / n : e;
  }
};

}  // namespace

std::vector<double> cell_pressures(const FlowSystem& system, Vec q) {
  const la::VecRead a(q);
  std::vector<double> p;
  for (Index cell = 0; cell < system.mesh().cells.owned; ++cell) {
    const Index i = system.layout().cell(cell);
    p.push_back(a[i] + system.reference()[i]);
  }
  return p;
}

std::vector<double> cell_fluxes(const FlowSystem& system, Vec q) {
  Gradients gradients(system, q);
  std::vector<double> fluxes;
  for (Index cell = 0; cell < system.mesh().cells.owned; ++cell) append(fluxes, gradients.flux(cell));
  return fluxes;
}

std::vector<double> fracture_pressures(const FlowSystem& system, Vec q) {
  if (!system.layout().with_fractures()) return {};
  std::vector<double> local(static_cast<std::size_t>(system.layout().local_size())), p;
  system.layout().gather(q, local);
  for (Index f = 0; f < system.mesh().fractures.local(); ++f) {
    const Index i = system.layout().fracture(f);
    p.push_back(local[i] + system.reference()[i]);
  }
  return p;
}

std::vector<double> fracture_fluxes(const FlowSystem& system, Vec q) {
  Gradients gradients(system, q);
  std::vector<double> fluxes;
  for (Index f = 0; system.layout().with_fractures() && f < system.mesh().fractures.owned; ++f)
    append(fluxes, gradients.flux_in_fracture_face(f));
  return fluxes;
}

PressureExtremes pressure_extremes(const FlowSystem& system, Vec q) {
  const MPI_Comm comm = system.mesh().comm;
  const std::vector<double> p = cell_pressures(system, q);
  double low = std::numeric_limits<double>::infinity(), high = -low;
  std::array<double, 2> sums{};
  for (std::size_t cell = 0; cell < p.size(); ++cell) {
    low = std::min(low, p[cell]);
    high = std::max(high, p[cell]);
    sums[0] += system.fluxes().volumes()[cell] * p[cell];
    sums[1] += system.fluxes().volumes()[cell];
  }
  mpi::sum_in_place(comm, sums);
  return {mpi::min(comm, low), mpi::max(comm, high), sums[0] / sums[1]};
}

std::vector<std::string> boundary_names(const physics::FlowProblem& problem) {
  std::vector<std::string> names;
  for (const physics::FlowBoundaryRule& rule : problem.boundary)
    if (!rule.name.empty() && std::ranges::find(names, rule.name) == names.end()) names.push_back(rule.name);
  return names;
}

std::vector<BoundaryFigures> boundary_figures(const FlowSystem& system, Vec q) {
  const std::vector<std::string> names = boundary_names(system.problem());
  if (names.empty()) return {};
  const mesh::DistributedMesh& mesh = system.mesh();
  const FlowLayout& layout = system.layout();
  const FlowLoadAssembler& loads = system.load_assembler();
  la::Handle<Vec> fluxes = layout.create_vector();
  POLYSLIP_PETSC(MatMult(system.fluxes().matrix(), q, fluxes));
  const la::VecRead flux(fluxes), values(q);
  std::vector<double> sums(3 * names.size());  // of each name: outflow, integral of the pressure, area
  const auto sums_of = [&](Index rule) -> double* {
    if (rule < 0) return nullptr;
    const auto found = std::ranges::find(names, system.problem().boundary[rule].name);
    return found == names.end() ? nullptr : &sums[3 * static_cast<std::size_t>(found - names.begin())];
  };
  const auto outflow = [&](Index i) { return system.fixed()[i] ? -flux[i] : -system.loads().sources[i]; };
  for (Index face = 0; face < mesh.mesh.n_faces(); ++face) {
    double* own = sums_of(loads.face_rules()[face]);
    const Index trace = own == nullptr ? layout.size() : layout.trace(mesh.flow.face_traces[face][0]);
    if (trace >= layout.size()) continue;
    const double area = spaces::face_geometry(mesh.mesh, face).area;
    own[0] += outflow(trace);
    own[1] += area * (values[trace] + system.reference()[trace]);
    own[2] += area;
  }
  for (Index r = 0; layout.with_fractures() && r < mesh.flow.ridges.owned; ++r)
    if (double* own = sums_of(loads.fixed_rules()[layout.ridge(r)])) own[0] += outflow(layout.ridge(r));
  mpi::sum_in_place(mesh.comm, sums);
  std::vector<BoundaryFigures> figures;
  for (std::size_t k = 0; k < sums.size(); k += 3)
    figures.push_back({sums[k], sums[k + 2] > 0 ? sums[k + 1] / sums[k + 2] : 0});  // a later rule may have taken all faces
  return figures;
}

std::vector<double> PressureProbes::pressures(const FlowSystem& system, Vec q) const {
  Gradients gradients(system, q);
  std::vector<double> values(points_.size(), 0.0);
  for (std::size_t k = 0; k < points_.size(); ++k)
    if (cells_[k].local >= 0) values[k] = gradients.pressure(cells_[k].local, points_[k]);
  mpi::sum_in_place(system.mesh().comm, values);
  return values;
}

FlowErrorNorms flow_error_norms(const FlowSystem& system, const physics::ExactFlow& exact, double time, Vec q) {
  Gradients gradients(system, q);
  Squares pressure, flux;
  std::vector<geometry::QuadraturePoint> rule;
  mpi::together(system.mesh().comm, [&] {
    for (Index cell = 0; cell < system.mesh().cells.owned; ++cell) {
      const Vec3 V = gradients.flux(cell);
      if (exact.pressure) {
        const Vec3& centre = gradients.element().centre();
        const double volume = system.fluxes().volumes()[cell], p = (*exact.pressure)({.x = centre, .t = time});
        pressure.error += volume * std::pow(gradients.cell_value(cell) + system.reference_at(centre) - p, 2);
        pressure.exact += volume * p * p;
      }
      if (!exact.flux) continue;
      rule.clear();
      gradients.element().append_rule(rule);
      for (const auto& point : rule) {
        const EvalPoint at{.x = point.x, .t = time};
        Vec3 v = Vec3::Zero();
        for (int a = 0; a < system.mesh().mesh.dim; ++a) v[a] = (*exact.flux)[a](at);
        flux.error += point.weight * (V - v).squaredNorm();
        flux.exact += point.weight * v.squaredNorm();
      }
    }
  });
  FlowErrorNorms norms;
  if (exact.pressure) norms.pressure = pressure.relative(system.mesh().comm);
  if (exact.flux) norms.flux = flux.relative(system.mesh().comm);
  return norms;
}

}  // namespace polyslip::assembly
