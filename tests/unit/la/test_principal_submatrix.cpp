// Rows and columns of a matrix in blocks against MatCreateSubMatrix.
#include <gtest/gtest.h>
#include <petsc/private/petscimpl.h>  // PetscObjectStateGet

#include <array>
#include <cmath>
#include <vector>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/principal_submatrix.hpp"

namespace polyslip::la {
namespace {

/// A ring of nodes of b components, each coupled with some near and some far; the last of several ranks has none.
struct principal_submatrix : testing::TestWithParam<PetscInt> {
  const PetscInt b = GetParam(), rank = mpi::rank(PETSC_COMM_WORLD), ranks = mpi::size(PETSC_COMM_WORLD);
  const PetscInt nodes = ranks > 2 && rank == ranks - 1 ? 0 : 20 + 7 * rank;
  static constexpr std::array<PetscInt, 5> steps{-9, -1, 0, 1, 6};
  Handle<Mat> matrix;

  principal_submatrix() {
    POLYSLIP_PETSC(MatCreateAIJ(PETSC_COMM_WORLD, nodes * b, nodes * b, PETSC_DETERMINE, PETSC_DETERMINE, 5 * b, nullptr, 5 * b, nullptr,
                                matrix.put()));
    POLYSLIP_PETSC(MatSetBlockSize(matrix, b));
    fill(0.3);
  }
  void fill(double seed) const {
    PetscInt begin = 0, end = 0, all = 0;
    POLYSLIP_PETSC(MatGetOwnershipRange(matrix, &begin, &end));
    POLYSLIP_PETSC(MatGetSize(matrix, &all, nullptr));
    for (PetscInt row = begin; row < end; ++row)
      for (PetscInt step : steps)
        for (PetscInt k = 0; k < b; ++k) {
          const PetscInt column = ((row / b + step) * b + k + all) % all;
          POLYSLIP_PETSC(MatSetValue(matrix, row, column, std::sin(seed + row + 0.7 * column), INSERT_VALUES));
        }
    POLYSLIP_PETSC(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
    POLYSLIP_PETSC(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
  }
  /// Of some nodes, local numbers.
  [[nodiscard]] std::vector<PetscInt> rows(PetscInt first, PetscInt step) const {
    std::vector<PetscInt> rows;
    for (PetscInt node = first; node < nodes; node += step)
      for (PetscInt k = 0; k < b; ++k) rows.push_back(node * b + k);
    return rows;
  }
  void expect_that_of_petsc(Mat found, std::vector<PetscInt> rows) const {
    PetscInt begin = 0;
    POLYSLIP_PETSC(MatGetOwnershipRange(matrix, &begin, nullptr));
    for (PetscInt& row : rows) row += begin;
    Handle<IS> chosen;
    Handle<Mat> expected;
    POLYSLIP_PETSC(ISCreateGeneral(PETSC_COMM_WORLD, static_cast<PetscInt>(rows.size()), rows.data(), PETSC_COPY_VALUES, chosen.put()));
    POLYSLIP_PETSC(MatCreateSubMatrix(matrix, chosen, chosen, MAT_INITIAL_MATRIX, expected.put()));
    Handle<Vec> x, y, z;
    POLYSLIP_PETSC(MatCreateVecs(found, x.put(), y.put()));
    POLYSLIP_PETSC(VecDuplicate(y, z.put()));
    POLYSLIP_PETSC(VecGetOwnershipRange(x, &begin, nullptr));
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const auto i = begin + static_cast<PetscInt>(k);
      POLYSLIP_PETSC(VecSetValue(x, i, std::cos(1.0 + 3.0 * i), INSERT_VALUES));
    }
    POLYSLIP_PETSC(VecAssemblyBegin(x));
    POLYSLIP_PETSC(VecAssemblyEnd(x));
    for (const bool is_product : {true, false}) {
      const auto take = [&](Mat from, Vec to) {
        if (is_product)
          POLYSLIP_PETSC(MatMult(from, x, to));
        else
          POLYSLIP_PETSC(MatGetDiagonal(from, to));
      };
      take(expected, y);
      take(found, z);
      PetscReal size = 0, difference = 0;
      POLYSLIP_PETSC(VecNorm(y, NORM_2, &size));
      POLYSLIP_PETSC(VecAXPY(z, -1, y));
      POLYSLIP_PETSC(VecNorm(z, NORM_2, &difference));
      EXPECT_GT(size, 0);
      EXPECT_LT(difference, 1e-14 * size) << is_product;
    }
  }
};

TEST_P(principal_submatrix, is_that_of_petsc_for_one_choice_after_the_other) {
  PrincipalSubmatrix submatrix(matrix);
  for (const auto& chosen : {rows(1, 2), rows(0, 1), rows(4, 5), rows(rank == 0 ? 3 : nodes, 1)}) {
    submatrix.copy(chosen);
    expect_that_of_petsc(submatrix.get(), chosen);
  }
}

TEST_P(principal_submatrix, follows_entries_when_told) {
  PrincipalSubmatrix submatrix(matrix);
  submatrix.copy(rows(1, 2));
  PetscObjectState before = 0, after = 0;
  POLYSLIP_PETSC(PetscObjectStateGet(reinterpret_cast<PetscObject>(submatrix.get()), &before));
  fill(0.9);
  submatrix.copy_again();
  POLYSLIP_PETSC(PetscObjectStateGet(reinterpret_cast<PetscObject>(submatrix.get()), &after));
  EXPECT_GT(after, before) << "solvers would keep what they have set up";
  expect_that_of_petsc(submatrix.get(), rows(1, 2));
}

INSTANTIATE_TEST_SUITE_P(blocks, principal_submatrix, testing::Values(1, 2, 3, 4));

}  // namespace
}  // namespace polyslip::la
