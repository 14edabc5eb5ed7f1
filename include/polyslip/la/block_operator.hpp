// A symmetric matrix of small dense blocks over entities (node copies, faces) that is assembled once, multiplied often, and lent or written to
// others.
//
// Of the blocks (i, j) and (j, i) of owned entities it holds the lower one, which serves twice, as it is and transposed: assembly writes half as
// much, and a product moves half of what a MATAIJ has in numbers, and an eighteenth in columns (of blocks of 3 x 3). Where the mirrored half is not
// good enough (it is not rounded as the row is), all blocks are held.
//
// A MATAIJ that differs from it in a few rows need not hold the others: see lend_rows.
#pragma once

#include <array>
#include <cassert>
#include <functional>
#include <span>
#include <vector>

#include "polyslip/common/processor.hpp"
#include "polyslip/common/types.hpp"
#include "polyslip/la/block_matrix.hpp"

namespace polyslip::la {

class BlockOperator {
 public:
  /// Zeros where the graph (as that of a BlockMatrix) has couplings; `by_halves`: without those above the diagonal.
  BlockOperator(const BlockMatrix::Layout& layout, const Csr& graph, bool by_halves);

  [[nodiscard]] bool by_halves() const { return by_halves_; }
  [[nodiscard]] int block() const { return width_; }  ///< Components of every entity; 0 where they differ.
  [[nodiscard]] Index owned() const { return owned_; }
  [[nodiscard]] Index local() const { return static_cast<Index>(first_.size()) - 1; }
  [[nodiscard]] Index first(Index entity) const { return first_[static_cast<std::size_t>(entity)]; }  ///< Component; of local(): their number.
  [[nodiscard]] bool holds(Index row, Index col) const { return row < owned_ && (!by_halves_ || col <= row || col >= owned_); }
  /// Adds to the block of owned entity `row` and local entity `col`, which it holds; entry (a, b) is block[a * row_step + b * column_step].
  void add(Index row, Index col, const double* block, int row_step, int column_step) {
    assert(holds(row, col));
    double* values = values_.data() + first_value(places_.find(columns_, row, col));
    if (width_ == 3) return add_square<3>(values, block, row_step, column_step);
    if (width_ == 2) return add_square<2>(values, block, row_step, column_step);
    const int rows = width(row), columns = width(col);
    for (int a = 0; a < rows; ++a)
      for (int b = 0; b < columns; ++b) values[a * columns + b] += block[a * row_step + b * column_step];
  }

  /// Calls visit(j, block, columns) for the blocks (i, j) of owned entities, by ascending j: rows of `columns` entries each. All entities have b
  /// components; 0 where they differ.
  template <int b, class Visit>
  void visit_own(Index i, Visit&& visit) const;
  /// The same for j <= i alone; all entities have b components.
  template <int b, class Visit>
  void visit_lower(Index i, Visit&& visit) const {
    for (Index k = columns_.offsets[i]; k < end_of_own(i) && columns_.values[static_cast<std::size_t>(k)] <= i; ++k)
      visit(columns_.values[static_cast<std::size_t>(k)], block(k), b);
  }
  /// The same for the ghosts, whatever the widths.
  template <class Visit>
  void visit_ghosts(Index i, Visit&& visit) const {
    for (Index k = end_of_own(i); k < columns_.offsets[i + 1]; ++k) {
      const Index ghost = columns_.values[static_cast<std::size_t>(k)];
      visit(ghost, block(k), width(ghost));
    }
  }
  /// For all blocks, whatever the widths: ghosts follow.
  template <class Visit>
  void visit_row(Index i, Visit&& visit) const {
    visit_own<0>(i, visit);
    visit_ghosts(i, visit);
  }
  [[nodiscard]] Index blocks_held(Index i) const { return columns_.row_size(i); }
  [[nodiscard]] Index own_blocks(Index i) const { return end_of_own(i) - columns_.offsets[i] + above_.row_size(i); }  ///< How many these are.
  /// Calls visit(local entity) for all that an owned one is coupled with.
  template <class Visit>
  void visit_columns(Index row, Visit&& visit) const {
    for (Index col : columns_[row]) visit(col);
    for (Index col : above_[row]) visit(col);
  }
  [[nodiscard]] Csr graph() const;
  /// Entries of the owned components.
  [[nodiscard]] std::vector<double> diagonal() const;

  /// Writes the rows of `matrix`, which has the couplings of this one or, in some rows, those with ghosts alone: all its values are set then.
  void write_to(BlockMatrix& matrix) const;

  /// y = A x for the components of the owned entities (y) and of the local ones (x, ghosts last), as the matrix numbers them.
  void multiply(std::span<const double> x, std::span<double> y);
  /// The same where x is zero off some owned entities, `rows` the rows near these, and ghosts: only in these rows, or in all.
  void multiply_rows(std::span<const Index> rows, std::span<const double> x, std::span<double> y);
  /// Owned entities that are coupled with some others, or with ghosts; ascending.
  [[nodiscard]] std::vector<Index> rows_near(std::span<const Index> entities) const;

  [[nodiscard]] double bytes() const { return static_cast<double>(values_.size() * sizeof(double)); }
  [[nodiscard]] double blocks() const { return static_cast<double>(columns_.values.size()); }

 private:
  [[nodiscard]] int width(Index entity) const { return first(entity + 1) - first(entity); }
  [[nodiscard]] std::size_t first_value(Index k) const {
    return width_ > 0 ? static_cast<std::size_t>(k) * static_cast<std::size_t>(width_ * width_) : start_[static_cast<std::size_t>(k)];
  }
  /// Blocks of nodes, nearly all of them: the compiler unrolls what it knows the length of.
  template <int n>
  static void add_square(double* values, const double* block, int row_step, int column_step) {
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b) values[a * n + b] += block[a * row_step + b * column_step];
  }
  /// Behind the blocks of row i with owned entities that are held.
  [[nodiscard]] Index end_of_own(Index i) const { return columns_.offsets[i + 1] - ghosts_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] const double* block(Index k) const { return values_.data() + first_value(k); }
  void add_graph_row(Index row, std::span<const Index> graph, std::vector<Index>& next_above);
  template <int b>
  void write_blocks(BlockMatrix& matrix) const;
  template <int b>
  POLYSLIP_BY_PROCESSOR void multiply_nodes(std::span<const double> x, std::span<double> y);
  template <int b>
  POLYSLIP_BY_PROCESSOR void multiply_some_nodes(std::span<const Index> rows, std::span<const double> x, std::span<double> y);
  template <int b>
  [[gnu::always_inline]] void multiply_row(Index i, const double* x, double* y) const;
  void multiply_unlike(std::span<const double> x, std::span<double> y) const;

  Index owned_;
  int width_;  ///< Components of every entity; 0 where they differ.
  bool by_halves_;
  std::vector<Index> first_;        ///< First component of each local entity, and the end.
  Csr columns_;                     ///< Local entities, ascending.
  std::vector<Index> mirrored_;     ///< How many blocks of a row, the first ones, serve twice,
  std::vector<Index> ghosts_;       ///< and how many, the last ones, belong to ghosts.
  Csr above_;                       ///< Owned entities above the diagonal whose blocks are held in the rows of these,
  std::vector<Index> block_above_;  ///< and the blocks.
  std::vector<double> values_;      ///< Block by block, and zeros behind the last one that are read as well.
  std::vector<std::size_t> start_;  ///< First value of each block where widths differ.
  PlaceFinder places_;
  std::vector<double> x_, y_;       ///< A node fills whole vectors of the processor, with zeros behind its components.
};

template <int b, class Visit>
void BlockOperator::visit_own(Index i, Visit&& visit) const {
  assert(b == 0 || b == width_);
  const int rows = b > 0 ? b : width(i);
  const auto columns = [&](Index j) { return b > 0 ? b : width(j); };
  for (Index k = columns_.offsets[i]; k < end_of_own(i); ++k) {
    const Index j = columns_.values[static_cast<std::size_t>(k)];
    visit(j, block(k), columns(j));
  }
  std::array<double, (b > 0 ? b * b : 9)> transposed;
  for (Index k = above_.offsets[i]; k < above_.offsets[i + 1]; ++k) {
    const Index j = above_.values[static_cast<std::size_t>(k)];
    const double* below = block(block_above_[static_cast<std::size_t>(k)]);
    const int width = columns(j);
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < width; ++c) transposed[static_cast<std::size_t>(r * width + c)] = below[c * rows + r];
    visit(j, transposed.data(), width);
  }
}

/// What a MATAIJ does that does not hold all of its entries, or for which there is a faster way. Must outlive the matrix.
struct MatrixOperations {
  std::function<void(Vec x, Vec y)> multiply;  ///< y = A x
  std::function<void(Vec y)> diagonal;         ///< y = diag A
  mutable Handle<Vec> product = {};            ///< For MatMultAdd.
};
/// MatMult, MatMultAdd and MatGetDiagonal by these from now on.
void replace_operations(Mat matrix, const MatrixOperations& operations);

/// Rows of a MATAIJ without entries in columns of this rank are those of `rows` there, for the readers of this library (AijParts::lent): it holds
/// only what is its own, and the couplings with ghosts. By halves, what it holds below the diagonal in columns of lent rows is theirs, transposed.
/// Whoever reads such a matrix by PETSc's functions finds rows without a diagonal. The last one that is lent counts; it must outlive the matrix.
void lend_rows(Mat matrix, const BlockOperator& rows);

}  // namespace polyslip::la
