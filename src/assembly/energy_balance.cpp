#include "polyslip/assembly/energy_balance.hpp"

#include <algorithm>
#include <cmath>

#include "polyslip/assembly/mechanics_fields.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::assembly {

namespace {

/// Values of a cell by component of VemCell.
Eigen::VectorXd cell_values(const CellLoop& loop, const spaces::VemCell& vem, std::vector<double>& buffer) {
  loop.values(vem, buffer);
  const int dim = static_cast<int>(buffer.size()) / vem.size();
  Eigen::VectorXd values(vem.components());
  for (int j = 0; j < vem.size(); ++j) {
    const Eigen::Map<const Eigen::VectorXd> v(&buffer[static_cast<std::size_t>(dim * j)], dim);
    if (vem.is_normal(j))
      values[vem.first_component(j)] = v.dot(vem.normal(j).head(dim));
    else
      values.segment(vem.first_component(j), dim) = v;
  }
  return values;
}

struct CellSums {
  double elastic = 0;   ///< 1/2 u.Ku
  double reaction = 0;  ///< Internal forces of cells on prescribed displacements.
};

/// 1/2 u.Ku of what is not prescribed, by the product that the momentum rows need anyway. Of this rank's rows.
double free_elastic_energy(const CoupledSystem& system, Vec z) {
  const Layout& layout = system.layout();
  la::Handle<Vec> u = system.create_vector(), force = system.create_vector();
  POLYSLIP_PETSC(VecCopy(z, u));
  {
    const la::VecWrite values(u);
    for (Index i = 0; i < layout.displacement_size(); ++i)
      if (system.fixed()[i]) values[i] = 0;
    for (Index i = layout.multiplier_start(); i < layout.size(); ++i) values[i] = 0;
  }
  system.MechanicsSystem::momentum_action(u, force);
  const la::VecRead values(u), rows(force);
  double sum = 0;
  for (Index i = 0; i < layout.multiplier_start(); ++i) sum += values[i] * rows[i];
  return 0.5 * sum;
}

/// Over the owned cells; `change` is u^n - u^{n-1}. Only cells with prescribed displacements are built again.
CellSums sum_cells(const CoupledSystem& system, Vec z, Vec change) {
  const mesh::PolyMesh& mesh = system.mesh().mesh;
  const int dim = mesh.dim;
  const CellLoop state(system, z), step(system, change);
  std::vector<double> q(static_cast<std::size_t>(system.flow().layout().local_size())), buffer, stiffness;
  la::Handle<Vec> pressures = system.flow().layout().create_vector(), mechanics = system.layout().create_vector();
  system.split(z, mechanics, pressures);
  system.flow().layout().gather(pressures, q);
  spaces::VemCell vem(mesh, system.layout().bubbles());
  std::vector<Index> displacements;
  CellSums sums;
  sums.elastic = free_elastic_energy(system, z);
  for (Index cell = 0; cell < system.mesh().cells.owned; ++cell) {
    displacements.clear();
    system.layout().append_displacements(mesh, cell, displacements);
    if (std::none_of(displacements.begin(), displacements.end(), [&](Index i) { return system.fixed()[i] != 0; })) continue;
    vem.build(cell);
    const int n = vem.components();
    stiffness.resize(static_cast<std::size_t>(n) * static_cast<std::size_t>(n));
    const physics::Lame& lame = system.moduli()[cell];
    physics::local_stiffness(dim, vem, lame, physics::stabilisation_factor(lame, system.problem().stabilisation), stiffness);
    const Eigen::Map<const Eigen::MatrixXd> k(stiffness.data(), n, n);
    const Eigen::VectorXd u = cell_values(state, vem, buffer), du = cell_values(step, vem, buffer), force = k * u;
    const double push = system.flow().rock()[cell].biot * vem.volume() * q[system.flow().layout().cell(cell)];
    Eigen::VectorXd prescribed = Eigen::VectorXd::Zero(n);
    for (int j = 0; j < vem.n_nodes() + vem.n_normals(); ++j)
      for (int a = 0; a < (vem.is_normal(j) ? 1 : dim); ++a) {
        const int i = vem.first_component(j) + a;
        if (!system.fixed()[displacements[i]]) continue;
        const double divergence = vem.is_normal(j) ? vem.c()[j].dot(vem.normal(j)) : vem.c()[j][a];
        sums.reaction += du[i] * (force[i] - push * divergence);
        prescribed[i] = u[i];
      }
    sums.elastic += prescribed.dot(force) - 0.5 * prescribed.dot(k * prescribed);
  }
  return sums;
}

struct FaceSums {
  double contact = 0, reaction = 0, dilation = 0;
};

FaceSums sum_faces(const CoupledSystem& system, Vec before, Vec after) {
  const int dim = system.layout().dim();
  const auto size = static_cast<std::size_t>(dim);
  MechanicalState old = system.layout().create_state(), now = old;
  system.layout().gather(before, old);
  system.layout().gather(after, now);
  MechanicalState prescribed = system.layout().create_state();  // change of prescribed displacements alone
  for (std::size_t i = 0; i < prescribed.displacement.size(); ++i)
    if (system.fixed()[i]) prescribed.displacement[i] = now.displacement[i] - old.displacement[i];
  const FlowLayout& flow = system.flow().layout();
  la::Handle<Vec> q = flow.create_vector(), x = system.layout().create_vector();
  system.split(after, x, q);
  const la::VecRead pressure(q);
  FaceSums sums;
  for (Index f = 0; f < system.mesh().fractures.owned; ++f) {
    const ContactFace& face = system.contact_cells().faces()[f];
    const Vec3 jump = system.contact_cells().jump(f, now), jump_before = system.contact_cells().jump(f, old);
    Vec3 lam = Vec3::Zero();
    for (int a = 0; a < dim; ++a) lam[a] = now.multiplier[size * f + a];
    sums.contact += face.area * lam.dot(jump - jump_before);
    Vec3 traction = lam;
    if (flow.with_fractures()) {
      const Index k = flow.fracture(f);
      traction[0] += pressure[k];
      const Vec3& start = system.initial_jumps()[f];
      const auto slipped = [&](const Vec3& j) { return std::hypot(j[1] - start[1], j[2] - start[2]); };
      sums.dilation += face.area * pressure[k] * system.flow().fractures()[f].dilation * (slipped(jump) - slipped(jump_before));
    }
    sums.reaction += face.area * traction.dot(system.contact_cells().jump(f, prescribed));
  }
  return sums;
}

/// Loads on free displacements; what p_ref does is among them, and nowhere else in the books.
double load_work(const CoupledSystem& system, Vec change) {
  const la::VecRead du(change);
  const Layout& layout = system.layout();
  double work = 0;
  for (Index i = 0; i < layout.displacement_size(); ++i)
    if (!system.fixed()[i]) work += system.loads().displacement[i] * du[i];
  for (Index i = 0; i < layout.fracture_size(); ++i) work += system.loads().bubble[i] * du[layout.bubble_start() + i];
  return work;
}

}  // namespace

double EnergyStep::turnover() const {
  return std::abs(change) + std::abs(contact) + std::abs(dilation) + std::abs(darcy) + std::abs(work);
}

double elastic_energy(const CoupledSystem& system, Vec z) { return mpi::sum(system.mesh().comm, sum_cells(system, z, z).elastic); }

EnergyStep energy_of_step(const CoupledSystem& system, Vec before, Vec after, double elastic_before) {
  la::Handle<Vec> change = system.create_vector();
  POLYSLIP_PETSC(VecWAXPY(change, -1.0, before, after));
  const CellSums cells = sum_cells(system, after, change);
  const FaceSums faces = sum_faces(system, before, after);
  std::array<double, 4> sums{cells.elastic, faces.contact, faces.dilation, cells.reaction + faces.reaction + load_work(system, change)};
  mpi::sum_in_place(system.mesh().comm, sums);

  const FlowSystem& flow = system.flow();
  la::Handle<Vec> x = system.layout().create_vector(), q_before = flow.layout().create_vector(), q = flow.layout().create_vector();
  system.split(before, x, q_before);
  system.split(after, x, q);
  const double dt = flow.time_step();
  EnergyStep step;
  step.elastic = sums[0];
  step.fluid = flow.stored_energy(q);
  step.change = step.elastic - elastic_before + step.fluid - flow.stored_energy(q_before);
  step.contact = sums[1];
  step.dilation = sums[2];
  step.darcy = dt * flow.fluxes().dissipation(q).total();
  step.work = sums[3] + dt * flow.power_input(q);
  return step;
}

}  // namespace polyslip::assembly
