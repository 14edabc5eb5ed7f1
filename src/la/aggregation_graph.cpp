#include "polyslip/la/aggregation_graph.hpp"

#include <petsc/private/matimpl.h>  // a method of a matrix of one's own

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "polyslip/la/block_rows.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::la {

namespace {

/// The sums of the blocks of a local matrix, each block read once.
template <int b>
AijEntries sums_of_blocks(Mat matrix, const BlockOperator* lent = nullptr) {
  const BlockRows<b, b> rows(matrix, lent);
  AijEntries sums;
  for (Index i = 0; i < rows.rows(); ++i) sums.offsets.push_back(sums.offsets.back() + rows.row_size(i));
  sums.columns.resize(static_cast<std::size_t>(sums.offsets.back()));
  sums.values.resize(sums.columns.size());
  std::vector<PetscInt> next(sums.offsets.begin(), sums.offsets.end() - 1);
  const auto append = [&](Index row, Index column, double sum) {
    const auto place = static_cast<std::size_t>(next[static_cast<std::size_t>(row)]++);
    sums.columns[place] = column;
    sums.values[place] = sum;
  };
  for (Index i = 0; i < rows.rows(); ++i) {
    const auto visit = [&](Index column, const double* block, PetscInt width) {
      double sum = 0;
      for (int r = 0; r < b; ++r) {
        sum += std::abs(block[r * width + r]);
        for (int c = 0; c < r; ++c) sum += std::abs(block[r * width + c]) + std::abs(block[c * width + r]);  // the same of a transposed block
      }
      append(i, column, sum);
      if (column < i && rows.is_mirrored(column)) append(column, i, sum);
    };
    rows.is_mirrored(i) ? rows.visit_lower(i, visit) : rows.visit(i, visit);
  }
  return sums;
}

/// 1/sqrt(G_II) of the rows of this rank, and of the nodes that columns of others belong to.
std::array<std::vector<double>, 2> scales(MPI_Comm comm, const AijEntries& own, const std::vector<GlobalIndex>& ghosts) {
  const PetscInt rows = own.rows();
  Handle<Vec> scale, of_ghosts;
  POLYSLIP_PETSC(VecCreateMPI(comm, rows, PETSC_DETERMINE, scale.put()));
  {
    const VecWrite values(scale);
    for (PetscInt row = 0; row < rows; ++row) {
      const auto first = own.columns.begin() + own.offsets[static_cast<std::size_t>(row)];
      const auto last = own.columns.begin() + own.offsets[static_cast<std::size_t>(row) + 1];
      const auto at = std::lower_bound(first, last, row);
      const double diagonal = at != last && *at == row ? own.values[static_cast<std::size_t>(at - own.columns.begin())] : 0;
      values[row] = diagonal > 0 ? 1 / std::sqrt(diagonal) : 0;
    }
  }
  POLYSLIP_PETSC(VecCreateSeq(PETSC_COMM_SELF, static_cast<PetscInt>(ghosts.size()), of_ghosts.put()));
  Handle<IS> from;
  VecScatter scatter = nullptr;
  POLYSLIP_PETSC(ISCreateGeneral(comm, static_cast<PetscInt>(ghosts.size()), ghosts.data(), PETSC_COPY_VALUES, from.put()));
  POLYSLIP_PETSC(VecScatterCreate(scale, from, of_ghosts, nullptr, &scatter));
  POLYSLIP_PETSC(VecScatterBegin(scatter, scale, of_ghosts, INSERT_VALUES, SCATTER_FORWARD));
  POLYSLIP_PETSC(VecScatterEnd(scatter, scale, of_ghosts, INSERT_VALUES, SCATTER_FORWARD));
  POLYSLIP_PETSC(VecScatterDestroy(&scatter));
  const VecRead here(scale), there(of_ghosts);
  return {std::vector<double>(here.data(), here.data() + rows), std::vector<double>(there.data(), there.data() + ghosts.size())};
}

/// Keeps the entries above a threshold.
void filter(AijEntries& entries, double threshold) {
  std::size_t kept = 0;
  PetscInt begin = 0;
  for (std::size_t row = 1; row < entries.offsets.size(); ++row) {
    const PetscInt end = entries.offsets[row];
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      if (!(entries.values[k] > threshold)) continue;
      entries.columns[kept] = entries.columns[k];
      entries.values[kept++] = entries.values[k];
    }
    begin = end;
    entries.offsets[row] = static_cast<PetscInt>(kept);
  }
  entries.columns.resize(kept);
  entries.values.resize(kept);
}

template <int b>
Handle<Mat> graph_of(Mat matrix, bool is_scaled, double threshold) {
  const AijParts parts(matrix);
  AijEntries own = sums_of_blocks<b>(parts.own, parts.lent), others;
  const std::vector<GlobalIndex> ghosts = ghosts_of(parts, b);
  if (parts.others != nullptr) others = sums_of_blocks<b>(parts.others);
  if (is_scaled) {
    const auto [scale, of_ghosts] = scales(comm_of(matrix), own, ghosts);
    const auto apply = [&rows = scale](AijEntries& entries, const std::vector<double>& columns) {
      for (std::size_t row = 0; row + 1 < entries.offsets.size(); ++row)
        for (auto k = static_cast<std::size_t>(entries.offsets[row]); k < static_cast<std::size_t>(entries.offsets[row + 1]); ++k)
          entries.values[k] = entries.values[k] * rows[row] * columns[static_cast<std::size_t>(entries.columns[k])];
    };
    apply(own, scale);
    apply(others, of_ghosts);
  }
  for (PetscInt& column : others.columns) column = ghosts[static_cast<std::size_t>(column)];
  if (threshold >= 0)
    for (AijEntries* entries : {&own, &others}) filter(*entries, threshold);
  const PetscInt rows = own.rows();
  return matrix_of(comm_of(matrix), rows, std::move(own), std::move(others));
}

template <int b>
PetscErrorCode create_graph(Mat matrix, PetscBool, PetscBool is_scaled, PetscReal threshold, Mat* graph) {
  PetscFunctionBeginUser;
  PetscCallCXX(*graph = graph_of<b>(matrix, is_scaled == PETSC_TRUE, threshold).release());
  PetscCall(MatSetOption(*graph, MAT_SYMMETRIC, PETSC_TRUE));
  PetscFunctionReturn(0);
}

}  // namespace

void form_graphs_by_blocks(Mat matrix) {
  PetscInt b = 0;
  POLYSLIP_PETSC(MatGetBlockSize(matrix, &b));
  if (b == 2) matrix->ops->creategraph = create_graph<2>;
  if (b == 3) matrix->ops->creategraph = create_graph<3>;
  if (b == 6) matrix->ops->creategraph = create_graph<6>;
}

}  // namespace polyslip::la
