#include "polyslip/la/block_matrix.hpp"

#include <petsc/private/petscimpl.h>  // PetscObjectStateIncrease

#include <algorithm>
#include <numeric>

#include "polyslip/common/mpi.hpp"

namespace polyslip::la {

namespace {

/// Ghosts in the ascending order of their global numbers.
std::vector<Index> sort_ghosts(std::span<const GlobalIndex> ghosts) {
  std::vector<Index> order(ghosts.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](Index a, Index b) { return ghosts[a] < ghosts[b]; });
  return order;
}

}  // namespace

BlockMatrix::BlockMatrix(const Layout& layout, const Csr& graph)
    : block_(layout.block),
      owned_(layout.owned),
      widths_(layout.widths.begin(), layout.widths.end()),
      ghost_at_(sort_ghosts(layout.ghosts)) {
  ghost_position_.resize(ghost_at_.size());
  std::vector<GlobalIndex> sorted;
  for (Index ghost : ghost_at_) {
    ghost_position_[static_cast<std::size_t>(ghost)] = static_cast<Index>(sorted.size());
    sorted.push_back(layout.ghosts[static_cast<std::size_t>(ghost)]);
  }
  for (Index row = 0; row < owned_; ++row) add_graph_row(row, graph[row]);
  create(layout, sorted);
}

void BlockMatrix::add_graph_row(Index row, std::span<const Index> graph) {
  for (Index col : graph)
    (col < owned_ ? diagonal_ : offdiagonal_).columns.values.push_back(col < owned_ ? col : ghost_position_[col - owned_]);
  for (Part* part : {&diagonal_, &offdiagonal_}) {
    const auto first = part->columns.values.begin() + part->columns.offsets.back();
    std::sort(first, part->columns.values.end());
    Index components = 0;
    for (auto column = first; column != part->columns.values.end(); ++column) {
      part->offset.push_back(components);
      components += width(part == &diagonal_ ? *column : owned_ + ghost_at_[*column]);
    }
    part->columns.offsets.push_back(static_cast<Index>(part->columns.values.size()));
    part->row_width.push_back(components);
    part->start.push_back(part->start.back() + static_cast<std::size_t>(width(row)) * components);
  }
}

void BlockMatrix::create(const Layout& layout, std::span<const GlobalIndex> sorted_ghosts) {
  std::vector<PetscInt> first_of{0};  // local row of each owned entity
  for (Index i = 0; i < owned_; ++i) first_of.push_back(first_of.back() + width(i));
  const auto append = [](Part& part, PetscInt first, int n) {
    for (int b = 0; b < n; ++b) part.entries.columns.push_back(first + b);
  };
  for (Part* part : {&diagonal_, &offdiagonal_}) {
    part->entries.columns.reserve(part->start.back());
    part->entries.offsets.reserve(static_cast<std::size_t>(first_of.back()) + 1);
    part->entries.values.resize(part->start.back());
  }
  for (Index row = 0; row < owned_; ++row) {
    for (Index col : diagonal_.columns[row]) append(diagonal_, first_of[static_cast<std::size_t>(col)], width(col));
    for (Index ghost : offdiagonal_.columns[row])
      append(offdiagonal_, sorted_ghosts[static_cast<std::size_t>(ghost)], width(owned_ + ghost_at_[static_cast<std::size_t>(ghost)]));
    for (Part* part : {&diagonal_, &offdiagonal_}) part->repeat_columns(width(row));
  }
  matrix_ = matrix_on(layout.comm, first_of.back(), diagonal_.entries, offdiagonal_.entries);
  const AijParts parts(matrix_);
  diagonal_.matrix = parts.own;
  offdiagonal_.matrix = parts.others;
  if (widths_.empty()) POLYSLIP_PETSC(MatSetBlockSize(matrix_, block_));
  POLYSLIP_PETSC(MatSetOption(matrix_, MAT_NEW_NONZERO_LOCATION_ERR, PETSC_TRUE));
  POLYSLIP_PETSC(MatSetOption(matrix_, MAT_NO_OFF_PROC_ENTRIES, PETSC_TRUE));
}

void BlockMatrix::Part::repeat_columns(int rows) {
  UnsetVector<PetscInt>& all = entries.columns;
  const auto begin = static_cast<std::size_t>(entries.offsets.back()), n = all.size() - begin;
  for (int a = 0; a < rows; ++a) {
    if (a > 0) {
      all.resize(all.size() + n);
      std::copy_n(all.end() - 2 * static_cast<std::ptrdiff_t>(n), n, all.end() - static_cast<std::ptrdiff_t>(n));
    }
    entries.offsets.push_back(static_cast<PetscInt>(all.size()));
  }
}

void BlockMatrix::begin_writing() {
  for (Part* part : {&diagonal_, &offdiagonal_})
    if (part->matrix != nullptr) POLYSLIP_PETSC(MatSeqAIJGetArray(part->matrix, &part->values));
}

void BlockMatrix::set_zero() {
  for (Part* part : {&diagonal_, &offdiagonal_}) std::fill_n(part->values, part->start.back(), 0.0);
}

void BlockMatrix::end_writing() {
  for (Part* part : {&diagonal_, &offdiagonal_}) {
    if (part->matrix != nullptr) POLYSLIP_PETSC(MatSeqAIJRestoreArray(part->matrix, &part->values));
    part->values = nullptr;
  }
  // PETSc must see that the values changed, or solvers keep their old set-up.
  POLYSLIP_PETSC(PetscObjectStateIncrease(reinterpret_cast<PetscObject>(matrix_.get())));
  POLYSLIP_PETSC(MatAssemblyBegin(matrix_, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(matrix_, MAT_FINAL_ASSEMBLY));
}

}  // namespace polyslip::la
