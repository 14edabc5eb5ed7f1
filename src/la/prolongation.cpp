#include "polyslip/la/prolongation.hpp"

#include <petsc/private/matimpl.h>  // operations of matrices

#include <Eigen/Core>
#include <algorithm>
#include <array>

#include "polyslip/la/aij_parts.hpp"
#include "polyslip/la/block_rows.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::la {

namespace {

/// z = y + P x
template <int r, int c>
void add_product(Mat p, Vec x, Vec y, Vec z) {
  using Row = Eigen::Array<double, c, 1>;
  if (y != z) POLYSLIP_PETSC(VecCopy(y, z));
  const BlockRows<r, c> rows(p);
  const VecRead from(x);
  const VecWrite to(z);
  for (Index i = 0; i < rows.rows(); ++i) {
    std::array<Row, r> sums;
    sums.fill(Row::Zero());
    rows.visit(i, [&](Index j, const double* block, PetscInt width) {
      const Row factors = Eigen::Map<const Row>(from.data() + j * c);
      for (int k = 0; k < r; ++k) sums[k] += Eigen::Map<const Row>(block + k * width) * factors;
    });
    for (int k = 0; k < r; ++k) to[i * r + k] += sums[k].sum();
  }
}

/// y = P^T x
template <int r, int c>
void multiply_transposed(Mat p, Vec x, Vec y) {
  using Row = Eigen::Array<double, c, 1>;
  POLYSLIP_PETSC(VecZeroEntries(y));
  const BlockRows<r, c> rows(p);
  const VecRead from(x);
  const VecWrite to(y);
  for (Index i = 0; i < rows.rows(); ++i) {
    std::array<double, r> factors;
    std::copy_n(from.data() + i * r, r, factors.begin());
    rows.visit(i, [&](Index j, const double* block, PetscInt width) {
      Eigen::Map<Row> sum(to.data() + j * c);
      Row added = sum;
      for (int k = 0; k < r; ++k) added += factors[k] * Eigen::Map<const Row>(block + k * width);
      sum = added;
    });
  }
}

/// What PETSc calls.
template <int r, int c>
struct Operations {
  static PetscErrorCode add(Mat p, Vec x, Vec y, Vec z) {
    PetscFunctionBeginUser;
    PetscCallCXX((add_product<r, c>(p, x, y, z)));
    PetscFunctionReturn(0);
  }
  static PetscErrorCode transposed(Mat p, Vec x, Vec y) {
    PetscFunctionBeginUser;
    PetscCallCXX((multiply_transposed<r, c>(p, x, y)));
    PetscFunctionReturn(0);
  }
};

/// Of the two matrices of a parallel one, which PETSc adds up.
template <int r, int c>
void replace_products(Mat prolongation) {
  const AijParts parts(prolongation);
  for (Mat part : {parts.own, parts.others}) {
    if (part == nullptr) continue;
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
