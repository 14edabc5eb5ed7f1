// A distributed matrix of small dense blocks over entities (node copies, faces), stored as PETSc AIJ and written in place.
//
// Entity i has w_i components. All rows of an owned entity have the same columns, so the slot of entry (row entity i, component a;
// column entity j, component b) follows from the position of j in the row of blocks: no hashing, no stash, no communication during
// assembly. Rows of ghosts are not stored. PETSc works on arrays that are held here: the Mat is not for use after this object's end.
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
    int block = 3;                        ///< Components of every entity where `widths` is empty; then also PETSc's block size.
    Index owned = 0;                      ///< Entities of this rank.
    GlobalIndex first = 0;                ///< Global number of their first component.
    std::span<const GlobalIndex> ghosts;  ///< Global number of the first component of each ghost: local entities owned, owned + 1, ...
    std::span<const char> widths = {};    ///< Components of each local entity where they differ.
  };

  /// `graph` has one row an owned entity: the local entities it couples with, itself included, in any order, no repeats.
  BlockMatrix(const Layout& layout, const Csr& graph);

  /// Adds to the block of owned entity `row` and local entity `col`; block points at entry (0, 0) of a row-major matrix with
  /// `stride` columns.
  void add(Index row, Index col, const double* block, int stride) {
    const Slot slot = locate(row, col);
    const int rows = width(row), columns = width(col);
    if (rows == 3 && columns == 3) return add_square<3>(slot, block, stride);
    if (rows == 2 && columns == 2) return add_square<2>(slot, block, stride);
    for (int a = 0; a < rows; ++a)
      for (int b = 0; b < columns; ++b) slot.values[a * slot.step + b] += block[a * stride + b];
  }

  [[nodiscard]] int width(Index entity) const { return widths_.empty() ? block_ : widths_[static_cast<std::size_t>(entity)]; }

  /// Values of all blocks of an owned row (contiguous, one row a component), in and off the diagonal part.
  [[nodiscard]] std::span<double> diagonal_row(Index row) { return diagonal_.row(row); }
  [[nodiscard]] std::span<double> offdiagonal_row(Index row) {
    if (offdiagonal_.values == nullptr) return {};
    return offdiagonal_.row(row);
  }

  /// Diagonal entries of the owned rows. MatGetDiagonal would look through these for them.
  [[nodiscard]] std::vector<double> diagonal() const;

  /// A block of a row.
  struct Block {
    Index column;          ///< Local entity.
    const double* values;  ///< Its entry (0, 0).
    Index step;            ///< From one row to the next.
  };
  /// Calls visit(row, its blocks) for the owned entities in their order; columns of this rank come first, and ascend.
  template <class Visit>
  void visit_rows(Visit&& visit) const {
    std::vector<Index> ghost_at(ghost_position_.size());
    for (Index ghost = 0; ghost < local() - owned_; ++ghost) ghost_at[static_cast<std::size_t>(ghost_position_[ghost])] = ghost;
    std::vector<Block> blocks;
    for (Index row = 0; row < owned_; ++row) {
      blocks.clear();
      for (const Part* part : {&diagonal_, &offdiagonal_}) {
        const double* values = part->entries.data() + part->start[static_cast<std::size_t>(row)];
        for (Index k = part->columns.offsets[row]; k < part->columns.offsets[row + 1]; ++k) {
          const Index column = part->columns.values[static_cast<std::size_t>(k)];
          blocks.push_back({part == &diagonal_ ? column : owned_ + ghost_at[static_cast<std::size_t>(column)],
                            values + part->offset[static_cast<std::size_t>(k)], part->row_width[static_cast<std::size_t>(row)]});
        }
      }
      visit(row, std::span<const Block>(blocks));
    }
  }

  /// Makes the values ours to write (get) and PETSc's to use (put); writes go between the two.
  void begin_writing();
  void end_writing();

  [[nodiscard]] Mat get() const { return matrix_; }
  [[nodiscard]] Index owned() const { return owned_; }
  [[nodiscard]] Index local() const { return owned_ + static_cast<Index>(ghost_position_.size()); }  ///< Entities, ghosts included.
  /// Components of every entity; 0 where they differ.
  [[nodiscard]] int common_width() const { return widths_.empty() ? block_ : 0; }

 private:
  /// The columns of this rank, or the others.
  struct Part {
    Csr columns;                   ///< Entities of each row, ascending by the order of their components' global numbers.
    std::vector<Index> offset;     ///< Components before each of them in the row.
    std::vector<Index> row_width;  ///< Components of a row, one an owned entity.
    std::vector<std::size_t> start{0};  ///< First value of each owned entity.
    std::vector<PetscInt> row_offsets{0}, row_columns;  ///< The matrix by rows of components, as PETSc reads it: it is not copied.
    std::vector<PetscScalar> entries;
    Mat matrix = nullptr;          ///< Borrowed.
    double* values = nullptr;      ///< While being written.
    Index last = -1;               ///< Position in `columns` that was found last: the next one asked for is often the one behind it.

    /// What has been appended to `row_columns` are those of each of so many rows.
    void repeat_columns(int rows);
    [[nodiscard]] std::span<double> row(Index i) const { return {values + start[i], start[i + 1] - start[i]}; }
  };
  struct Slot {
    double* values;
    Index step;  ///< From one row to the next.
  };
  /// Of the column of an owned row among all columns of a part, which has it.
  [[nodiscard]] static Index position(const Part& part, Index row, Index column);
  /// Blocks of nodes, nearly all of them: the compiler unrolls what it knows the length of.
  template <int n>
  static void add_square(const Slot& slot, const double* block, int stride) {
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b) slot.values[a * slot.step + b] += block[a * stride + b];
  }
  void add_graph_row(Index row, std::span<const Index> graph, std::span<const Index> ghost_at);
  void create(const Layout& layout, std::span<const GlobalIndex> sorted_ghosts, std::span<const Index> ghost_at);
  void hand_over(MPI_Comm comm, PetscInt rows);
  [[nodiscard]] Slot locate(Index row, Index col);

  int block_;
  Index owned_;
  std::vector<char> widths_;
  std::vector<Index> ghost_position_;  ///< Of each ghost in the ascending order of global numbers.
  Part diagonal_, offdiagonal_;        ///< Columns of the latter: positions of ghosts.
  Handle<Mat> matrix_;
};

}  // namespace polyslip::la
