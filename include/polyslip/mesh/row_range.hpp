// Contiguous rows of tables: how a mesh is cut into slices before it has parts.
#pragma once

#include <cstdint>

#include "polyslip/common/types.hpp"

namespace polyslip::mesh {

/// A contiguous run of the rows of a table.
struct RowRange {
  Index first = 0, size = 0;
  Index total = 0;  ///< Rows of the whole table.

  /// The run number `part` of `parts` that are equal but for a row.
  static RowRange slice(Index total, Index part, Index parts) {
    const auto begin = [&](std::int64_t i) { return static_cast<Index>(i * total / parts); };
    return {.first = begin(part), .size = begin(part + 1) - begin(part), .total = total};
  }
};

}  // namespace polyslip::mesh
