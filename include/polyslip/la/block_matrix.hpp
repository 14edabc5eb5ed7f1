// A distributed matrix of small dense blocks over entities (node copies, faces), stored as PETSc AIJ and written in place.
//
// Entity i has w_i components. All rows of an owned entity have the same columns, so the slot of entry (row entity i, component a;
// column entity j, component b) follows from the position of j in the row of blocks: no hashing, no stash, no communication during
// assembly. Rows of ghosts are not stored. PETSc works on arrays that are held here: the Mat is not for use after this object's end.
#pragma once

#include <algorithm>
#include <cassert>
#include <span>
#include <vector>

#include "polyslip/common/types.hpp"
#include "polyslip/la/aij_parts.hpp"
#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// Finds columns in the rows of blocks, which ascend; the one asked for next is often the one behind the last.
class PlaceFinder {
 public:
  /// Among all columns, of one that the row has.
  [[nodiscard]] Index find(const Csr& columns, Index row, Index column) {
    const Index next = last_ + 1, begin = columns.offsets[row], end = columns.offsets[row + 1];
    const bool is_next = next >= begin && next < end && columns.values[static_cast<std::size_t>(next)] == column;
    return last_ = is_next ? next : search(columns, row, column);
  }
  [[nodiscard]] static Index search(const Csr& columns, Index row, Index column) {
    const auto range = columns[row];
    const auto place = std::lower_bound(range.begin(), range.end(), column) - range.begin();
    assert(place < columns.row_size(row) && range[static_cast<std::size_t>(place)] == column);
    return columns.offsets[row] + static_cast<Index>(place);
  }

 private:
  Index last_ = -1;
};

class BlockMatrix {
 public:
  struct Layout {
    MPI_Comm comm = MPI_COMM_SELF;
    int block = 3;                        ///< Components of every entity where `widths` is empty; then also PETSc's block size.
    Index owned = 0;                      ///< Entities of this rank.
    GlobalIndex first = 0;                ///< Global number of their first component.
    std::span<const GlobalIndex> ghosts;  ///< Global number of the first component of each ghost: local entities owned, owned + 1, ...
    std::span<const char> widths = {};    ///< Components of each local entity where they differ.
  };

  /// `graph` has one row an owned entity: the local entities it couples with, itself included, in any order, no repeats. Values are not set yet.
  BlockMatrix(const Layout& layout, const Csr& graph);

  /// Where entry (0, 0) of a block is, while the matrix is written.
  struct Slot {
    double* values;
    Index step;  ///< From one row to the next.
  };
  /// Of owned entity `row` and local entity `col`.
  [[nodiscard]] Slot slot(Index row, Index col) { return part_of(col).slot(row, place(row, col)); }
  /// What of the search for a slot lasts as long as the matrix, for who adds to a block again and again.
  [[nodiscard]] Index place(Index row, Index col) {
    Part& part = part_of(col);
    return part.places.find(part.columns, row, col < owned_ ? col : ghost_position_[col - owned_]);
  }
  /// Of an owned row and its k-th column that is owned, too.
  [[nodiscard]] Slot owned_slot(Index row, Index k) { return diagonal_.slot(row, diagonal_.columns.offsets[row] + k); }
  /// Adds to the block of owned entity `row` and local entity `col`; block points at entry (0, 0) of a row-major matrix with
  /// `stride` columns.
  void add(Index row, Index col, const double* block, int stride) { add_at(place(row, col), row, col, block, stride); }
  void add_at(Index place, Index row, Index col, const double* block, int stride) {
    const Slot to = part_of(col).slot(row, place);
    const int rows = width(row), columns = width(col);
    if (rows == 3 && columns == 3) return add_square<3>(to, block, stride);
    if (rows == 2 && columns == 2) return add_square<2>(to, block, stride);
    for (int a = 0; a < rows; ++a)
      for (int b = 0; b < columns; ++b) to.values[a * to.step + b] += block[a * stride + b];
  }

  [[nodiscard]] int width(Index entity) const { return widths_.empty() ? block_ : widths_[static_cast<std::size_t>(entity)]; }

  /// Values of all blocks of an owned row (contiguous, one row a component), in and off the diagonal part.
  [[nodiscard]] std::span<double> diagonal_row(Index row) { return diagonal_.row(row); }
  [[nodiscard]] std::span<double> offdiagonal_row(Index row) {
    if (offdiagonal_.values == nullptr) return {};
    return offdiagonal_.row(row);
  }

  /// Whether an owned row has blocks in columns of this rank.
  [[nodiscard]] bool has_own(Index row) const { return diagonal_.columns.row_size(row) > 0; }

  /// Makes the values ours to write (get) and PETSc's to use (put); writes go between the two.
  void begin_writing();
  void set_zero();  ///< All values.
  void end_writing();

  [[nodiscard]] Mat get() const { return matrix_; }
  [[nodiscard]] Index owned() const { return owned_; }

 private:
  /// The columns of this rank, or the others.
  struct Part {
    Csr columns;                   ///< Entities of each row, ascending by the order of their components' global numbers.
    std::vector<Index> offset;     ///< Components before each of them in the row.
    std::vector<Index> row_width;  ///< Components of a row, one an owned entity.
    std::vector<std::size_t> start{0};  ///< First value of each owned entity.
    AijEntries entries;            ///< The matrix by rows of components, as PETSc reads it: it is not copied.
    Mat matrix = nullptr;          ///< Borrowed.
    double* values = nullptr;      ///< While being written.
    PlaceFinder places;

    /// What has been appended to the columns of the entries are those of each of so many rows.
    void repeat_columns(int rows);
    [[nodiscard]] Slot slot(Index i, Index position) const { return {values + start[i] + offset[static_cast<std::size_t>(position)], row_width[i]}; }
    [[nodiscard]] std::span<double> row(Index i) const { return {values + start[i], start[i + 1] - start[i]}; }
  };
  /// Blocks of nodes, nearly all of them: the compiler unrolls what it knows the length of.
  template <int n>
  static void add_square(const Slot& slot, const double* block, int stride) {
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b) slot.values[a * slot.step + b] += block[a * stride + b];
  }
  [[nodiscard]] Part& part_of(Index col) { return col < owned_ ? diagonal_ : offdiagonal_; }
  void add_graph_row(Index row, std::span<const Index> graph);
  void create(const Layout& layout, std::span<const GlobalIndex> sorted_ghosts);

  int block_;
  Index owned_;
  std::vector<char> widths_;
  std::vector<Index> ghost_at_, ghost_position_;  ///< Ghosts in the ascending order of global numbers, and the place of each in it.
  Part diagonal_, offdiagonal_;        ///< Columns of the latter: positions of ghosts.
  Handle<Mat> matrix_;
};

}  // namespace polyslip::la
