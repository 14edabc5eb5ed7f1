#include "polyslip/la/block_operator.hpp"

#include <algorithm>
#include <utility>

#include "polyslip/la/lanes.hpp"

namespace polyslip::la {

BlockOperator::BlockOperator(const BlockMatrix& pattern, bool by_halves)
    : owned_(pattern.owned()), width_(pattern.common_width()), by_halves_(by_halves), first_{0} {
  for (Index i = 0; i < pattern.local(); ++i) first_.push_back(first_.back() + pattern.width(i));
  for (Index row = 0; row < owned_; ++row) {
    pattern.visit_columns(row, [&](Index col) {
      if (holds(row, col)) columns_.values.push_back(col);
    });
    const auto begin = columns_.values.begin() + columns_.offsets.back();
    std::sort(std::lower_bound(begin, columns_.values.end(), owned_), columns_.values.end());
    mirrored_.push_back(by_halves ? static_cast<Index>(std::lower_bound(begin, columns_.values.end(), row) - begin) : 0);
    columns_.offsets.push_back(static_cast<Index>(columns_.values.size()));
  }
  std::size_t size = columns_.values.size() * static_cast<std::size_t>(width_ * width_);
  if (width_ == 0)
    for (Index row = 0; row < owned_; ++row)
      for (Index col : std::as_const(columns_)[row]) {
        start_.push_back(size);
        size += static_cast<std::size_t>(width(row) * width(col));
      }
  values_.resize(size + beyond_blocks);
}

void BlockOperator::write_to(BlockMatrix& matrix) const {
  switch (width_) {
    case 2: return write_blocks<2>(matrix);
    case 3: return write_blocks<3>(matrix);
    default: return write_blocks<0>(matrix);
  }
}

/// Of b x b entries; 0 where the compiler does not know that.
template <int b>
void BlockOperator::write_blocks(BlockMatrix& matrix) const {
  std::vector<Index> next(static_cast<std::size_t>(owned_));  // place of the next block above the diagonal, in each row: they come in order
  const double* block = values_.data();
  for (Index row = 0; row < owned_; ++row) {
    const Index begin = columns_.offsets[row], mirrored = mirrored_[static_cast<std::size_t>(row)];
    next[static_cast<std::size_t>(row)] = mirrored + 1;
    for (Index k = begin; k < columns_.offsets[row + 1]; ++k) {
      const Index col = columns_.values[static_cast<std::size_t>(k)];
      const int rows = b > 0 ? b : width(row), columns = b > 0 ? b : width(col);
      const BlockMatrix::Slot slot = col < owned_ ? matrix.owned_slot(row, k - begin) : matrix.slot(row, col);
      for (int i = 0; i < rows; ++i) std::copy_n(block + i * columns, columns, slot.values + i * slot.step);
      if (k - begin < mirrored) {
        const BlockMatrix::Slot above = matrix.owned_slot(col, next[static_cast<std::size_t>(col)]++);
        for (int j = 0; j < columns; ++j)
          for (int i = 0; i < rows; ++i) above.values[j * above.step + i] = block[i * columns + j];
      }
      block += rows * columns;
    }
  }
}

void BlockOperator::multiply(std::span<const double> x, std::span<double> y) {
  switch (width_) {
    case 1: return multiply_nodes<1>(x, y);
    case 2: return multiply_nodes<2>(x, y);
    case 3: return multiply_nodes<3>(x, y);
    default: return multiply_unlike(x, y);
  }
}

template <int b>
void BlockOperator::multiply_nodes(std::span<const double> x, std::span<double> y) {
  constexpr int width = lanes_of(b);
  x_.resize(x.size() / b * width);
  y_.resize(y.size() / b * width);
  for (std::size_t i = 0; i < x.size() / b; ++i) std::copy_n(&x[i * b], b, &x_[i * width]);
  for (Index i = 0; i < owned_; ++i) multiply_row<b>(i, x_.data(), y_.data());
  for (std::size_t i = 0; i < y.size() / b; ++i) std::copy_n(&y_[i * width], b, &y[i * b]);
}

/// y_i = sum_j A_ij x_j, and to the rows above what they get from x_i.
template <int b>
void BlockOperator::multiply_row(Index i, const double* x, double* y) const {
  Sums<b> sums;
  const Lanes<b> x_i = lanes<b>(node<b>(x, i));
  Index k = columns_.offsets[i];
  const double* block = values_.data() + first_value(k);
  prefetch(block, values_.data() + first_value(columns_.offsets[i + 1]));
  for (const Index end = k + mirrored_[static_cast<std::size_t>(i)]; k < end; ++k, block += b * b) {
    const Index j = columns_.values[static_cast<std::size_t>(k)];
    sums.add(block, node<b>(x, j));
    Lanes<b> transposed = lanes<b>(block) * x_i[0];
    for (int r = 1; r < b; ++r) transposed += lanes<b>(block + r * b) * x_i[r];
    lanes<b>(node<b>(y, j)) += transposed;
  }
  for (const Index end = columns_.offsets[i + 1]; k < end; ++k, block += b * b)
    sums.add(block, node<b>(x, columns_.values[static_cast<std::size_t>(k)]));
  for (int r = 0; r < b; ++r) node<b>(y, i)[r] = sums.of_row[r].sum();
}

void BlockOperator::multiply_unlike(std::span<const double> x, std::span<double> y) const {
  for (Index row = 0; row < owned_; ++row) {
    const int rows = width(row);
    const double* x_row = &x[static_cast<std::size_t>(first_[static_cast<std::size_t>(row)])];
    double* y_row = &y[static_cast<std::size_t>(first_[static_cast<std::size_t>(row)])];
    std::fill_n(y_row, rows, 0.0);
    const Index begin = columns_.offsets[row];
    for (Index k = begin; k < columns_.offsets[row + 1]; ++k) {
      const Index col = columns_.values[static_cast<std::size_t>(k)];
      const auto first = static_cast<std::size_t>(first_[static_cast<std::size_t>(col)]);
      const int columns = width(col);
      const double* block = values_.data() + first_value(k);
      for (int a = 0; a < rows; ++a)
        for (int b = 0; b < columns; ++b) y_row[a] += block[a * columns + b] * x[first + static_cast<std::size_t>(b)];
      if (k - begin >= mirrored_[static_cast<std::size_t>(row)]) continue;
      for (int a = 0; a < rows; ++a)
        for (int b = 0; b < columns; ++b) y[first + static_cast<std::size_t>(b)] += block[a * columns + b] * x_row[a];
    }
  }
}

namespace {

constexpr const char* product_name = "polyslip product";

PetscErrorCode multiply_otherwise(Mat matrix, Vec x, Vec y) {
  PetscFunctionBeginUser;
  PetscObject object = nullptr;
  void* multiply = nullptr;
  PetscCall(PetscObjectQuery(reinterpret_cast<PetscObject>(matrix), product_name, &object));
  PetscCall(PetscContainerGetPointer(reinterpret_cast<PetscContainer>(object), &multiply));
  PetscCallCXX((*static_cast<const std::function<void(Vec, Vec)>*>(multiply))(x, y));
  PetscFunctionReturn(0);
}

}  // namespace

void replace_product(Mat matrix, const std::function<void(Vec, Vec)>& multiply) {
  PetscContainer container = nullptr;
  POLYSLIP_PETSC(PetscContainerCreate(comm_of(matrix), &container));
  POLYSLIP_PETSC(PetscContainerSetPointer(container, const_cast<std::function<void(Vec, Vec)>*>(&multiply)));  // PETSc has no pointers to const
  POLYSLIP_PETSC(PetscObjectCompose(reinterpret_cast<PetscObject>(matrix), product_name, reinterpret_cast<PetscObject>(container)));
  POLYSLIP_PETSC(PetscContainerDestroy(&container));
  POLYSLIP_PETSC(MatSetOperation(matrix, MATOP_MULT, reinterpret_cast<void (*)()>(multiply_otherwise)));
}

}  // namespace polyslip::la
