// Products with a matrix of blocks. They move little but the matrix: read by halves, where it is symmetric, lower blocks serve twice, as they are
// and transposed, and a product moves half of what a MATAIJ has in numbers, and an eighteenth in columns (of blocks of 3 x 3).
#pragma once

#include <functional>
#include <memory>
#include <span>

#include "polyslip/la/block_matrix.hpp"

namespace polyslip::la {

class BlockProduct {
 public:
  BlockProduct() = default;
  BlockProduct(const BlockProduct&) = delete;
  BlockProduct& operator=(const BlockProduct&) = delete;
  virtual ~BlockProduct() = default;

  /// y = A x for the components of the owned entities (y) and of the local ones (x, ghosts last), as the matrix numbers them.
  virtual void multiply(std::span<const double> x, std::span<double> y) = 0;
};

/// Copies what the matrix holds now; `by_halves` blocks between owned entities are read below the diagonal and on it alone.
std::unique_ptr<BlockProduct> block_product(const BlockMatrix& matrix, bool by_halves);

/// From now on MatMult(matrix, x, y) calls multiply(x, y), which must outlive the matrix.
void replace_product(Mat matrix, const std::function<void(Vec, Vec)>& multiply);

}  // namespace polyslip::la
