#include "polyslip/la/block_product.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "polyslip/common/types.hpp"

namespace polyslip::la {

namespace {

/// Of nodes of b components, or of components alone (b = 1). In memory a node fills whole vectors of the processor, with zeros behind its
/// components. Rows of blocks are read as such vectors, too, but stored without gaps: what follows them meets the zeros, or adds to lanes that
/// nobody reads.
template <int b>
class ProductOf final : public BlockProduct {
 public:
  ProductOf(const BlockMatrix& matrix, bool by_halves) {
    const std::vector<Index> first = first_components(matrix);
    const Index ghosts = first[static_cast<std::size_t>(matrix.owned())];
    const auto part_of = [&](Index row, Index column) {
      if (column == row) return &diagonal_;
      if (column >= ghosts || !by_halves) return &whole_;
      return column < row ? &lower_ : nullptr;
    };
    const auto visit = [&](auto&& take, auto&& end_row) {
      matrix.visit_rows([&](Index row, std::span<const BlockMatrix::Block> blocks) {
        for (int r = 0; r < matrix.width(row); r += b) {
          const Index i = first[static_cast<std::size_t>(row)] + r;
          for (const BlockMatrix::Block& block : blocks)
            for (int c = 0; c < matrix.width(block.column); c += b) {
              const Index j = first[static_cast<std::size_t>(block.column)] + c;
              if (Part* part = part_of(i, j)) take(*part, j / b, block.values + r * block.step + c, block.step);
            }
          end_row();
        }
      });
    };
    visit([](Part& part, Index, const double*, Index) { ++part.count; }, [] {});
    for (Part* part : {&lower_, &diagonal_, &whole_}) part->allocate(static_cast<std::size_t>(ghosts / b));
    visit([](Part& part, Index column, const double* block, Index step) { part.append(column, block, step); },
          [&] {
            for (Part* part : {&lower_, &diagonal_, &whole_}) part->end_row();
          });
  }

  void multiply(std::span<const double> x, std::span<double> y) override {
    x_.resize(x.size() / b * width);
    y_.resize(y.size() / b * width);
    for (std::size_t i = 0; i < x.size() / b; ++i) std::copy_n(&x[i * b], b, &x_[i * width]);
    for (Index i = 0; i < lower_.columns.rows(); ++i) multiply_row(i);
    for (std::size_t i = 0; i < y.size() / b; ++i) std::copy_n(&y_[i * width], b, &y[i * b]);
  }

 private:
  static constexpr int width = b == 3 ? 4 : b;
  static constexpr int size = b * b;
  static constexpr int beyond = width - b;  ///< Numbers behind the last block that are read, too.
  using Lanes = Eigen::Array<double, width, 1>;

  /// Of the blocks.
  struct Part {
    Csr columns;  ///< Nodes.
    std::unique_ptr<double[]> values;
    std::size_t count = 0;

    void allocate(std::size_t rows) {
      columns.offsets.reserve(rows + 1);
      columns.values.resize(count);
      values = std::make_unique_for_overwrite<double[]>(count * size + beyond);  // written once, below: zeros before would take as long
      std::fill_n(values.get() + count * size, beyond, 0.0);
      next_value_ = values.get();
      next_column_ = columns.values.data();
    }
    void append(Index column, const double* block, Index step) {
      *next_column_++ = column;
      for (int r = 0; r < b; ++r, next_value_ += b) std::copy_n(block + r * step, b, next_value_);
    }
    void end_row() { columns.offsets.push_back(static_cast<Index>(next_column_ - columns.values.data())); }

   private:
    double* next_value_ = nullptr;
    Index* next_column_ = nullptr;
  };

  /// Of each local entity in numbers of nodes, and behind the owned ones that of the first ghost or the end.
  static std::vector<Index> first_components(const BlockMatrix& matrix) {
    std::vector<Index> first{0};
    for (Index i = 0; i < matrix.local(); ++i) first.push_back(first.back() + matrix.width(i));
    return first;
  }

  static auto lanes(const double* values) { return Eigen::Map<const Lanes>(values); }
  static auto lanes(double* values) { return Eigen::Map<Lanes>(values); }

  /// Products of the rows of blocks with vectors, summed up by lanes.
  struct Sums {
    std::array<Lanes, b> of_row;
    Sums() { of_row.fill(Lanes::Zero()); }
    void add(const double* block, const double* x) {
      const Lanes factor = lanes(x);
      for (int r = 0; r < b; ++r) of_row[r] += lanes(block + r * b) * factor;
    }
  };

  template <class Number>
  static Number* node(Number* values, Index i) {
    return values + static_cast<std::ptrdiff_t>(i) * width;
  }

  /// y_i = A_ii x_i + sum_j A_ij x_j, and to the rows above what they get from x_i.
  void multiply_row(Index i) {
    const double* const x = x_.data();
    double* const y = y_.data();
    Sums sums;
    sums.add(diagonal_.values.get() + static_cast<std::size_t>(i) * size, node(x, i));
    const Lanes x_i = lanes(node(x, i));
    const double* block = lower_.values.get() + static_cast<std::size_t>(lower_.columns.offsets[i]) * size;
    for (const Index j : std::as_const(lower_.columns)[i]) {
      sums.add(block, node(x, j));
      Lanes transposed = lanes(block) * x_i[0];
      for (int r = 1; r < b; ++r) transposed += lanes(block + r * b) * x_i[r];
      lanes(node(y, j)) += transposed;
      block += size;
    }
    block = whole_.values.get() + static_cast<std::size_t>(whole_.columns.offsets[i]) * size;
    for (const Index j : std::as_const(whole_.columns)[i]) {
      sums.add(block, node(x, j));
      block += size;
    }
    for (int r = 0; r < b; ++r) node(y, i)[r] = sums.of_row[r].sum();
  }

  Part diagonal_;
  Part lower_;  ///< Blocks that serve twice.
  Part whole_;  ///< Others beside the diagonal.
  std::vector<double> x_, y_;
};

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

std::unique_ptr<BlockProduct> block_product(const BlockMatrix& matrix, bool by_halves) {
  switch (matrix.common_width()) {
    case 2: return std::make_unique<ProductOf<2>>(matrix, by_halves);
    case 3: return std::make_unique<ProductOf<3>>(matrix, by_halves);
    default: return std::make_unique<ProductOf<1>>(matrix, by_halves);
  }
}

void replace_product(Mat matrix, const std::function<void(Vec, Vec)>& multiply) {
  PetscContainer container = nullptr;
  POLYSLIP_PETSC(PetscContainerCreate(comm_of(matrix), &container));
  POLYSLIP_PETSC(PetscContainerSetPointer(container, const_cast<std::function<void(Vec, Vec)>*>(&multiply)));  // PETSc has no pointers to const
  POLYSLIP_PETSC(PetscObjectCompose(reinterpret_cast<PetscObject>(matrix), product_name, reinterpret_cast<PetscObject>(container)));
  POLYSLIP_PETSC(PetscContainerDestroy(&container));
  POLYSLIP_PETSC(MatSetOperation(matrix, MATOP_MULT, reinterpret_cast<void (*)()>(multiply_otherwise)));
}

}  // namespace polyslip::la
