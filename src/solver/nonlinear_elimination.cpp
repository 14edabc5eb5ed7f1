#include "polyslip/solver/nonlinear_elimination.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/vec_access.hpp"
#include "polyslip/solver/condensed_operator.hpp"

namespace polyslip::solver {

using assembly::MechanicsSystem;

namespace {

constexpr const char *prefix = "elimination_", *rock_prefix = "elimination_rock_";
constexpr double unsettled = 0.05;  ///< Contact rows of a face, relative to the largest.
constexpr double enough = 0.003;    ///< Of all contact rows, relative to the start.
constexpr double loose = 0.05;      ///< Of the momentum rows of W in 3D and of the rock; bubbles and multipliers then follow exactly.

/// As it is: its smoothers follow the rows that have changed by themselves, its coarse levels do not.
PetscErrorCode precondition_rock(PC shell, Vec x, Vec y) {
  PetscFunctionBeginUser;
  PC pc = nullptr;
  PetscCall(PCShellGetContext(shell, &pc));
  PetscCall(PCApply(pc, x, y));
  PetscFunctionReturn(0);
}

}  // namespace

NonlinearElimination::NonlinearElimination(MechanicsSystem& system)
    : system_(system),
      start_x_(system.create_vector()),
      start_f_(system.create_vector()),
      direction_(system.create_vector()),
      condensed_rows_(system.create_condensed_vector()),
      condensed_direction_(system.create_condensed_vector()),
      is_asked_(system.layout().create_displacement_vector()),
      most_(system.layout().dim() == 2 ? 0.2 : 1),
      rings_(system.layout().dim() == 2 ? 4 : 2) {
  POLYSLIP_PETSC(PetscOptionsGetReal(nullptr, prefix, "-share", &most_, nullptr));
  POLYSLIP_PETSC(PetscOptionsGetInt(nullptr, prefix, "-rings", &rings_, nullptr));
  POLYSLIP_PETSC(PetscOptionsGetInt(nullptr, prefix, "-max_it", &most_steps_, nullptr));
  POLYSLIP_PETSC(PetscOptionsGetBool(nullptr, prefix, "-rock", &takes_rock_, nullptr));
}

void NonlinearElimination::measure(Vec f) {
  const la::VecRead rows(f);
  const int dim = system_.layout().dim();
  sizes_.resize(static_cast<std::size_t>(system_.mesh().fractures.owned));
  double squares = 0;
  for (std::size_t face = 0; face < sizes_.size(); ++face) {
    double square = 0;
    for (int a = 0; a < dim; ++a) square += std::pow(rows[system_.layout().multiplier_start() + dim * static_cast<Index>(face) + a], 2);
    sizes_[face] = std::sqrt(square);
    squares += square;
  }
  total_ = std::sqrt(mpi::sum(system_.mesh().comm, squares));
}

/// Adds faces to S.
void NonlinearElimination::choose_faces() {
  const double largest = mpi::max(system_.mesh().comm, sizes_.empty() ? 0.0 : *std::max_element(sizes_.begin(), sizes_.end()));
  for (std::size_t face = 0; face < sizes_.size(); ++face)
    if (sizes_[face] > unsettled * largest) is_unsettled_[face] = 1;
}

/// W of S; false, on all ranks, where it is empty or too large even with the nearest ring.
bool NonlinearElimination::choose_window() {
  const assembly::ContactCells& cells = system_.contact_cells();
  const assembly::Layout& layout = system_.layout();
  is_in_.assign(static_cast<std::size_t>(layout.owned_entities()), 0);
  POLYSLIP_PETSC(VecZeroEntries(is_asked_));
  for (std::size_t face = 0; face < is_unsettled_.size(); ++face)
    if (is_unsettled_[face] && cells.faces()[face].cell >= 0)
      for (const Index i : cells.displacements(cells.faces()[face].cell)) mark(layout.entity_of(i));
  std::vector<Index> window = marked();
  PetscInt all = 0;
  POLYSLIP_PETSC(MatGetSize(system_.matrix(), &all, nullptr));
  const auto fits = [&](const std::vector<Index>& entities) {
    long long size = 0;
    for (const Index entity : entities) size += layout.width(entity);
    size = mpi::sum(system_.mesh().comm, size);
    return size > 0 && static_cast<double>(size) <= most_ * static_cast<double>(all);
  };
  bool is_small = rings_ > 0 || fits(window);
  for (PetscInt ring = 0; ring < rings_; ++ring) {
    for (const Index entity : window) system_.bulk().visit_columns(entity, [&](Index neighbour) { mark(neighbour); });
    std::vector<Index> more = marked();
    const bool still_fits = fits(more);
    if (ring == 0) is_small = still_fits;
    if (ring == 0 || still_fits) window = std::move(more);
    if (!still_fits) break;
  }
  if (mpi::any(system_.mesh().comm, window != window_)) forget_window();
  window_ = std::move(window);
  rows_.clear();
  for (const Index entity : window_) layout.append_components(entity, rows_);
  return is_small;
}

void NonlinearElimination::mark(Index entity) {
  const assembly::Layout& layout = system_.layout();
  if (entity < layout.owned_entities())
    is_in_[static_cast<std::size_t>(entity)] = 1;
  else
    POLYSLIP_PETSC(VecSetValue(is_asked_, layout.global(layout.first_displacement(entity)), 1, INSERT_VALUES));
}

/// Owned entities that any rank has marked, ascending.
std::vector<Index> NonlinearElimination::marked() {
  const assembly::Layout& layout = system_.layout();
  POLYSLIP_PETSC(VecAssemblyBegin(is_asked_));
  POLYSLIP_PETSC(VecAssemblyEnd(is_asked_));
  const la::VecRead is_asked(is_asked_);
  std::vector<Index> entities;
  for (Index entity = 0; entity < layout.owned_entities(); ++entity) {
    char& is_in = is_in_[static_cast<std::size_t>(entity)];
    if (is_asked[layout.first_displacement(entity)] != 0) is_in = 1;
    if (is_in != 0) entities.push_back(entity);
  }
  return entities;
}

void NonlinearElimination::forget_window() {
  matrix_.reset();
  ksp_.reset();
}

/// A solver for W, before what depends on the contact law; the last one again where it has the same rows.
void NonlinearElimination::create_solver() {
  if (ksp_ != nullptr) return;
  PC pc = nullptr;
  POLYSLIP_PETSC(KSPCreate(system_.mesh().comm, ksp_.put()));
  POLYSLIP_PETSC(KSPSetOptionsPrefix(ksp_, prefix));
  POLYSLIP_PETSC(KSPGetPC(ksp_, &pc));
  if (system_.layout().dim() == 2) {
    POLYSLIP_PETSC(KSPSetType(ksp_, KSPPREONLY));
    POLYSLIP_PETSC(PCSetType(pc, PCLU));
    POLYSLIP_PETSC(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
  } else {
    // A strip of few rings that is held all around is well conditioned: an incomplete factorisation takes longer than the iterations it saves.
    POLYSLIP_PETSC(KSPSetType(ksp_, KSPGMRES));
    POLYSLIP_PETSC(KSPSetTolerances(ksp_, loose, PETSC_DEFAULT, PETSC_DEFAULT, 100));
    POLYSLIP_PETSC(PCSetType(pc, PCJACOBI));
  }
  POLYSLIP_PETSC(KSPSetFromOptions(ksp_));
  POLYSLIP_PETSC(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(pc), &multiplies_alone_, PCJACOBI, PCNONE, ""));
}

/// Its matrix, of the contact law that was linearised last.
void NonlinearElimination::set_matrix() {
  PetscBool is_set = PETSC_FALSE;
  POLYSLIP_PETSC(KSPGetOperatorsSet(ksp_, &is_set, nullptr));
  if (is_set && multiplies_alone_) return products_->follow();
  if (is_set) {
    Mat matrix = matrix_;
    POLYSLIP_PETSC(MatCreateSubMatrix(system_.matrix(), in_matrix_, in_matrix_, MAT_REUSE_MATRIX, &matrix));
    return;
  }
  if (multiplies_alone_) {
    if (!products_) products_.emplace(system_);
    products_->choose(window_);
  } else {
    if (!system_.holds_all_rows()) throw std::logic_error("NonlinearElimination: PETSc cannot copy a window of rows that the matrix does not hold");
    std::vector<PetscInt> rows(rows_.size());
    std::transform(rows_.begin(), rows_.end(), rows.begin(), [&](Index row) { return system_.layout().global(row); });
    POLYSLIP_PETSC(ISCreateGeneral(system_.mesh().comm, static_cast<PetscInt>(rows.size()), rows.data(), PETSC_COPY_VALUES, in_matrix_.put()));
    POLYSLIP_PETSC(MatCreateSubMatrix(system_.matrix(), in_matrix_, in_matrix_, MAT_INITIAL_MATRIX, matrix_.put()));
  }
  Mat matrix = multiplies_alone_ ? products_->get() : matrix_.get();
  POLYSLIP_PETSC(KSPSetOperators(ksp_, matrix, matrix));
  POLYSLIP_PETSC(MatCreateVecs(matrix, solution_.put(), rhs_.put()));
}

/// Once for all steps of an elimination.
void NonlinearElimination::set_up_rock(PC of_rock) {
  if (ksp_.get() != nullptr) return;
  rows_.resize(static_cast<std::size_t>(system_.layout().displacement_size()));
  std::iota(rows_.begin(), rows_.end(), 0);
  matrix_ = condensed_operator(system_, system_.layout().displacement_size());
  PC pc = nullptr;
  POLYSLIP_PETSC(KSPCreate(system_.mesh().comm, ksp_.put()));
  POLYSLIP_PETSC(KSPSetOptionsPrefix(ksp_, rock_prefix));
  POLYSLIP_PETSC(KSPSetType(ksp_, KSPFGMRES));
  POLYSLIP_PETSC(KSPSetTolerances(ksp_, loose, PETSC_DEFAULT, PETSC_DEFAULT, 100));
  POLYSLIP_PETSC(KSPSetOperators(ksp_, matrix_, system_.matrix()));
  POLYSLIP_PETSC(KSPGetPC(ksp_, &pc));
  POLYSLIP_PETSC(PCSetType(pc, PCSHELL));
  POLYSLIP_PETSC(PCShellSetName(pc, "that of displacements in the whole system, for its last matrix"));
  POLYSLIP_PETSC(PCShellSetContext(pc, of_rock));
  POLYSLIP_PETSC(PCShellSetApply(pc, precondition_rock));
  POLYSLIP_PETSC(KSPSetFromOptions(ksp_));
  POLYSLIP_PETSC(MatCreateVecs(system_.matrix(), solution_.put(), rhs_.put()));
}

/// One Newton step of W; false, on all ranks, where W is too large or cannot be solved.
bool NonlinearElimination::step(Vec x, Vec f, PC of_rock) {
  if (of_rock != nullptr) {
    set_up_rock(of_rock);
  } else {
    choose_faces();
    if (!choose_window()) return false;
    create_solver();
  }
  // Pressures stay as they are. What is set up for the whole system knows symmetric matrices alone.
  if (of_rock == nullptr && multiplies_alone_)
    system_.condense_contact(x);
  else
    system_.linearise_contact(x, of_rock != nullptr ? MechanicsSystem::MatrixContent::symmetric : MechanicsSystem::MatrixContent::exact);
  system_.condense_residual(f, condensed_rows_);
  if (of_rock == nullptr) set_matrix();
  POLYSLIP_PETSC(VecZeroEntries(condensed_direction_));
  KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
  {
    const la::VecRead from(condensed_rows_);
    const la::VecWrite to(rhs_);
    for (std::size_t i = 0; i < rows_.size(); ++i) to[static_cast<Index>(i)] = from[rows_[i]];
  }
  POLYSLIP_PETSC(KSPSolve(ksp_, rhs_, solution_));
  POLYSLIP_PETSC(KSPGetConvergedReason(ksp_, &reason));
  if (reason < 0) return false;
  {
    const la::VecRead from(solution_);
    const la::VecWrite to(condensed_direction_);
    for (std::size_t i = 0; i < rows_.size(); ++i) to[rows_[i]] = from[static_cast<Index>(i)];
  }
  system_.recover(f, condensed_direction_, direction_);
  if (of_rock == nullptr) {
    system_.move(x, direction_, window_, f);
  } else {
    POLYSLIP_PETSC(VecAXPY(x, -1.0, direction_));
    system_.residual(x, f);
  }
  measure(f);
  return true;
}

bool NonlinearElimination::improve(Vec x, Vec f, PC of_rock) {
  steps_ = 0;
  if (most_ <= 0) return false;
  if (takes_rock_ == PETSC_FALSE) of_rock = nullptr;
  measure(f);
  const double start = total_;
  is_unsettled_.assign(sizes_.size(), 0);
  POLYSLIP_PETSC(VecCopy(x, start_x_));
  POLYSLIP_PETSC(VecCopy(f, start_f_));
  const auto is_unsettled = [&] { return total_ > enough * start; };
  const PetscInt windows = of_rock != nullptr ? most_steps_ / 2 : most_steps_;
  for (PetscInt k = 0; k < windows && is_unsettled() && step(x, f, nullptr); ++k) ++steps_;
  forget_window();
  if (steps_ > 0) system_.residual(x, f);  // of fluid as well, and without what windows have lost by rounding
  if (of_rock != nullptr) {
    for (PetscInt k = 0; k < most_steps_ && (k == 0 || is_unsettled()) && step(x, f, of_rock); ++k) ++steps_;
    forget_window();
  }
  if (total_ < start) return true;
  POLYSLIP_PETSC(VecCopy(start_x_, x));
  POLYSLIP_PETSC(VecCopy(start_f_, f));
  return false;
}

}  // namespace polyslip::solver
