// A symmetric matrix of small dense blocks over entities (node copies, faces) that is assembled once, multiplied often, and written out for others.
//
// Of the blocks (i, j) and (j, i) of owned entities it holds the lower one, which serves twice, as it is and transposed: assembly writes half as
// much, and a product moves half of what a MATAIJ has in numbers, and an eighteenth in columns (of blocks of 3 x 3). Where the mirrored half is not
// good enough (it is not rounded as the row is), all blocks are held.
#pragma once

#include <cassert>
#include <functional>
#include <span>
#include <vector>

#include "polyslip/common/types.hpp"
#include "polyslip/la/block_matrix.hpp"

namespace polyslip::la {

class BlockOperator {
 public:
  /// Zeros where `pattern` has blocks; `by_halves`: without those above the diagonal.
  BlockOperator(const BlockMatrix& pattern, bool by_halves);

  [[nodiscard]] bool by_halves() const { return by_halves_; }
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

  /// All blocks into those of `matrix`, which has the pattern: its values are set then.
  void write_to(BlockMatrix& matrix) const;

  /// y = A x for the components of the owned entities (y) and of the local ones (x, ghosts last), as the matrix numbers them.
  void multiply(std::span<const double> x, std::span<double> y);

  [[nodiscard]] double bytes() const { return static_cast<double>(values_.size() * sizeof(double)); }
  [[nodiscard]] double blocks() const { return static_cast<double>(columns_.values.size()); }

 private:
  [[nodiscard]] int width(Index entity) const { return first_[static_cast<std::size_t>(entity) + 1] - first_[static_cast<std::size_t>(entity)]; }
  [[nodiscard]] std::size_t first_value(Index k) const {
    return width_ > 0 ? static_cast<std::size_t>(k) * static_cast<std::size_t>(width_ * width_) : start_[static_cast<std::size_t>(k)];
  }
  /// Blocks of nodes, nearly all of them: the compiler unrolls what it knows the length of.
  template <int n>
  static void add_square(double* values, const double* block, int row_step, int column_step) {
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b) values[a * n + b] += block[a * row_step + b * column_step];
  }
  template <int b>
  void write_blocks(BlockMatrix& matrix) const;
  template <int b>
  void multiply_nodes(std::span<const double> x, std::span<double> y);
  template <int b>
  void multiply_row(Index i, const double* x, double* y) const;
  void multiply_unlike(std::span<const double> x, std::span<double> y) const;

  Index owned_;
  int width_;  ///< Components of every entity; 0 where they differ.
  bool by_halves_;
  std::vector<Index> first_;        ///< First component of each local entity, and the end.
  Csr columns_;                     ///< Local entities, ascending.
  std::vector<Index> mirrored_;     ///< How many blocks of a row, the first ones, serve twice.
  std::vector<double> values_;      ///< Block by block, and zeros behind the last one that are read as well.
  std::vector<std::size_t> start_;  ///< First value of each block where widths differ.
  PlaceFinder places_;
  std::vector<double> x_, y_;       ///< A node fills whole vectors of the processor, with zeros behind its components.
};

/// From now on MatMult(matrix, x, y) calls multiply(x, y), which must outlive the matrix.
void replace_product(Mat matrix, const std::function<void(Vec, Vec)>& multiply);

}  // namespace polyslip::la
