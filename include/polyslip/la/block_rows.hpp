// MATAIJ that consist of blocks, read by these.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "polyslip/common/types.hpp"
#include "polyslip/la/aij_parts.hpp"

namespace polyslip::la {

/// A local matrix by blocks of r x c entries.
template <int r, int c>
class BlockRows {
 public:
  explicit BlockRows(Mat matrix) : rows_(matrix) {}

  [[nodiscard]] Index rows() const { return rows_.rows() / r; }
  [[nodiscard]] Index blocks() const { return rows_.offsets()[rows_.rows()] / (r * c); }
  [[nodiscard]] Index row_size(Index i) const { return (rows_.offsets()[i * r + 1] - rows_.offsets()[i * r]) / c; }  ///< Blocks.
  /// visit(column, first entry, entries from one row to the next) for the blocks of row i.
  template <class Visit>
  void visit(Index i, Visit&& visit) const {
    const PetscInt first = rows_.offsets()[i * r], width = rows_.offsets()[i * r + 1] - first;
    for (PetscInt k = 0; k < width; k += c) visit(rows_.columns()[first + k] / c, rows_.values() + first + k, width);
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
  AijRows rows_;
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
