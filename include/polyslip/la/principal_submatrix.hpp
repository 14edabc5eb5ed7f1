// Some rows of a BlockOperator and the same columns, copied for a few products with vectors that stay in the cache.
#pragma once

#include <span>
#include <vector>

#include "polyslip/common/processor.hpp"
#include "polyslip/common/types.hpp"
#include "polyslip/la/block_operator.hpp"

namespace polyslip::la {

class PrincipalSubmatrix {
 public:
  /// Of these owned entities, ascending: their rows; their columns and those of all ghosts. In memory that is used again for others.
  void copy(const BlockOperator& whole, std::span<const Index> entities);

  [[nodiscard]] std::size_t rows() const { return static_cast<std::size_t>(chosen_ * block_); }
  [[nodiscard]] std::size_t columns() const { return rows() + static_cast<std::size_t>(ghosts_ * block_); }
  /// Where a component of the operator (by local number) is among the columns, of which the first ones are the rows; -1 where it is not.
  [[nodiscard]] Index column(Index component) const {
    const Index place = place_[static_cast<std::size_t>(component / block_)];
    return place < 0 ? -1 : place * block_ + component % block_;
  }
  /// y = A x for the rows (y) and the columns (x).
  void multiply(std::span<const double> x, std::span<double> y);
  [[nodiscard]] std::vector<double> diagonal() const;

 private:
  /// Calls `body` with the block size as a constant.
  template <class Body>
  void with_block(Body&& body);
  template <int b>
  void copy_blocks(const BlockOperator& whole, std::span<const Index> entities);
  void copy_entries(const BlockOperator& whole, std::span<const Index> entities);
  /// The rows times `x_`.
  template <int b>
  POLYSLIP_BY_PROCESSOR void multiply_rows(double* y);

  Index block_ = 1;                  ///< Components of a node: an entity, or one of its components where these are not as many everywhere.
  Index chosen_ = 0, ghosts_ = 0;    ///< Nodes
  std::vector<Index> place_;         ///< Of each local node among the columns, or -1.
  Csr columns_;                      ///< Places by chosen node, those of blocks that serve twice first,
  std::vector<Index> mirrored_;      ///< and how many these are;
  std::vector<Index> diagonal_;      ///< where each node has its own block.
  std::vector<double> values_;       ///< Block by block; longer than needed at times.
  std::vector<double> x_, y_;        ///< By lanes (lanes.hpp).
};

}  // namespace polyslip::la
