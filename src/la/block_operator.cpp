#include "polyslip/la/block_operator.hpp"

#include <algorithm>
#include <utility>

#include "polyslip/la/lanes.hpp"

namespace polyslip::la {

BlockOperator::BlockOperator(const BlockMatrix::Layout& layout, const Csr& graph, bool by_halves)
    : owned_(layout.owned), width_(layout.widths.empty() ? layout.block : 0), by_halves_(by_halves), first_{0} {
  const auto local = static_cast<std::size_t>(owned_) + layout.ghosts.size();
  for (std::size_t i = 0; i < local; ++i) first_.push_back(first_.back() + (width_ > 0 ? width_ : layout.widths[i]));
  const std::size_t most = graph.values.size();
  for (std::vector<Index>* entries : {&columns_.values, &above_.values, &block_above_}) entries->reserve(by_halves ? most / 2 : most);
  std::vector<Index> next_above;
  next_above.reserve(static_cast<std::size_t>(owned_));
  for (Index row = 0; row < owned_; ++row) add_graph_row(row, graph[row], next_above);
  std::size_t size = columns_.values.size() * static_cast<std::size_t>(width_ * width_);
  if (width_ == 0)
    for (Index row = 0; row < owned_; ++row)
      for (Index col : std::as_const(columns_)[row]) {
        start_.push_back(size);
        size += static_cast<std::size_t>(width(row) * width(col));
      }
  values_.resize(size + beyond_blocks);
}

/// Rows come in order, and each tells those above which of its blocks are theirs. `next_above`: the next place for that, of each row.
void BlockOperator::add_graph_row(Index row, std::span<const Index> graph, std::vector<Index>& next_above) {
  const auto begin = static_cast<std::ptrdiff_t>(columns_.values.size());
  Index above = 0, ghosts = 0, mirrored = 0;
  for (Index col : graph) {
    above += by_halves_ && col > row && col < owned_ ? 1 : 0;
    ghosts += col >= owned_ ? 1 : 0;
    if (holds(row, col)) columns_.values.push_back(col);
  }
  std::sort(columns_.values.begin() + begin, columns_.values.end());
  columns_.offsets.push_back(static_cast<Index>(columns_.values.size()));
  above_.offsets.push_back(above_.offsets.back() + above);
  above_.values.resize(static_cast<std::size_t>(above_.offsets.back()));
  block_above_.resize(above_.values.size());
  next_above.push_back(above_.offsets[row]);
  if (by_halves_)
    for (auto k = static_cast<std::size_t>(begin); columns_.values[k] < row; ++k, ++mirrored) {
      const auto place = static_cast<std::size_t>(next_above[static_cast<std::size_t>(columns_.values[k])]++);
      above_.values[place] = row;
      block_above_[place] = static_cast<Index>(k);
    }
  mirrored_.push_back(mirrored);
  ghosts_.push_back(ghosts);
}

Csr BlockOperator::graph() const {
  Csr graph;
  std::vector<Index> row;
  for (Index i = 0; i < owned_; ++i) {
    row.clear();
    visit_columns(i, [&](Index col) { row.push_back(col); });
    graph.push_row(row);
  }
  return graph;
}

std::vector<double> BlockOperator::diagonal() const {
  std::vector<double> entries;
  entries.reserve(static_cast<std::size_t>(first_[static_cast<std::size_t>(owned_)]));
  for (Index i = 0; i < owned_; ++i) {
    const Index below = mirrored_[static_cast<std::size_t>(i)];
    const double* entry = block(by_halves_ ? columns_.offsets[i] + below : PlaceFinder::search(columns_, i, i));
    for (int a = 0; a < width(i); ++a, entry += width(i) + 1) entries.push_back(*entry);
  }
  return entries;
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
  const auto write = [](const double* values, int rows, int columns, const BlockMatrix::Slot& slot) {
    for (int i = 0; i < rows; ++i) std::copy_n(values + i * columns, columns, slot.values + i * slot.step);
  };
  for (Index row = 0; row < owned_; ++row) {
    const int rows = b > 0 ? b : width(row);
    Index k = 0;
    if (matrix.has_own(row))
      visit_own<b>(row, [&](Index, const double* values, int columns) { write(values, rows, columns, matrix.owned_slot(row, k++)); });
    visit_ghosts(row, [&](Index ghost, const double* values, int columns) { write(values, rows, columns, matrix.slot(row, ghost)); });
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
  for (std::size_t i = 0; i < x.size() / b; ++i) copy_numbers<b>(&x[i * b], &x_[i * width]);
  for (Index i = 0; i < owned_; ++i) multiply_row<b>(i, x_.data(), y_.data());
  for (std::size_t i = 0; i < y.size() / b; ++i) copy_numbers<b>(&y_[i * width], &y[i * b]);
}

std::vector<Index> BlockOperator::rows_near(std::span<const Index> entities) const {
  std::vector<char> is_near(first_.size(), 0);
  for (Index i : entities) visit_columns(i, [&](Index j) { is_near[static_cast<std::size_t>(j)] = 1; });
  std::vector<Index> rows;
  for (Index i = 0; i < owned_; ++i)
    if (is_near[static_cast<std::size_t>(i)] != 0 || ghosts_[static_cast<std::size_t>(i)] > 0) rows.push_back(i);
  return rows;
}

void BlockOperator::multiply_rows(std::span<const Index> rows, std::span<const double> x, std::span<double> y) {
  switch (width_) {
    case 2: return multiply_some_nodes<2>(rows, x, y);
    case 3: return multiply_some_nodes<3>(rows, x, y);
    default: return multiply(x, y);
  }
}

template <int b>
void BlockOperator::multiply_some_nodes(std::span<const Index> rows, std::span<const double> x, std::span<double> y) {
  constexpr int width = lanes_of(b);
  x_.assign(x.size() / b * width, 0.0);
  y_.resize(y.size() / b * width);
  const auto take = [&](std::size_t i) { copy_numbers<b>(&x[i * b], &x_[i * width]); };
  for (Index i : rows) take(static_cast<std::size_t>(i));
  for (auto ghost = static_cast<std::size_t>(owned_); ghost < x.size() / b; ++ghost) take(ghost);
  for (Index i : rows) multiply_row<b>(i, x_.data(), y_.data());
  for (Index i : rows) copy_numbers<b>(node<b>(y_.data(), i), &y[static_cast<std::size_t>(i) * b]);
}

template <int b>
inline void BlockOperator::multiply_row(Index i, const double* x, double* y) const {
  la::multiply_row<b>(i, columns_[i], mirrored_[static_cast<std::size_t>(i)], block(columns_.offsets[i]), x, y);
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

constexpr const char* operations_name = "polyslip operations";

const MatrixOperations& operations_of(Mat matrix) { return *composed<const MatrixOperations>(matrix, operations_name); }

PetscErrorCode multiply_otherwise(Mat matrix, Vec x, Vec y) {
  PetscFunctionBeginUser;
  PetscCallCXX(operations_of(matrix).multiply(x, y));
  PetscFunctionReturn(0);
}

/// z = y + A x
PetscErrorCode add_otherwise(Mat matrix, Vec x, Vec y, Vec z) {
  PetscFunctionBeginUser;
  PetscCallCXX({
    const MatrixOperations& operations = operations_of(matrix);
    if (operations.product == nullptr) POLYSLIP_PETSC(VecDuplicate(z, operations.product.put()));
    operations.multiply(x, operations.product);
    if (y != z) POLYSLIP_PETSC(VecCopy(y, z));
    POLYSLIP_PETSC(VecAXPY(z, 1, operations.product));
  });
  PetscFunctionReturn(0);
}

PetscErrorCode diagonal_otherwise(Mat matrix, Vec y) {
  PetscFunctionBeginUser;
  PetscCallCXX(operations_of(matrix).diagonal(y));
  PetscFunctionReturn(0);
}

}  // namespace

void replace_operations(Mat matrix, const MatrixOperations& operations) {
  compose(matrix, operations_name, &operations);
  POLYSLIP_PETSC(MatSetOperation(matrix, MATOP_MULT, reinterpret_cast<void (*)()>(multiply_otherwise)));
  POLYSLIP_PETSC(MatSetOperation(matrix, MATOP_MULT_ADD, reinterpret_cast<void (*)()>(add_otherwise)));
  POLYSLIP_PETSC(MatSetOperation(matrix, MATOP_GET_DIAGONAL, reinterpret_cast<void (*)()>(diagonal_otherwise)));
}

void lend_rows(Mat matrix, const BlockOperator& rows) { compose(matrix, lent_rows, &rows); }

}  // namespace polyslip::la
