// Basic types shared by all modules: indices, points and the compressed rows (CSR) that hold every incidence.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

namespace polyslip {

using Index = std::int32_t;        ///< Local number of a cell, face, node, copy or unknown on one rank.
using GlobalIndex = std::int32_t;  ///< Number over all ranks (the width of Debian's PetscInt).
using Vec3 = Eigen::Vector3d;      ///< Point or vector; in 2D the third component is 0.

/// Compressed rows: row i holds values[offsets[i] .. offsets[i+1]).
struct Csr {
  std::vector<Index> offsets{0};
  std::vector<Index> values;

  [[nodiscard]] Index rows() const { return static_cast<Index>(offsets.size()) - 1; }
  [[nodiscard]] Index row_size(Index i) const { return offsets[i + 1] - offsets[i]; }
  [[nodiscard]] std::span<const Index> operator[](Index i) const {
    return {values.data() + offsets[i], static_cast<std::size_t>(row_size(i))};
  }
  [[nodiscard]] std::span<Index> operator[](Index i) {
    return {values.data() + offsets[i], static_cast<std::size_t>(row_size(i))};
  }
  /// Appends one row.
  template <class Range>
  void push_row(const Range& row) {
    values.insert(values.end(), std::begin(row), std::end(row));
    offsets.push_back(static_cast<Index>(values.size()));
  }
};

}  // namespace polyslip
