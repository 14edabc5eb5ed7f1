#include "polyslip/assembly/coupled_system.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/vec_access.hpp"
#include "polyslip/spaces/hfv_cell.hpp"
#include "polyslip/spaces/vem_cell.hpp"

namespace polyslip::assembly {

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The part of a rank's Vec behind the first `skip` entries, copied to or from a Vec of its own.
void copy_tail(Vec whole, Index skip, Vec tail) {
  const la::VecRead a(whole);
  const la::VecWrite b(tail);
  PetscInt n = 0;
  POLYSLIP_PETSC(VecGetLocalSize(tail, &n));
  std::copy_n(a.data() + skip, n, b.data());
}

void paste_tail(Vec tail, Index skip, Vec whole) {
  const la::VecRead a(tail);
  const la::VecWrite b(whole);
  PetscInt n = 0;
  POLYSLIP_PETSC(VecGetLocalSize(tail, &n));
  std::copy_n(a.data(), n, b.data() + skip);
}

la::Handle<Vec> create(MPI_Comm comm, Index size) {
  la::Handle<Vec> v;
  POLYSLIP_PETSC(VecCreate(comm, v.put()));
  POLYSLIP_PETSC(VecSetSizes(v, size, PETSC_DETERMINE));
  POLYSLIP_PETSC(VecSetType(v, VECSTANDARD));
  return v;
}

/// Whether apertures and conductivities leave all rows but those of contact linear.
bool linear_off_contact(const FlowSystem& flow) {
  const bool dilates = std::any_of(flow.fractures().begin(), flow.fractures().end(), [](const auto& f) { return f.dilation != 0; });
  const bool follows = flow.layout().with_fractures() && flow.problem().conductivities == physics::ConductivityTime::current;
  return !mpi::any(flow.mesh().comm, dilates) && !follows;
}

/// factor * (div v)_K by component of VemCell, behind what is there.
void append_divergence(const spaces::VemCell& vem, int dim, double factor, std::vector<double>& values) {
  for (int j = 0; j < vem.size(); ++j) {
    if (vem.is_normal(j))
      values.push_back(factor * vem.c()[j].dot(vem.normal(j)));
    else
      for (int a = 0; a < dim; ++a) values.push_back(factor * vem.c()[j][a]);
  }
}

}  // namespace

CoupledSystem::CoupledSystem(const mesh::DistributedMesh& mesh, const physics::MechanicsProblem& problem, FlowSystem& flow)
    : MechanicsSystem(mesh, problem),
      flow_(flow),
      is_linear_off_contact_(linear_off_contact(flow)),
      q_previous_(flow.layout().create_vector()),
      q_work_(flow.layout().create_vector()),
      f_work_(flow.layout().create_vector()),
      state_(layout().create_state()),
      rows_(layout().create_state()) {
  std::array<double, 2> sums{};
  for (const ContactFace& face : contact_cells().faces()) sums[0] += face.stiffness, sums[1] += 1;
  spaces::VemCell vem(mesh.mesh, layout().bubbles());
  for (Index cell = 0; cell < mesh.cells.owned; cell += 1 + mesh.cells.owned / 1000) {  // a sample tells the size
    vem.build(cell);
    sums[0] += (2 * moduli()[cell].mu + moduli()[cell].lambda) / vem.diameter();
    sums[1] += 1;
  }
  mpi::sum_in_place(mesh.comm, sums);
  scale_ = sums[0] / sums[1];
  state_.pressure.assign(static_cast<std::size_t>(flow.layout().local_size()), 0.0);
  rows_.pressure = state_.pressure;
  attach_fluid();
  couple_bulk_cells();
  create_matrices();
}

la::Handle<Vec> CoupledSystem::create_vector() const { return create(mesh().comm, size()); }

la::Handle<Vec> CoupledSystem::create_condensed_vector() const {
  return create(mesh().comm, layout().displacement_size() + flow_.layout().size());
}

void CoupledSystem::join(Vec x, Vec q, Vec z) const {
  {
    const la::VecRead a(x);
    const la::VecWrite b(z);
    std::copy_n(a.data(), layout().size(), b.data());
  }
  paste_tail(q, layout().size(), z);
}

void CoupledSystem::split(Vec z, Vec x, Vec q) const {
  {
    const la::VecRead a(z);
    const la::VecWrite b(x);
    std::copy_n(a.data(), layout().size(), b.data());
  }
  copy_tail(z, layout().size(), q);
}

void CoupledSystem::gather(Vec z, MechanicalState& state) const {
  MechanicsSystem::gather(z, state);
  PetscInt n = 0;
  POLYSLIP_PETSC(VecGetLocalSize(z, &n));
  if (mpi::any(mesh().comm, n < size())) return;
  state.pressure.resize(static_cast<std::size_t>(flow_.layout().local_size()));
  const la::VecRead a(z);
  std::copy_n(a.data() + layout().size(), flow_.layout().size(), state.pressure.begin());
  flow_.layout().halo().owner_to_ghost(state.pressure);
}

void CoupledSystem::scatter(const MechanicalState& state, Vec z) const {
  MechanicsSystem::scatter(state, z);
  const la::VecWrite a(z);
  std::copy_n(state.pressure.begin(), std::min<std::size_t>(state.pressure.size(), static_cast<std::size_t>(flow_.layout().size())),
              a.data() + layout().size());
}

// --- geometry of the coupling ---

void CoupledSystem::attach_fluid() {
  const FlowLayout& numbers = flow_.layout();
  const bool rows_follow = numbers.with_fractures() && flow_.problem().conductivities == physics::ConductivityTime::current;
  const std::vector<double> zero(static_cast<std::size_t>(numbers.local_size()), 0.0);
  spaces::VemCell vem(mesh().mesh, layout().bubbles());
  std::vector<ContactFluid> fluid;
  std::vector<Index> rows;
  std::vector<double> values;
  for (Index p = 0; p < cells().size(); ++p) {
    const Index cell = cells().mesh_cell(p);
    vem.build(cell);
    ContactFluid here;
    append_divergence(vem, layout().dim(), flow_.rock()[cell].biot * vem.volume(), here.biot);
    here.unknowns.push_back(numbers.cell(cell));
    if (numbers.with_fractures()) {
      for (Index face : cells().faces_of(p)) here.unknowns.push_back(numbers.fracture(face));
      for (Index face : cells().faces_of(p)) {
        if (!rows_follow) break;
        flow_.fluxes().aperture_derivative(face, zero, rows, values);
        for (Index row : rows)
          if (std::find(here.unknowns.begin(), here.unknowns.end(), row) == here.unknowns.end()) here.unknowns.push_back(row);
      }
    }
    fluid.push_back(std::move(here));
  }
  cells().attach_fluid(std::move(fluid));
  cells().set_apertures(std::vector<ApertureLinearisation>(static_cast<std::size_t>(mesh().fractures.local())));
}

void CoupledSystem::couple_bulk_cells() {
  spaces::VemCell vem(mesh().mesh, layout().bubbles());
  std::vector<Index> row;
  for (Index cell = 0; cell < mesh().mesh.n_cells(); ++cell) {
    if (cells().contains(cell) || flow_.rock()[cell].biot == 0) continue;
    if (cell >= mesh().cells.owned && !is_ours(cell)) continue;
    row.assign({cell});
    layout().append_displacements(mesh().mesh, cell, row);
    vem.build(cell);
    bulk_cells_.push_row(row);
    append_divergence(vem, layout().dim(), flow_.rock()[cell].biot * vem.volume(), biot_);
  }
}

void CoupledSystem::add_fluid_forces(const MechanicalState& state, std::span<double> displacement, std::span<double> bubble) const {
  auto biot = biot_.begin();
  for (Index b = 0; b < bulk_cells_.rows(); ++b) {
    const auto row = bulk_cells_[b];
    const double q_K = state.pressure[flow_.layout().cell(row[0])];
    for (Index i : row.subspan(1)) displacement[i] -= *biot++ * q_K;
  }
  contact_cells().add_fluid_forces(state.pressure, displacement, bubble);
}

double CoupledSystem::aperture(Index face, const Vec3& jump) const {
  const physics::FractureHydraulics& fracture = flow_.fractures()[face];
  const Vec3& start = initial_jumps()[face];
  return fracture.contact_aperture - jump[0] + fracture.dilation * std::hypot(jump[1] - start[1], jump[2] - start[2]);
}

void CoupledSystem::volumes(const MechanicalState& state, std::vector<double>& cell_volumes, std::vector<double>& face_volumes) const {
  cell_volumes.assign(static_cast<std::size_t>(mesh().cells.owned), 0.0);
  auto biot = biot_.begin();
  for (Index b = 0; b < bulk_cells_.rows(); ++b) {
    const auto row = bulk_cells_[b];
    double sum = 0;
    for (Index i : row.subspan(1)) sum += *biot++ * state.displacement[i];
    if (row[0] < mesh().cells.owned) cell_volumes[row[0]] = sum;
  }
  for (Index p = 0; p < contact_cells().size(); ++p)
    if (const Index cell = contact_cells().mesh_cell(p); cell < mesh().cells.owned)
      cell_volumes[cell] = contact_cells().pore_volume(p, state);
  face_volumes.assign(flow_.layout().with_fractures() ? static_cast<std::size_t>(mesh().fractures.owned) : 0, 0.0);
  for (std::size_t f = 0; f < face_volumes.size(); ++f) {
    const auto face = static_cast<Index>(f);
    face_volumes[f] = contact_cells().faces()[face].area * aperture(face, contact_cells().jump(face, state));
  }
}

std::vector<double> CoupledSystem::apertures(Vec z) const {
  gather(z, state_);
  std::vector<double> values(flow_.fractures().size(), 0.0);
  for (Index f = 0; f < static_cast<Index>(values.size()) && f < mesh().fractures.owned; ++f)
    values[f] = aperture(f, contact_cells().jump(f, state_));
  if (flow_.layout().with_fractures()) layout().fracture_halo().owner_to_ghost(values);
  return values;
}

double CoupledSystem::sum_of_changes(Vec z, bool without_signs) const {
  std::vector<double> cell_volumes, face_volumes;
  gather(z, state_);
  volumes(state_, cell_volumes, face_volumes);
  double sum = 0;
  const auto add = [&](double change) { sum += without_signs ? std::abs(change) : change; };
  for (std::size_t i = 0; i < cell_volumes.size(); ++i) add(cell_volumes[i] - pore_previous_[i]);
  for (std::size_t i = 0; i < face_volumes.size(); ++i) add(face_volumes[i] - aperture_previous_[i]);
  return mpi::sum(mesh().comm, sum);
}

double CoupledSystem::displacement_round_off(Vec z) const {
  gather(z, state_);
  double squares = 0;
  auto biot = biot_.begin();
  for (Index b = 0; b < bulk_cells_.rows(); ++b) {
    const auto row = bulk_cells_[b];
    double size = 0;
    for (Index i : row.subspan(1)) size += std::abs(*biot++ * state_.displacement[i]);
    if (row[0] < mesh().cells.owned) squares += size * size;
  }
  return std::numeric_limits<double>::epsilon() * std::sqrt(mpi::sum(mesh().comm, squares));
}

double CoupledSystem::volume_change(Vec z) const { return sum_of_changes(z, false); }
double CoupledSystem::volume_turnover(Vec z) const { return sum_of_changes(z, true); }

// --- the step ---

bool CoupledSystem::begin_step(Vec z, double dt) {
  copy_tail(z, layout().size(), q_previous_);
  flow_.set_time_step(dt);
  if (flow_.layout().with_fractures() && !flow_.set_apertures(apertures(z))) return false;
  gather(z, state_);
  volumes(state_, pore_previous_, aperture_previous_);
  return true;
}

void CoupledSystem::add_pressures(Vec q, Loads& loads) const {
  MechanicalState state;
  state.pressure.assign(flow_.reference().begin(), flow_.reference().end());
  if (q != nullptr) {
    std::vector<double> local(state.pressure.size());
    flow_.layout().gather(q, local);
    for (std::size_t i = 0; i < local.size(); ++i) state.pressure[i] += local[i];
  }
  std::vector<double> displacement(loads.displacement.size(), 0.0), bubble(loads.bubble.size(), 0.0);
  add_fluid_forces(state, displacement, bubble);
  add_rest_on_faces(displacement, bubble);
  for (std::size_t i = 0; i < displacement.size(); ++i) loads.displacement[i] -= displacement[i];
  for (std::size_t i = 0; i < bubble.size(); ++i) loads.bubble[i] -= bubble[i];
}

void CoupledSystem::add_rest_on_faces(std::span<double> displacement, std::span<double> bubble) const {
  const auto dim = static_cast<std::size_t>(layout().dim());
  const auto change = [&](Index cell, const Vec3& x) {
    return flow_.rock()[cell].biot * (flow_.reference_at(x) - flow_.reference()[flow_.layout().cell(cell)]);
  };
  for (Index f = 0; f < mesh().fractures.local(); ++f) {
    const ContactFace& face = contact_cells().faces()[f];
    if (face.cell < 0) continue;
    const double push = face.area * change(contact_cells().mesh_cell(face.cell), face.centre);
    for (std::size_t a = 0; a < dim; ++a) bubble[dim * f + a] -= push * face.frame(0, static_cast<Eigen::Index>(a));
  }
  if (layout().bubbles() == spaces::Bubbles::fracture) return;
  spaces::VemCell vem(mesh().mesh, spaces::Bubbles::all);
  for (Index cell = 0; cell < mesh().mesh.n_cells(); ++cell) {
    vem.build(cell);
    for (int j = vem.n_nodes(); j < vem.n_nodes() + vem.n_normals(); ++j)
      displacement[layout().of_normal(vem.face(j))] -=
          vem.volume() * vem.c()[j].dot(vem.normal(j)) * change(cell, spaces::face_geometry(mesh().mesh, vem.face(j)).centre);
  }
}

void CoupledSystem::set_loads(Loads loads) {
  add_pressures(nullptr, loads);
  MechanicsSystem::set_loads(std::move(loads));
}

void CoupledSystem::impose_dirichlet(Vec z) const {
  MechanicsSystem::impose_dirichlet(z);
  copy_tail(z, layout().size(), q_work_);
  flow_.impose(q_work_);
  paste_tail(q_work_, layout().size(), z);
}

// --- rows ---

void CoupledSystem::residual(Vec z, Vec f) const {
  if (!is_linear_off_contact_ && flow_.problem().conductivities == physics::ConductivityTime::current)
    // A trial state with a closed aperture keeps the last conductivities; its volumes still count as they are.
    (void)flow_.set_conducting_apertures(apertures(z));
  MechanicsSystem::residual(z, f);
  copy_tail(z, layout().size(), q_work_);
  flow_.residual(q_work_, q_previous_, f_work_);
  gather(z, state_);
  std::fill(rows_.displacement.begin(), rows_.displacement.end(), 0.0);
  std::fill(rows_.bubble.begin(), rows_.bubble.end(), 0.0);
  add_fluid_forces(state_, rows_.displacement, rows_.bubble);
  std::vector<double> cell_volumes, face_volumes;
  volumes(state_, cell_volumes, face_volumes);

  const la::VecWrite rows(f);
  double force = 0, flow = 0, turnover = 0;
  for (Index i = 0; i < layout().displacement_size(); ++i)
    if (!fixed()[i]) {
      rows[i] += rows_.displacement[i];
      force += rows_.displacement[i] * rows_.displacement[i];
    }
  for (Index i = 0; i < layout().fracture_size(); ++i) rows[layout().bubble_start() + i] += rows_.bubble[i];
  const la::VecRead flow_rows(f_work_), q(q_work_), before(q_previous_), storage(flow_.storage());
  const auto add_scale = [&](double change) {
    flow += change * change;
    turnover += std::abs(change);
  };
  const auto add_volume = [&](Index unknown, double change) {
    rows[layout().size() + unknown] += change;
    add_scale(change);
  };
  for (Index i = 0; i < flow_.layout().size(); ++i) {
    rows[layout().size() + i] = flow_rows[i];
    add_scale(storage[i] * (q[i] - before[i]));
    add_scale(flow_.time_step() * flow_.loads().sources[i]);
  }
  for (Index cell = 0; cell < mesh().cells.owned; ++cell) add_volume(flow_.layout().cell(cell), cell_volumes[cell] - pore_previous_[cell]);
  for (std::size_t k = 0; k < face_volumes.size(); ++k)
    add_volume(flow_.layout().fracture(static_cast<Index>(k)), face_volumes[k] - aperture_previous_[k]);
  std::array<double, 3> sums{force, flow, turnover};
  mpi::sum_in_place(mesh().comm, sums);
  pressure_force_ = std::sqrt(sums[0]);
  flow_scale_ = std::sqrt(sums[1]);
  flow_turnover_ = sums[2];
}

void CoupledSystem::momentum_action(Vec y, Vec r) const {
  MechanicsSystem::momentum_action(y, r);
  gather(y, state_);
  copy_tail(y, layout().size(), q_work_);
  POLYSLIP_PETSC(MatMult(flow_.matrix(), q_work_, f_work_));
  std::fill(rows_.displacement.begin(), rows_.displacement.end(), 0.0);
  std::fill(rows_.bubble.begin(), rows_.bubble.end(), 0.0);
  add_fluid_forces(state_, rows_.displacement, rows_.bubble);
  std::vector<double> cell_volumes, face_volumes;
  volumes(state_, cell_volumes, face_volumes);
  const la::VecWrite rows(r);
  const la::VecRead flow_rows(f_work_);
  for (Index i = 0; i < layout().displacement_size(); ++i)
    if (!fixed()[i]) rows[i] += rows_.displacement[i];
  for (Index i = 0; i < layout().fracture_size(); ++i) rows[layout().bubble_start() + i] += rows_.bubble[i];
  for (Index i = 0; i < flow_.layout().size(); ++i) rows[layout().size() + i] = flow_rows[i];
  for (Index cell = 0; cell < mesh().cells.owned; ++cell) rows[layout().size() + flow_.layout().cell(cell)] += cell_volumes[cell];
  for (std::size_t k = 0; k < face_volumes.size(); ++k) {
    const auto face = static_cast<Index>(k);
    const ContactFace& contact = contact_cells().faces()[face];
    // d_f without its constant and without dilation, which makes rows that are evaluated again anyway
    rows[layout().size() + flow_.layout().fracture(face)] -= contact.area * contact_cells().jump(face, state_)[0];
  }
}

ResidualNorms CoupledSystem::norms(Vec z, Vec f) const {
  ResidualNorms n = MechanicsSystem::norms(z, f);
  n.momentum_scale = std::max(n.momentum_scale, pressure_force_);
  copy_tail(z, layout().size(), q_work_);
  n.flow_floor = 4 * (flow_.round_off(q_work_, NORM_2) + displacement_round_off(z));
  const la::VecRead rows(f);
  std::array<double, 2> sums{};  // of the squares; of the rows
  for (Index i = layout().size(); i < size(); ++i) {
    sums[0] += rows[i] * rows[i];
    sums[1] += rows[i];
  }
  mpi::sum_in_place(mesh().comm, sums);
  n.flow = std::sqrt(sums[0]);
  n.flow_loss = std::abs(sums[1]);
  n.flow_turnover = std::max(flow_turnover_, 1e-300);
  n.flow_scale = std::max(flow_scale_, 1e-300);
  return n;
}

// --- linearisation ---

void CoupledSystem::create_matrices() {
  const Index displacements = layout().displacement_size(), flow = flow_.layout().size();
  const MPI_Comm comm = mesh().comm;
  const Visit nothing = [](std::span<const PetscInt>, std::span<const PetscInt>, const double*) {};
  up_.emplace(comm, displacements, flow, [&](const Visit& add) {
    visit_bulk_up(add);
    visit_blocks(MatrixContent::exact, {&add, &nothing, &nothing});
  });
  pu_.emplace(comm, flow, displacements, [&](const Visit& add) {
    visit_bulk_pu(add);
    visit_blocks(MatrixContent::exact, {&nothing, &add, &nothing});
  });
  pp_.emplace(comm, flow, flow, [&](const Visit& add) {
    const Mat s = flow_.matrix();
    for (Index i = 0; i < flow; ++i) {
      const PetscInt row = flow_.layout().numbering().first + i;
      PetscInt n = 0;
      const PetscInt* columns = nullptr;
      const PetscScalar* values = nullptr;
      POLYSLIP_PETSC(MatGetRow(s, row, &n, &columns, &values));
      add({&row, 1}, {columns, static_cast<std::size_t>(n)}, values);
      POLYSLIP_PETSC(MatRestoreRow(s, row, &n, &columns, &values));
    }
    visit_blocks(MatrixContent::exact, {&nothing, &nothing, &add});
  });
  const auto keep = [](la::SumMatrix& matrix, auto&& visit) {
    visit([&](std::span<const PetscInt> rows, std::span<const PetscInt> columns, const double* block) { matrix.add(rows, columns, block); });
    matrix.assemble();
    matrix.keep();
  };
  keep(*up_, [&](const Visit& add) { visit_bulk_up(add); });
  keep(*pu_, [&](const Visit& add) { visit_bulk_pu(add); });
  std::array<Mat, 4> blocks{matrix(), up_->get(), pu_->get(), pp_->get()};
  POLYSLIP_PETSC(MatCreateNest(comm, 2, nullptr, 2, nullptr, blocks.data(), nest_.put()));
}

void CoupledSystem::hold_all_rows() {
  MechanicsSystem::hold_all_rows();
  POLYSLIP_PETSC(MatNestSetSubMat(nest_, 0, 0, matrix()));
}

/// - b|K| c_e in the free displacement rows of this rank.
void CoupledSystem::visit_bulk_up(const Visit& add) const {
  std::vector<PetscInt> rows;
  std::vector<double> values;
  auto biot = biot_.begin();
  for (Index b = 0; b < bulk_cells_.rows(); ++b) {
    const auto row = bulk_cells_[b];
    const Index unknown = flow_.layout().cell(row[0]);
    rows.clear();
    values.clear();
    for (Index i : row.subspan(1)) {
      const double value = *biot++;
      if (i >= layout().displacement_size() || fixed()[i]) continue;
      rows.push_back(layout().global(i));
      values.push_back(-scale_ * value);
    }
    const PetscInt column = flow_.layout().numbering().global(unknown);
    add(rows, {&column, 1}, values.data());
  }
}

/// b|K| c_e in the rows of owned cells.
void CoupledSystem::visit_bulk_pu(const Visit& add) const {
  std::vector<PetscInt> columns;
  std::vector<double> values;
  auto biot = biot_.begin();
  for (Index b = 0; b < bulk_cells_.rows(); ++b) {
    const auto row = bulk_cells_[b];
    columns.clear();
    values.clear();
    for (Index i : row.subspan(1)) {
      const double value = *biot++;
      if (fixed()[i]) continue;
      columns.push_back(layout().global(i));
      values.push_back(scale_ * value);
    }
    if (row[0] >= mesh().cells.owned) continue;
    const PetscInt number = flow_.layout().numbering().global(flow_.layout().cell(row[0]));
    add({&number, 1}, columns, values.data());
  }
}

/// The condensed blocks of + cells: displacement rows and pressure columns, pressure rows and displacement columns, pressures.
void CoupledSystem::visit_blocks(MatrixContent content, const std::array<const Visit*, 3>& add) const {
  std::vector<PetscInt> u_rows, u_columns, rows, columns;
  std::vector<int> at_u_rows, at_u_columns, at_rows, at_columns;  // positions in the block
  RowMajor part;
  std::vector<double> values;
  for (Index p = 0; p < contact_cells().size(); ++p) {
    const auto displacements = contact_cells().displacements(p), pressures = contact_cells().pressures(p);
    const int e = static_cast<int>(displacements.size()), size = contact_cells().block_size(p);
    for (auto* list : {&u_rows, &u_columns, &rows, &columns}) list->clear();
    for (auto* list : {&at_u_rows, &at_u_columns, &at_rows, &at_columns}) list->clear();
    for (int i = 0; i < e; ++i) {
      if (fixed()[displacements[i]]) continue;
      u_columns.push_back(layout().global(displacements[i]));
      at_u_columns.push_back(i);
      if (displacements[i] >= layout().displacement_size()) continue;
      u_rows.push_back(layout().global(displacements[i]));
      at_u_rows.push_back(i);
    }
    for (int i = 0; i < size - e; ++i) {
      if (flow_.fixed()[pressures[i]]) continue;
      const PetscInt number = flow_.layout().numbering().global(pressures[i]);
      columns.push_back(number);
      at_columns.push_back(e + i);
      if (pressures[i] >= flow_.layout().size()) continue;
      rows.push_back(number);
      at_rows.push_back(e + i);
    }
    contact_cells().write_block(p, friction_of(content), values);
    const Eigen::Map<const RowMajor> block(values.data(), size, size);
    part = scale_ * block(at_u_rows, at_columns);
    (*add[0])(u_rows, columns, part.data());
    part = scale_ * block(at_rows, at_u_columns);
    (*add[1])(rows, u_columns, part.data());
    part = scale_ * scale_ * block(at_rows, at_columns);
    (*add[2])(rows, columns, part.data());
  }
}

void CoupledSystem::linearise_apertures(Vec z) {
  if (!flow_.layout().with_fractures()) return;
  gather(z, state_);
  const bool rows_follow = flow_.problem().conductivities == physics::ConductivityTime::current;
  std::vector<ApertureLinearisation> apertures(static_cast<std::size_t>(mesh().fractures.local()));
  for (Index f = 0; f < mesh().fractures.local(); ++f) {
    if (contact_cells().faces()[f].cell < 0) continue;
    const Vec3 jump = contact_cells().jump(f, state_);
    const Eigen::Vector2d slip = (jump - initial_jumps()[f]).tail<2>();
    const double length = slip.norm(), dilation = flow_.fractures()[f].dilation;
    ApertureLinearisation& a = apertures[f];
    a.d_jump = Vec3(-1, 0, 0);
    if (dilation != 0 && length > 0) a.d_jump.tail<2>() = dilation / length * slip;
    if (!rows_follow) continue;
    flow_.fluxes().aperture_derivative(f, state_.pressure, a.rows, a.values);
    for (double& value : a.values) value *= flow_.time_step();
  }
  cells().set_apertures(std::move(apertures));
}

void CoupledSystem::linearise(Vec z, MatrixContent content) {
  linearise_apertures(z);
  linearise_contact(z, content);
  write_matrices(content);
}

void CoupledSystem::write_matrices(MatrixContent content) {
  const Mat s = flow_.matrix();
  if (flow_.matrix_version() != flow_matrix_version_) {
    flow_matrix_version_ = flow_.matrix_version();
    pp_->clear();
    POLYSLIP_PETSC(MatAXPY(pp_->get(), scale_ * scale_, s, SUBSET_NONZERO_PATTERN));
    pp_->keep();
  } else if (fracture_faces() > 0) {
    pp_->restart();
  }
  if (fracture_faces() == 0) return;
  up_->restart();
  pu_->restart();
  const auto into = [](la::SumMatrix& matrix) {
    return Visit([&matrix](std::span<const PetscInt> rows, std::span<const PetscInt> columns, const double* block) {
      matrix.add(rows, columns, block);
    });
  };
  const Visit up = into(*up_), pu = into(*pu_), pp = into(*pp_);
  visit_blocks(content, {&up, &pu, &pp});
  for (la::SumMatrix* matrix : {&*up_, &*pu_, &*pp_}) matrix->assemble();
}

void CoupledSystem::apply_condensed(Vec x, Vec y) const {
  POLYSLIP_PETSC(MatMult(nest_, x, y));
  if (matrix_is_exact()) return;
  {
    const la::VecRead a(x);
    std::copy_n(a.data(), layout().displacement_size(), state_.displacement.begin());
    std::copy_n(a.data() + layout().displacement_size(), flow_.layout().size(), state_.pressure.begin());
  }
  layout().exchange(state_.displacement);
  flow_.layout().halo().owner_to_ghost(state_.pressure);
  const la::VecWrite rows(y);
  std::vector<double> local, difference;
  for (Index p = 0; p < contact_cells().size(); ++p) {
    if (!contact_cells().differs(p)) continue;
    const auto displacements = contact_cells().displacements(p), pressures = contact_cells().pressures(p);
    local.clear();
    for (const Index k : displacements) local.push_back(fixed()[k] ? 0.0 : state_.displacement[k]);
    for (const Index k : pressures) local.push_back(flow_.fixed()[k] ? 0.0 : scale_ * state_.pressure[k]);
    difference.assign(local.size(), 0.0);
    contact_cells().add_condensation(p, ContactCells::Friction::moving, 1, local, difference);
    contact_cells().add_condensation(p, ContactCells::Friction::held, -1, local, difference);
    auto row = difference.begin();
    for (const Index k : displacements) {
      if (k < layout().displacement_size() && !fixed()[k]) rows[k] += *row;
      ++row;
    }
    for (const Index k : pressures) {
      if (k < flow_.layout().size() && !flow_.fixed()[k]) rows[layout().displacement_size() + k] += scale_ * *row;
      ++row;
    }
  }
}

void CoupledSystem::condense_residual(Vec f, Vec condensed) const {
  gather(f, state_);
  contact_cells().condense_residual(state_.bubble, state_.multiplier, state_.displacement, state_.pressure);
  const la::VecWrite rows(condensed);
  for (Index i = 0; i < layout().displacement_size(); ++i) rows[i] = fixed()[i] ? 0.0 : state_.displacement[i];
  for (Index i = 0; i < flow_.layout().size(); ++i) rows[layout().displacement_size() + i] = flow_.fixed()[i] ? 0.0 : scale_ * state_.pressure[i];
}

void CoupledSystem::recover(Vec f, Vec condensed, Vec direction) const {
  gather(f, state_);
  {
    const la::VecRead a(condensed);
    for (Index i = 0; i < layout().displacement_size(); ++i) rows_.displacement[i] = fixed()[i] ? 0.0 : a[i];
    for (Index i = 0; i < flow_.layout().size(); ++i) rows_.pressure[i] = flow_.fixed()[i] ? 0.0 : scale_ * a[layout().displacement_size() + i];
  }
  layout().exchange(rows_.displacement);
  flow_.layout().halo().owner_to_ghost(rows_.pressure);
  contact_cells().recover(state_.bubble, state_.multiplier, rows_);
  scatter(rows_, direction);
}

}  // namespace polyslip::assembly
