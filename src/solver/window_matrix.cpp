#include "polyslip/solver/window_matrix.hpp"

#include <algorithm>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::solver {

namespace {
constexpr auto friction = assembly::ContactCells::Friction::moving;
}

WindowMatrix::WindowMatrix(const assembly::MechanicsSystem& system) : system_(system), exchanges_(mpi::size(system.mesh().comm) > 1) {
  if (exchanges_) whole_.assign(static_cast<std::size_t>(system.layout().local_displacements()), 0.0);
}

void WindowMatrix::choose(std::span<const Index> entities) {
  const assembly::ContactCells& cells = system_.contact_cells();
  bulk_.copy(system_.bulk(), entities);
  for (std::size_t i = 0; exchanges_ && i < rows_.size(); ++i) whole_[static_cast<std::size_t>(rows_[i])] = 0;
  rows_.clear();
  for (const Index entity : entities) system_.layout().append_components(entity, rows_);
  cells_.clear();
  columns_ = {};
  const auto nowhere = static_cast<Index>(bulk_.columns());
  std::vector<Index> columns;
  for (Index p = 0; p < cells.size(); ++p) {
    columns.clear();
    for (const Index i : cells.displacements(p)) {
      const Index column = system_.fixed()[i] ? -1 : bulk_.column(i);
      columns.push_back(column < 0 ? nowhere : column);
    }
    if (*std::min_element(columns.begin(), columns.end()) >= static_cast<Index>(bulk_.rows())) continue;
    cells_.push_back(p);
    columns_.push_row(columns);
  }
  x_.assign(bulk_.columns() + 1, 0.0);
  y_ = x_;
  const auto n = static_cast<PetscInt>(rows_.size());
  POLYSLIP_PETSC(MatCreateShell(system_.mesh().comm, n, n, PETSC_DETERMINE, PETSC_DETERMINE, this, shell_.put()));
  POLYSLIP_PETSC(MatShellSetOperation(shell_, MATOP_MULT, reinterpret_cast<void (*)()>(multiply_shell)));
  POLYSLIP_PETSC(MatShellSetOperation(shell_, MATOP_GET_DIAGONAL, reinterpret_cast<void (*)()>(diagonal_of_shell)));
  follow();
}

void WindowMatrix::follow() const {
  POLYSLIP_PETSC(MatAssemblyBegin(shell_, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(shell_, MAT_FINAL_ASSEMBLY));
}

PetscErrorCode WindowMatrix::multiply_shell(Mat shell, Vec x, Vec y) {
  PetscFunctionBeginUser;
  WindowMatrix* its = nullptr;
  PetscCall(MatShellGetContext(shell, &its));
  PetscCallCXX(its->multiply(x, y));
  PetscFunctionReturn(0);
}

void WindowMatrix::multiply(Vec x, Vec y) {
  {
    const la::VecRead from(x);
    std::copy_n(from.data(), rows_.size(), x_.begin());
  }
  if (exchanges_) fetch_ghosts();
  bulk_.multiply(x_, y_);
  for (std::size_t k = 0; k < cells_.size(); ++k) {
    const auto columns = std::as_const(columns_)[static_cast<Index>(k)];
    of_cell_.resize(columns.size());
    sums_.assign(columns.size(), 0.0);
    for (std::size_t i = 0; i < columns.size(); ++i) of_cell_[i] = x_[static_cast<std::size_t>(columns[i])];
    system_.contact_cells().add_condensation(cells_[k], friction, 1, of_cell_, sums_);
    for (std::size_t i = 0; i < columns.size(); ++i) y_[static_cast<std::size_t>(columns[i])] += sums_[i];
  }
  const la::VecWrite to(y);
  std::copy_n(y_.begin(), rows_.size(), to.data());
}

void WindowMatrix::fetch_ghosts() {
  for (std::size_t i = 0; i < rows_.size(); ++i) whole_[static_cast<std::size_t>(rows_[i])] = x_[i];
  system_.layout().exchange(whole_);
  std::copy(whole_.begin() + system_.layout().displacement_size(), whole_.end(), x_.begin() + static_cast<std::ptrdiff_t>(rows_.size()));
}

PetscErrorCode WindowMatrix::diagonal_of_shell(Mat shell, Vec diagonal) {
  PetscFunctionBeginUser;
  WindowMatrix* its = nullptr;
  PetscCall(MatShellGetContext(shell, &its));
  const la::VecWrite to(diagonal);
  const std::vector<double> bulk = its->bulk_.diagonal();
  std::copy(bulk.begin(), bulk.end(), to.data());
  for (std::size_t k = 0; k < its->cells_.size(); ++k) {
    const auto columns = std::as_const(its->columns_)[static_cast<Index>(k)];
    for (std::size_t i = 0; i < columns.size(); ++i)
      if (columns[i] < static_cast<Index>(its->rows_.size()))
        to[columns[i]] += its->system_.contact_cells().condensed_diagonal(its->cells_[k], friction, static_cast<int>(i));
  }
  PetscFunctionReturn(0);
}

}  // namespace polyslip::solver
