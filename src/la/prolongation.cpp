#include "polyslip/la/prolongation.hpp"

#include <petsc/private/matimpl.h>  // operations of matrices

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "polyslip/la/aij_parts.hpp"
#include "polyslip/la/block_rows.hpp"
#include "polyslip/la/composed.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::la {

namespace {

constexpr const char* blocks_name = "polyslip prolongation";

/// A local matrix. An aggregate fills whole vectors of the processor; rows of blocks are read as such, too, but stored without gaps: what follows
/// them meets zeros, or adds to numbers that nobody reads.
template <int r, int c>
class Blocks {
 public:
  explicit Blocks(Mat matrix) : matrix_(matrix) {}

  /// z = y + P x
  void add_product(Vec x, Vec y, Vec z) {
    update();
    if (y != z) POLYSLIP_PETSC(VecCopy(y, z));
    {
      const VecRead from(x);
      for (std::size_t i = 0; i < coarse_.size(); ++i)
        coarse_[i] = i % width < c ? static_cast<float>(from[static_cast<Index>(i / width * c + i % width)]) : 0;
    }
    const VecWrite to(z);
    const float* block = values_.data();
    for (Index i = 0; i < columns_.rows(); ++i) {
      std::array<Lanes, r> sums;
      sums.fill(Lanes::Zero());
      for (const Index column : std::as_const(columns_)[i]) {
        const Lanes factors = lanes(coarse_.data() + column * width);
        for (int k = 0; k < r; ++k, block += c) sums[static_cast<std::size_t>(k)] += lanes(block) * factors;
      }
      for (int k = 0; k < r; ++k) to[i * r + k] += static_cast<double>(sums[static_cast<std::size_t>(k)].sum());
    }
  }

  /// y = P^T x
  void multiply_transposed(Vec x, Vec y) {
    update();
    std::fill(coarse_.begin(), coarse_.end(), 0.0F);
    const VecRead from(x);
    const float* block = values_.data();
    for (Index i = 0; i < columns_.rows(); ++i) {
      std::array<float, r> factors;
      for (int k = 0; k < r; ++k) factors[static_cast<std::size_t>(k)] = static_cast<float>(from[i * r + k]);
      for (const Index column : std::as_const(columns_)[i]) {
        Eigen::Map<Lanes> to(coarse_.data() + column * width);
        Lanes sum = to;
        for (int k = 0; k < r; ++k, block += c) sum += factors[static_cast<std::size_t>(k)] * lanes(block);
        to = sum;
      }
    }
    const VecWrite to(y);
    for (std::size_t i = 0; i < coarse_.size(); ++i)
      if (i % width < c) to[static_cast<Index>(i / width * c + i % width)] = static_cast<double>(coarse_[i]);
  }

 private:
  static constexpr std::size_t width = c == 3 ? 4 : 8;
  using Lanes = Eigen::Array<float, width, 1>;
  static Lanes lanes(const float* values) { return Eigen::Map<const Lanes>(values); }

  /// Takes the entries of the matrix, if they have changed.
  void update() {
    PetscObjectState state = 0;
    POLYSLIP_PETSC(PetscObjectStateGet(reinterpret_cast<PetscObject>(matrix_), &state));
    if (std::exchange(state_, state) == state) return;
    const BlockRows<r, c> rows(matrix_);
    PetscInt columns = 0;
    POLYSLIP_PETSC(MatGetSize(matrix_, nullptr, &columns));
    coarse_.assign(static_cast<std::size_t>(columns / c) * width, 0.0F);
    columns_.offsets.assign(1, 0);
    for (Index i = 0; i < rows.rows(); ++i) columns_.offsets.push_back(columns_.offsets.back() + rows.row_size(i));
    const auto blocks = static_cast<std::size_t>(columns_.offsets.back());
    columns_.values.resize(blocks);
    values_.resize(blocks * r * c + width - c);
    auto column = columns_.values.begin();
    float* value = values_.data();
    for (Index i = 0; i < rows.rows(); ++i) {
      rows.visit(i, [&](Index aggregate, const double* block, PetscInt step) {
        *column++ = aggregate;
        for (int k = 0; k < r; ++k)
          for (int l = 0; l < c; ++l) *value++ = static_cast<float>(block[k * step + l]);
      });
    }
    std::fill_n(value, width - c, 0.0F);
  }

  Mat matrix_;
  PetscObjectState state_ = -1;
  Csr columns_;                ///< Aggregates.
  UnsetVector<float> values_;  ///< Block by block, and zeros behind the last one.
  std::vector<float> coarse_;  ///< A vector of the coarser level.
};

/// What PETSc calls.
template <int r, int c>
struct Operations {
  static Blocks<r, c>& blocks_of(Mat p) { return *composed<Blocks<r, c>>(p, blocks_name); }
  static PetscErrorCode add(Mat p, Vec x, Vec y, Vec z) {
    PetscFunctionBeginUser;
    PetscCallCXX(blocks_of(p).add_product(x, y, z));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode transposed(Mat p, Vec x, Vec y) {
    PetscFunctionBeginUser;
    PetscCallCXX(blocks_of(p).multiply_transposed(x, y));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode destroy(void* blocks) {
    PetscFunctionBeginUser;
    delete static_cast<Blocks<r, c>*>(blocks);
    PetscFunctionReturn(0);
  }
};

/// Of the two matrices of a parallel one, which PETSc adds up.
template <int r, int c>
void replace_products(Mat prolongation) {
  const AijParts parts(prolongation);
  for (Mat part : {parts.own, parts.others}) {
    if (part == nullptr || part->ops->multadd == Operations<r, c>::add) continue;
    compose(part, blocks_name, std::make_unique<Blocks<r, c>>(part).release(), Operations<r, c>::destroy);
    part->ops->multadd = Operations<r, c>::add;
    part->ops->multtranspose = Operations<r, c>::transposed;
  }
}

}  // namespace

void multiply_by_blocks(Mat prolongation) {
  PetscInt r = 0, c = 0;
  POLYSLIP_PETSC(MatGetBlockSizes(prolongation, &r, &c));
  if (r == 2 && c == 3) replace_products<2, 3>(prolongation);
  if (r == 3 && c == 3) replace_products<3, 3>(prolongation);
  if (r == 3 && c == 6) replace_products<3, 6>(prolongation);
  if (r == 6 && c == 6) replace_products<6, 6>(prolongation);
}

}  // namespace polyslip::la
