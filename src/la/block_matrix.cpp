#include "polyslip/la/block_matrix.hpp"

#include <petsc/private/petscimpl.h>  // PetscObjectStateIncrease

#include <algorithm>
#include <cassert>
#include <numeric>

namespace polyslip::la {

namespace {

/// Position of each ghost in the ascending order of global numbers, and the numbers in that order.
std::vector<Index> sort_ghosts(std::span<const GlobalIndex> ghosts, std::vector<GlobalIndex>& sorted) {
  std::vector<Index> order(ghosts.size()), position(ghosts.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](Index a, Index b) { return ghosts[a] < ghosts[b]; });
  sorted.resize(ghosts.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    position[static_cast<std::size_t>(order[k])] = static_cast<Index>(k);
    sorted[k] = ghosts[static_cast<std::size_t>(order[k])];
  }
  return position;
}

}  // namespace

BlockMatrix::BlockMatrix(const Layout& layout, const Csr& graph) : block_(layout.block), owned_(layout.owned) {
  std::vector<GlobalIndex> sorted;
  ghost_position_ = sort_ghosts(layout.ghosts, sorted);
  for (Index row = 0; row < owned_; ++row) {
    for (Index col : graph[row])
      (col < owned_ ? diagonal_columns_ : offdiagonal_columns_).values.push_back(col < owned_ ? col : ghost_position_[col - owned_]);
    for (Csr* columns : {&diagonal_columns_, &offdiagonal_columns_}) {
      std::sort(columns->values.begin() + columns->offsets.back(), columns->values.end());
      columns->offsets.push_back(static_cast<Index>(columns->values.size()));
    }
  }
  create(layout);
}

void BlockMatrix::create(const Layout& layout) {
  // Scalar rows with global columns; the ghosts' columns go before and after the owned ones by their numbers.
  std::vector<GlobalIndex> sorted;
  sort_ghosts(layout.ghosts, sorted);
  std::vector<PetscInt> offsets{0}, columns;
  const std::size_t blocks = diagonal_columns_.values.size() + offdiagonal_columns_.values.size();
  columns.reserve(blocks * block_ * block_);
  offsets.reserve(static_cast<std::size_t>(owned_) * block_ + 1);
  const auto append = [&](GlobalIndex copy) {
    for (int b = 0; b < block_; ++b) columns.push_back(copy * block_ + b);
  };
  for (Index row = 0; row < owned_; ++row)
    for (int a = 0; a < block_; ++a) {
      auto ghost = offdiagonal_columns_[row].begin();
      for (; ghost != offdiagonal_columns_[row].end() && sorted[*ghost] < layout.first; ++ghost) append(sorted[*ghost]);
      for (Index col : diagonal_columns_[row]) append(layout.first + col);
      for (; ghost != offdiagonal_columns_[row].end(); ++ghost) append(sorted[*ghost]);
      offsets.push_back(static_cast<PetscInt>(columns.size()));
    }
  POLYSLIP_PETSC(MatCreate(layout.comm, matrix_.put()));
  POLYSLIP_PETSC(MatSetSizes(matrix_, owned_ * block_, owned_ * block_, PETSC_DETERMINE, PETSC_DETERMINE));
  POLYSLIP_PETSC(MatSetBlockSize(matrix_, block_));
  POLYSLIP_PETSC(MatSetType(matrix_, MATAIJ));
  POLYSLIP_PETSC(MatSeqAIJSetPreallocationCSR(matrix_, offsets.data(), columns.data(), nullptr));
  POLYSLIP_PETSC(MatMPIAIJSetPreallocationCSR(matrix_, offsets.data(), columns.data(), nullptr));
  POLYSLIP_PETSC(MatSetOption(matrix_, MAT_NEW_NONZERO_LOCATION_ERR, PETSC_TRUE));
  POLYSLIP_PETSC(MatSetOption(matrix_, MAT_NO_OFF_PROC_ENTRIES, PETSC_TRUE));
  PetscBool parallel = PETSC_FALSE;
  POLYSLIP_PETSC(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(matrix_.get()), MATMPIAIJ, &parallel));
  diagonal_part_ = matrix_;
  if (parallel) POLYSLIP_PETSC(MatMPIAIJGetSeqAIJ(matrix_, &diagonal_part_, &offdiagonal_part_, nullptr));
  POLYSLIP_PETSC(MatZeroEntries(matrix_));
}

void BlockMatrix::begin_writing() {
  POLYSLIP_PETSC(MatSeqAIJGetArray(diagonal_part_, &diagonal_));
  if (offdiagonal_part_ != nullptr) POLYSLIP_PETSC(MatSeqAIJGetArray(offdiagonal_part_, &offdiagonal_));
}

void BlockMatrix::end_writing() {
  POLYSLIP_PETSC(MatSeqAIJRestoreArray(diagonal_part_, &diagonal_));
  if (offdiagonal_part_ != nullptr) POLYSLIP_PETSC(MatSeqAIJRestoreArray(offdiagonal_part_, &offdiagonal_));
  diagonal_ = offdiagonal_ = nullptr;
  // PETSc must see that the values changed, or solvers keep their old set-up.
  POLYSLIP_PETSC(PetscObjectStateIncrease(reinterpret_cast<PetscObject>(matrix_.get())));
  POLYSLIP_PETSC(MatAssemblyBegin(matrix_, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(matrix_, MAT_FINAL_ASSEMBLY));
}

double* BlockMatrix::locate(Index row, Index col) {
  assert(row < owned_ && diagonal_ != nullptr);
  const bool inside = col < owned_;
  const Csr& columns = inside ? diagonal_columns_ : offdiagonal_columns_;
  const Index key = inside ? col : ghost_position_[col - owned_];
  const auto range = columns[row];
  const auto position = std::lower_bound(range.begin(), range.end(), key) - range.begin();
  assert(position < static_cast<std::ptrdiff_t>(range.size()) && range[static_cast<std::size_t>(position)] == key);
  return (inside ? diagonal_ : offdiagonal_) + static_cast<std::size_t>(block_) * block_ * columns.offsets[row] + block_ * position;
}

}  // namespace polyslip::la
