#include "polyslip/assembly/flow_system.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::assembly {

FlowSystem::FlowSystem(const mesh::DistributedMesh& mesh, const physics::FlowProblem& problem)
    : mesh_(mesh),
      problem_(problem),
      rock_(mpi::made_together(mesh.comm, [&] { return physics::cell_hydraulics(mesh.mesh, problem.materials); })),
      fractures_(mpi::made_together(mesh.comm, [&] { return fracture_properties(); })),
      conducting_apertures_(contact_apertures()),
      storing_apertures_(conducting_apertures_),
      conductivities_(conductivities_at(conducting_apertures_)),
      layout_(mesh, !problem.fractures.empty() && mesh.fractures.total > 0),
      operator_(mesh, layout_, rock_, problem.viscosity, conductivities_, barriers()),
      constant_reference_(mean_initial_pressure()),
      reference_(reference_values()),
      load_assembler_(mesh, problem, layout_, operator_.points(), reference_, operator_.areas()),
      storage_(layout_.create_vector()),
      work_(layout_.create_vector()) {
  write_storage();
  loads_ = {std::vector<double>(static_cast<std::size_t>(layout_.size())),
            std::vector<double>(static_cast<std::size_t>(layout_.size()))};
  POLYSLIP_PETSC(MatDuplicate(operator_.matrix(), MAT_DO_NOT_COPY_VALUES, matrix_.put()));
  POLYSLIP_PETSC(MatSetOption(matrix_, MAT_SPD, PETSC_TRUE));
}

std::vector<physics::FractureHydraulics> FlowSystem::fracture_properties() const {
  if (problem_.fractures.empty()) return {};
  return physics::fracture_hydraulics(mesh_.mesh, mesh_.fracture_faces, problem_.fractures);
}

/// 1 on local fracture faces of barriers.
std::vector<char> FlowSystem::barriers() const {
  std::vector<char> barriers(fractures_.size());
  std::transform(fractures_.begin(), fractures_.end(), barriers.begin(), [](const auto& f) { return f.barrier ? 1 : 0; });
  return barriers;
}

std::vector<double> FlowSystem::contact_apertures() const {
  std::vector<double> apertures(fractures_.size());
  std::transform(fractures_.begin(), fractures_.end(), apertures.begin(), [](const auto& f) { return f.contact_aperture; });
  return apertures;
}

std::vector<physics::FractureConductivity> FlowSystem::conductivities_at(std::span<const double> apertures) const {
  std::vector<physics::FractureConductivity> values;
  for (std::size_t f = 0; f < apertures.size(); ++f)
    values.push_back(physics::fracture_conductivity(fractures_[f], apertures[f], problem_.viscosity));
  return values;
}

double FlowSystem::mean_initial_pressure() const {
  if (problem_.initial_pressure.is_constant()) return problem_.initial_pressure(EvalPoint{});
  std::array<double, 2> sums{};
  mpi::together(mesh_.comm, [&] {
    for (Index cell = 0; cell < mesh_.cells.owned; ++cell) {
      sums[0] += operator_.volumes()[cell] * problem_.initial_pressure({.x = operator_.points()[layout_.cell(cell)]});
      sums[1] += operator_.volumes()[cell];
    }
  });
  mpi::sum_in_place(mesh_.comm, sums);
  return sums[0] / sums[1];
}

double FlowSystem::reference_at(const Vec3& x) const {
  return problem_.reference_pressure ? (*problem_.reference_pressure)({.x = x}) : constant_reference_;
}

std::vector<double> FlowSystem::reference_values() const {
  std::vector<double> values(static_cast<std::size_t>(layout_.local_size()));
  mpi::together(mesh_.comm, [&] {
    for (Index i = 0; i < layout_.size(); ++i) values[i] = operator_.is_drop(i) ? 0.0 : reference_at(operator_.points()[i]);
  });
  layout_.halo().owner_to_ghost(values);
  return values;
}

void FlowSystem::set_initial(double time, Vec q) const {
  const auto initial = [&](Index i) { return problem_.initial_pressure({.x = operator_.points()[i], .t = time}) - reference_[i]; };
  const la::VecWrite a(q);
  mpi::together(mesh_.comm, [&] {
    for (Index i = 0; i < layout_.size(); ++i) a[i] = operator_.is_drop(i) ? 0.0 : initial(i);
  });
}

bool FlowSystem::all_positive(std::span<const double> apertures) const {
  return !mpi::any(mesh_.comm, !std::all_of(apertures.begin(), apertures.end(), [](double d) { return d > 0; }));
}

bool FlowSystem::differ(std::span<const double> apertures, std::span<const double> known) const {
  return mpi::any(mesh_.comm, !std::equal(apertures.begin(), apertures.end(), known.begin(), known.end()));
}

bool FlowSystem::set_apertures(std::span<const double> apertures) {
  if (!set_conducting_apertures(apertures)) return false;
  if (differ(apertures, storing_apertures_)) {
    storing_apertures_.assign(apertures.begin(), apertures.end());
    write_storage();
  }
  return true;
}

bool FlowSystem::set_conducting_apertures(std::span<const double> apertures) {
  if (!all_positive(apertures)) return false;
  if (!differ(apertures, conducting_apertures_)) return true;
  conducting_apertures_.assign(apertures.begin(), apertures.end());
  conductivities_ = conductivities_at(apertures);
  operator_.set_conductivities(conductivities_);
  matrix_is_stale_ = true;
  return true;
}

void FlowSystem::write_storage() {
  if (problem_.stationary) return;
  const la::VecWrite d(storage_);
  for (Index cell = 0; cell < mesh_.cells.owned; ++cell)
    d[layout_.cell(cell)] = operator_.volumes()[cell] * rock_[cell].inverse_modulus;
  for (Index f = 0; layout_.with_fractures() && f < mesh_.fractures.owned; ++f)
    d[layout_.fracture(f)] = operator_.areas()[f] * storing_apertures_[f] * problem_.fluid_compressibility;
  matrix_is_stale_ = true;
}

void FlowSystem::set_time_step(double dt) {
  const double step = problem_.stationary ? 1.0 : dt;
  matrix_is_stale_ = matrix_is_stale_ || step != dt_;
  dt_ = step;
}

void FlowSystem::impose(Vec q) const {
  const la::VecWrite a(q);
  for (Index i = 0; i < layout_.size(); ++i)
    if (fixed()[i]) a[i] = loads_.imposed[i];
}

Mat FlowSystem::matrix() {
  if (!matrix_is_stale_) return matrix_;
  la::Handle<Vec> diagonal = layout_.create_vector(), free = layout_.create_vector();
  POLYSLIP_PETSC(MatGetDiagonal(operator_.matrix(), diagonal));
  {
    const la::VecWrite d(diagonal), is_free(free);
    const la::VecRead storage(storage_);
    for (Index i = 0; i < layout_.size(); ++i) {
      d[i] = storage[i] + (fixed()[i] ? dt_ * d[i] : 0.0);
      is_free[i] = fixed()[i] ? 0.0 : 1.0;
    }
  }
  POLYSLIP_PETSC(MatCopy(operator_.matrix(), matrix_, SAME_NONZERO_PATTERN));
  POLYSLIP_PETSC(MatScale(matrix_, dt_));
  POLYSLIP_PETSC(MatDiagonalScale(matrix_, free, free));
  POLYSLIP_PETSC(MatDiagonalSet(matrix_, diagonal, ADD_VALUES));
  matrix_is_stale_ = false;
  ++matrix_version_;
  return matrix_;
}

void FlowSystem::residual(Vec q, Vec q_previous, Vec f) const {
  apply_fluxes(q, f);
  const la::VecWrite rows(f);
  const la::VecRead now(q), before(q_previous), storage(storage_);
  for (Index i = 0; i < layout_.size(); ++i)
    rows[i] = fixed()[i] ? 0.0 : storage[i] * (now[i] - before[i]) + dt_ * (rows[i] - loads_.sources[i]);
}

double FlowSystem::round_off(Vec q, NormType norm) {
  POLYSLIP_PETSC(MatGetDiagonal(matrix(), work_));
  POLYSLIP_PETSC(VecPointwiseMult(work_, work_, q));
  PetscReal size = 0;
  POLYSLIP_PETSC(VecNorm(work_, norm, &size));
  return std::numeric_limits<double>::epsilon() * size;
}

FluidBalance FlowSystem::balance(Vec q, Vec q_previous) const {
  apply_fluxes(q, work_);
  const la::VecRead flux(work_), now(q), before(q_previous), storage(storage_);
  std::array<double, 4> sums{};  // stored, injected, outflow, turnover
  const auto is_trace = [&](Index i) { return i >= mesh_.cells.owned && i < mesh_.cells.owned + mesh_.flow.traces.owned; };
  for (Index i = 0; i < layout_.size(); ++i) {
    const double stored = storage[i] * (now[i] - before[i]), source = dt_ * loads_.sources[i];
    const double through = fixed()[i] ? -dt_ * flux[i] : 0.0;
    sums[0] += stored;
    sums[1] += is_trace(i) ? 0.0 : source;
    sums[2] += through - (is_trace(i) ? source : 0.0);
    sums[3] += std::abs(stored) + std::abs(source) + std::abs(through);
  }
  mpi::sum_in_place(mesh_.comm, sums);
  return {sums[0], sums[1], sums[2], sums[3]};
}

double FlowSystem::stored_energy(Vec q) const {
  const la::VecRead a(q), storage(storage_);
  double energy = 0;
  for (Index i = 0; i < layout_.size(); ++i) energy += storage[i] * a[i] * a[i] / 2;
  return mpi::sum(mesh_.comm, energy);
}

double FlowSystem::power_input(Vec q) const {
  apply_fluxes(q, work_);
  const la::VecRead flux(work_), a(q);
  double power = 0;
  for (Index i = 0; i < layout_.size(); ++i) power += a[i] * (fixed()[i] ? flux[i] : loads_.sources[i]);
  return mpi::sum(mesh_.comm, power);
}

}  // namespace polyslip::assembly
