// MATAIJ that consist of blocks, read by these; rows that they do not hold, where these are (lend_rows).
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "polyslip/common/types.hpp"
#include "polyslip/la/aij_parts.hpp"
#include "polyslip/la/block_operator.hpp"

namespace polyslip::la {

/// A local matrix by blocks of r x c entries.
template <int r, int c>
class BlockRows {
 public:
  explicit BlockRows(Mat matrix, const BlockOperator* lent = nullptr) : rows_(matrix), lent_(lent) {}

  [[nodiscard]] Index rows() const { return rows_.rows() / r; }
  /// Whether the blocks of row i above the diagonal are those below it, transposed.
  [[nodiscard]] bool is_mirrored(Index i) const { return is_lent(i) && lent_->by_halves(); }
  [[nodiscard]] Index row_size(Index i) const { return is_lent(i) ? lent_->own_blocks(i) : width(i) / c; }  ///< Blocks.
  /// visit(column, first entry, entries from one row to the next) for the blocks of row i.
  template <class Visit>
  void visit(Index i, Visit&& visit) const {
    if constexpr (r == c)
      if (is_lent(i)) return lent_->template visit_own<c>(i, visit);
    const PetscInt first = rows_.offsets()[i * r], entries = width(i);
    for (PetscInt k = 0; k < entries; k += c) visit(rows_.columns()[first + k] / c, rows_.values() + first + k, entries);
  }

  /// The same for the columns up to i, of square blocks.
  template <class Visit>
  void visit_lower(Index i, Visit&& visit) const {
    static_assert(r == c);
    if (is_lent(i)) return lent_->template visit_lower<c>(i, visit);
    const PetscInt first = rows_.offsets()[i * r], entries = width(i);
    for (PetscInt k = 0; k < entries && rows_.columns()[first + k] / c <= i; k += c)
      visit(rows_.columns()[first + k] / c, rows_.values() + first + k, entries);
  }

  /// Whether all entries belong to whole blocks; `global` are the numbers of columns, if they are not those of the matrix.
  [[nodiscard]] bool are_whole(const PetscInt* global) const {
    if (rows_.rows() % r != 0) return false;
    const PetscInt* offsets = rows_.offsets();
    for (PetscInt first = 0; first < rows_.rows(); first += r) {
      const std::span row(rows_.columns() + offsets[first], rows_.columns() + offsets[first + 1]);
      if (row.size() % c != 0) return false;
      for (std::size_t k = 0; k < row.size(); ++k) {
        const std::size_t start = k - k % c;
        if (row[k] != row[start] + static_cast<PetscInt>(k - start) || row[start] % c != 0) return false;
        if (global == nullptr) continue;
        if (global[row[k]] != global[row[start]] + static_cast<PetscInt>(k - start) || global[row[start]] % c != 0) return false;
      }
      for (PetscInt i = first + 1; i < first + r; ++i)
        if (!std::equal(row.begin(), row.end(), rows_.columns() + offsets[i], rows_.columns() + offsets[i + 1])) return false;
    }
    return true;
  }

 private:
  [[nodiscard]] bool is_lent(Index i) const { return lent_ != nullptr && width(i) == 0; }
  [[nodiscard]] PetscInt width(Index i) const { return rows_.offsets()[i * r + 1] - rows_.offsets()[i * r]; }

  AijRows rows_;
  const BlockOperator* lent_;
};

/// Numbers of blocks of c columns that others own.
inline std::vector<GlobalIndex> ghosts_of(const AijParts& parts, int c) {
  std::vector<GlobalIndex> ghosts;
  PetscInt n = 0;
  if (parts.others != nullptr) POLYSLIP_PETSC(MatGetSize(parts.others, nullptr, &n));
  for (PetscInt k = 0; k < n; k += c) ghosts.push_back(parts.global[k] / c);
  return ghosts;
}

}  // namespace polyslip::la
