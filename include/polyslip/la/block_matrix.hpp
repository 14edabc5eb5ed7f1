// A distributed matrix of dense d x d blocks over node copies, stored as PETSc AIJ with block size d and written in place.
//
// All d rows of an owned copy have the same columns, so the slot of entry (row copy i, component a; column copy j, component b) follows
// from the position of j in the copy's row of blocks: no hashing, no stash, no communication during assembly. Rows of ghosts are not stored.
#pragma once

#include <span>
#include <vector>

#include "polyslip/common/types.hpp"
#include "polyslip/la/handle.hpp"

namespace polyslip::la {

class BlockMatrix {
 public:
  struct Layout {
    MPI_Comm comm = MPI_COMM_SELF;
    int block = 3;                             ///< d
    Index owned = 0;                           ///< Copies of this rank.
    GlobalIndex first = 0;                     ///< Global number of the first owned copy.
    std::span<const GlobalIndex> ghosts;       ///< Global numbers of local copies owned .. owned + ghosts.size() - 1.
  };

  /// `graph` has one row an owned copy: the local copies it couples with, itself included, in any order, no repeats.
  BlockMatrix(const Layout& layout, const Csr& graph);

  /// Adds to the block of owned copy `row` and local copy `col`; block points at entry (0, 0) of a row-major matrix with `stride` columns.
  void add(Index row, Index col, const double* block, int stride) {
    double* slot = locate(row, col);
    const Index step = row_width(row, col);
    for (int a = 0; a < block_; ++a)
      for (int b = 0; b < block_; ++b) slot[a * step + b] += block[a * stride + b];
  }

  /// Values of all blocks of an owned row (contiguous, d rows), in and off the diagonal part.
  [[nodiscard]] std::span<double> diagonal_row(Index row) {
    return {diagonal_ + static_cast<std::size_t>(block_) * block_ * diagonal_columns_.offsets[row],
            static_cast<std::size_t>(block_) * block_ * diagonal_columns_.row_size(row)};
  }
  [[nodiscard]] std::span<double> offdiagonal_row(Index row) {
    if (offdiagonal_ == nullptr) return {};
    return {offdiagonal_ + static_cast<std::size_t>(block_) * block_ * offdiagonal_columns_.offsets[row],
            static_cast<std::size_t>(block_) * block_ * offdiagonal_columns_.row_size(row)};
  }

  /// Makes the values ours to write (get) and PETSc's to use (put); writes go between the two.
  void begin_writing();
  void end_writing();

  [[nodiscard]] Mat get() const { return matrix_; }
  [[nodiscard]] Index owned() const { return owned_; }

 private:
  void create(const Layout& layout);
  [[nodiscard]] double* locate(Index row, Index col);
  [[nodiscard]] Index row_width(Index row, Index col) const {
    return block_ * (col < owned_ ? diagonal_columns_.row_size(row) : offdiagonal_columns_.row_size(row));
  }

  int block_;
  Index owned_;
  Csr diagonal_columns_;     ///< Owned columns of each row, ascending.
  Csr offdiagonal_columns_;  ///< Ghost columns of each row by rank in the ascending order of their global numbers.
  std::vector<Index> ghost_position_;  ///< That order's position of each ghost.
  Handle<Mat> matrix_;
  Mat diagonal_part_ = nullptr, offdiagonal_part_ = nullptr;  // borrowed from matrix_
  double* diagonal_ = nullptr;
  double* offdiagonal_ = nullptr;
};

}  // namespace polyslip::la
