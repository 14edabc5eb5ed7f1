#include "polyslip/la/block_matrix.hpp"

#include <petsc/private/petscimpl.h>  // PetscObjectStateIncrease

#include <algorithm>
#include <cassert>
#include <numeric>

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
    : block_(layout.block), owned_(layout.owned), widths_(layout.widths.begin(), layout.widths.end()) {
  const std::vector<Index> ghost_at = sort_ghosts(layout.ghosts);
  ghost_position_.resize(ghost_at.size());
  std::vector<GlobalIndex> sorted;
  for (Index ghost : ghost_at) {
    ghost_position_[static_cast<std::size_t>(ghost)] = static_cast<Index>(sorted.size());
    sorted.push_back(layout.ghosts[static_cast<std::size_t>(ghost)]);
  }
  for (Index row = 0; row < owned_; ++row) add_graph_row(row, graph[row], ghost_at);
  create(layout, sorted, ghost_at);
}

void BlockMatrix::add_graph_row(Index row, std::span<const Index> graph, std::span<const Index> ghost_at) {
  for (Index col : graph)
    (col < owned_ ? diagonal_ : offdiagonal_).columns.values.push_back(col < owned_ ? col : ghost_position_[col - owned_]);
  for (Part* part : {&diagonal_, &offdiagonal_}) {
    const auto first = part->columns.values.begin() + part->columns.offsets.back();
    std::sort(first, part->columns.values.end());
    Index components = 0;
    for (auto column = first; column != part->columns.values.end(); ++column) {
      part->offset.push_back(components);
      components += width(part == &diagonal_ ? *column : owned_ + ghost_at[*column]);
    }
    part->columns.offsets.push_back(static_cast<Index>(part->columns.values.size()));
    part->row_width.push_back(components);
    part->start.push_back(part->start.back() + static_cast<std::size_t>(width(row)) * components);
  }
}

void BlockMatrix::create(const Layout& layout, std::span<const GlobalIndex> sorted_ghosts, std::span<const Index> ghost_at) {
  // Scalar rows with global columns; the ghosts' columns go before and after the owned ones by their numbers.
  std::vector<GlobalIndex> first_of{layout.first};  // owned entities
  for (Index i = 0; i < owned_; ++i) first_of.push_back(first_of.back() + width(i));
  const PetscInt components = first_of.back() - layout.first;
  std::vector<PetscInt> offsets{0}, columns;
  columns.reserve(diagonal_.start.back() + offdiagonal_.start.back());
  offsets.reserve(static_cast<std::size_t>(components) + 1);
  const auto append = [&](GlobalIndex first, int n) {
    for (int b = 0; b < n; ++b) columns.push_back(first + b);
  };
  for (Index row = 0; row < owned_; ++row)
    for (int a = 0; a < width(row); ++a) {
      const auto ghosts = offdiagonal_.columns[row];
      auto ghost = ghosts.begin();
      const auto append_ghost = [&] { append(sorted_ghosts[*ghost], width(owned_ + ghost_at[*ghost])); };
      for (; ghost != ghosts.end() && sorted_ghosts[*ghost] < layout.first; ++ghost) append_ghost();
      for (Index col : diagonal_.columns[row]) append(first_of[col], width(col));
      for (; ghost != ghosts.end(); ++ghost) append_ghost();
      offsets.push_back(static_cast<PetscInt>(columns.size()));
    }
  POLYSLIP_PETSC(MatCreate(layout.comm, matrix_.put()));
  POLYSLIP_PETSC(MatSetSizes(matrix_, components, components, PETSC_DETERMINE, PETSC_DETERMINE));
  if (widths_.empty()) POLYSLIP_PETSC(MatSetBlockSize(matrix_, block_));
  POLYSLIP_PETSC(MatSetType(matrix_, MATAIJ));
  POLYSLIP_PETSC(MatSeqAIJSetPreallocationCSR(matrix_, offsets.data(), columns.data(), nullptr));
  POLYSLIP_PETSC(MatMPIAIJSetPreallocationCSR(matrix_, offsets.data(), columns.data(), nullptr));
  POLYSLIP_PETSC(MatSetOption(matrix_, MAT_NEW_NONZERO_LOCATION_ERR, PETSC_TRUE));
  POLYSLIP_PETSC(MatSetOption(matrix_, MAT_NO_OFF_PROC_ENTRIES, PETSC_TRUE));
  PetscBool parallel = PETSC_FALSE;
  POLYSLIP_PETSC(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(matrix_.get()), MATMPIAIJ, &parallel));
  diagonal_.matrix = matrix_;
  if (parallel) POLYSLIP_PETSC(MatMPIAIJGetSeqAIJ(matrix_, &diagonal_.matrix, &offdiagonal_.matrix, nullptr));
  POLYSLIP_PETSC(MatZeroEntries(matrix_));
}

void BlockMatrix::begin_writing() {
  for (Part* part : {&diagonal_, &offdiagonal_})
    if (part->matrix != nullptr) POLYSLIP_PETSC(MatSeqAIJGetArray(part->matrix, &part->values));
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

BlockMatrix::Slot BlockMatrix::locate(Index row, Index col) const {
  const Part& part = col < owned_ ? diagonal_ : offdiagonal_;
  assert(row < owned_ && part.values != nullptr);
  const Index key = col < owned_ ? col : ghost_position_[col - owned_];
  const auto range = part.columns[row];
  const auto position = std::lower_bound(range.begin(), range.end(), key) - range.begin();
  assert(position < static_cast<std::ptrdiff_t>(range.size()) && range[static_cast<std::size_t>(position)] == key);
  const Index offset = part.offset[static_cast<std::size_t>(part.columns.offsets[row] + position)];
  return {part.values + part.start[static_cast<std::size_t>(row)] + offset, part.row_width[static_cast<std::size_t>(row)]};
}

}  // namespace polyslip::la
