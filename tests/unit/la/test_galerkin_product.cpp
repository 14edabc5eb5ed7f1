// Galerkin products by blocks against those of PETSc.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <vector>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/aggregation_graph.hpp"
#include "polyslip/la/aij_parts.hpp"
#include "polyslip/la/galerkin_product.hpp"

namespace polyslip {
namespace {

void assemble(Mat matrix) {
  POLYSLIP_PETSC(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
}

/// Blocks of r x c entries; columns(i) tells those of row i by their numbers over all ranks.
template <class Columns>
la::Handle<Mat> blocks(PetscInt r, PetscInt c, PetscInt rows, PetscInt columns_here, Columns&& columns, double seed) {
  la::Handle<Mat> matrix;
  POLYSLIP_PETSC(MatCreateAIJ(PETSC_COMM_WORLD, rows * r, columns_here * c, PETSC_DETERMINE, PETSC_DETERMINE, 12 * c, nullptr, 12 * c, nullptr,
                              matrix.put()));
  POLYSLIP_PETSC(MatSetBlockSizes(matrix, r, c));
  PetscInt begin = 0, end = 0;
  POLYSLIP_PETSC(MatGetOwnershipRange(matrix, &begin, &end));
  for (PetscInt row = begin; row < end; ++row)
    for (PetscInt column : columns(row / r))
      for (PetscInt j = column * c; j < (column + 1) * c; ++j)
        POLYSLIP_PETSC(MatSetValue(matrix, row, j, std::sin(seed + row + 0.7 * j), INSERT_VALUES));
  assemble(matrix);
  return matrix;
}

double distance(Mat one, Mat other) {
  PetscReal size = 0, difference = 0;
  la::Handle<Mat> copy;
  POLYSLIP_PETSC(MatDuplicate(one, MAT_COPY_VALUES, copy.put()));
  POLYSLIP_PETSC(MatNorm(one, NORM_FROBENIUS, &size));
  POLYSLIP_PETSC(MatAXPY(copy, -1, other, DIFFERENT_NONZERO_PATTERN));
  POLYSLIP_PETSC(MatNorm(copy, NORM_FROBENIUS, &difference));
  return difference / size;
}

PetscInt entries(Mat matrix) {
  MatInfo info;
  POLYSLIP_PETSC(MatGetInfo(matrix, MAT_GLOBAL_SUM, &info));
  return static_cast<PetscInt>(info.nz_used);
}

la::Handle<Mat> galerkin(Mat a, Mat p) {
  la::Handle<Mat> product;
  POLYSLIP_PETSC(MatPtAP(a, p, MAT_INITIAL_MATRIX, PETSC_DEFAULT, product.put()));
  return product;
}
la::Handle<Mat> left(Mat a, Mat p) {
  la::Handle<Mat> product;
  POLYSLIP_PETSC(MatMatMult(a, p, MAT_INITIAL_MATRIX, PETSC_DEFAULT, product.put()));
  return product;
}
/// The same for a matrix of which that is said first.
template <class Product>
la::Handle<Mat> by_blocks(Product&& product, Mat a, Mat p, bool is_symmetric = false) {
  la::form_galerkin_products_by_blocks(a, is_symmetric);
  return product(a, p);
}

/// A ring of nodes, of which each is coupled with some near and some far; row 5 is empty. Aggregates of five, each node in two or three of
/// them, one of these on another rank at times, and some of their columns on a third one.
struct galerkin_product : testing::TestWithParam<std::array<PetscInt, 2>> {
  const PetscInt b = GetParam()[0], c = GetParam()[1];
  const PetscInt ranks = mpi::size(PETSC_COMM_WORLD), rank = mpi::rank(PETSC_COMM_WORLD);
  const PetscInt nodes = 35 + 10 * rank, aggregates = nodes / 5;
  const PetscInt all_nodes = 35 * ranks + 5 * ranks * (ranks - 1), all_aggregates = all_nodes / 5;

  la::Handle<Mat> a(double seed) const {
    return blocks(b, b, nodes, nodes, [&](PetscInt i) {
      std::vector<PetscInt> columns;
      if (i == 5) return columns;
      for (PetscInt step : {-13, -1, 0, 1, 8}) columns.push_back((i + step + all_nodes) % all_nodes);
      return columns;
    }, seed);
  }
  la::Handle<Mat> symmetric(double seed) const {
    la::Handle<Mat> sum = a(seed), transposed;
    POLYSLIP_PETSC(MatTranspose(sum, MAT_INITIAL_MATRIX, transposed.put()));
    POLYSLIP_PETSC(MatAXPY(sum, 1, transposed, DIFFERENT_NONZERO_PATTERN));
    return sum;
  }
  la::Handle<Mat> p(double seed) const {
    return blocks(b, c, nodes, aggregates, [&](PetscInt i) {
      std::vector<PetscInt> columns{i / 5, (i / 5 + 1) % all_aggregates};
      if (i % 4 == 0) columns.push_back((i / 5 + all_aggregates - 3) % all_aggregates);
      return columns;
    }, seed);
  }
};

TEST_P(galerkin_product, is_that_of_petsc) {
  const la::Handle<Mat> prolongation = p(0.1);
  const la::Handle<Mat> expected = galerkin(a(0.3), prolongation), product = by_blocks(galerkin, a(0.3), prolongation);
  EXPECT_FALSE(la::forms_galerkin_products_by_blocks(expected));
  ASSERT_TRUE(la::forms_galerkin_products_by_blocks(product)) << "for the next level";
  EXPECT_LT(distance(expected, product), 1e-14);
  EXPECT_EQ(entries(product), entries(expected));
  PetscInt block = 0;
  POLYSLIP_PETSC(MatGetBlockSize(product, &block));
  EXPECT_EQ(block, c);
}

TEST_P(galerkin_product, of_a_symmetric_matrix_is_that_of_petsc_and_reads_nothing_above_its_diagonal) {
  const la::Handle<Mat> prolongation = p(0.1), plain = symmetric(0.3), matrix = symmetric(0.3);
  const la::Handle<Mat> expected = galerkin(plain, prolongation), product = by_blocks(galerkin, matrix, prolongation, true);
  EXPECT_TRUE(la::forms_symmetric_products(product)) << "for the next level";
  EXPECT_LT(distance(expected, product), 1e-14);
  EXPECT_EQ(entries(product), entries(expected));
  PetscInt begin = 0, end = 0;
  POLYSLIP_PETSC(MatGetOwnershipRange(matrix, &begin, &end));
  for (PetscInt row = begin; row + b < end; row += b)  // of the next node
    if (row / b % all_nodes != 4 && row / b % all_nodes != 5) POLYSLIP_PETSC(MatSetValue(matrix, row, row + b, 1e9, INSERT_VALUES));
  assemble(matrix);
  Mat reused = product;
  POLYSLIP_PETSC(MatPtAP(matrix, prolongation, MAT_REUSE_MATRIX, PETSC_DEFAULT, &reused));
  EXPECT_LT(distance(expected, product), 1e-14);
}

TEST_P(galerkin_product, follows_new_entries_of_both_factors) {
  const la::Handle<Mat> plain = a(0.9), matrix = a(0.3), prolongation = p(0.1), later = p(0.7);
  const la::Handle<Mat> product = by_blocks(galerkin, matrix, prolongation);
  POLYSLIP_PETSC(MatCopy(plain, matrix, SAME_NONZERO_PATTERN));
  POLYSLIP_PETSC(MatCopy(later, prolongation, SAME_NONZERO_PATTERN));
  Mat reused = product;
  POLYSLIP_PETSC(MatPtAP(matrix, prolongation, MAT_REUSE_MATRIX, PETSC_DEFAULT, &reused));
  EXPECT_LT(distance(galerkin(plain, prolongation), product), 1e-14);
}

/// Sums of a few dozen products of these are exact in single precision.
double few_bits(double value) { return std::round(64 * value) / 64; }

void round_entries(Mat matrix) {
  const la::AijParts parts(matrix);
  for (Mat part : {parts.own, parts.others}) {
    if (part == nullptr) continue;
    const la::AijRows rows(part);
    const la::AijValues values(part);
    for (PetscInt k = 0; k < rows.offsets()[rows.rows()]; ++k) values.data()[k] = few_bits(values.data()[k]);
  }
  assemble(matrix);
}

TEST_P(galerkin_product, leaves_a_prolongation_that_is_multiplied_by_blocks) {
  const la::Handle<Mat> prolongation = p(0.1);
  round_entries(prolongation);
  la::Handle<Mat> plain;
  POLYSLIP_PETSC(MatDuplicate(prolongation, MAT_COPY_VALUES, plain.put()));
  by_blocks(galerkin, a(0.3), prolongation);
  la::Handle<Vec> coarse, fine;
  POLYSLIP_PETSC(MatCreateVecs(plain, coarse.put(), fine.put()));
  const auto fill = [](Vec x, double seed) {
    PetscInt begin = 0, end = 0;
    POLYSLIP_PETSC(VecGetOwnershipRange(x, &begin, &end));
    for (PetscInt i = begin; i < end; ++i) POLYSLIP_PETSC(VecSetValue(x, i, few_bits(std::sin(seed + 2.3 * i)), INSERT_VALUES));
    POLYSLIP_PETSC(VecAssemblyBegin(x));
    POLYSLIP_PETSC(VecAssemblyEnd(x));
  };
  const auto product = [&](Mat matrix, int kind) {
    la::Handle<Vec> result;
    fill(coarse, 0.2);
    fill(fine, 0.5);
    if (kind == 0) {  // into a vector of its own, and in place
      POLYSLIP_PETSC(VecDuplicate(fine, result.put()));
      POLYSLIP_PETSC(MatMultAdd(matrix, coarse, fine, result));
    } else if (kind == 1) {
      POLYSLIP_PETSC(VecDuplicate(fine, result.put()));
      POLYSLIP_PETSC(VecCopy(fine, result));
      POLYSLIP_PETSC(MatMultAdd(matrix, coarse, result, result));
    } else {
      POLYSLIP_PETSC(VecDuplicate(coarse, result.put()));
      POLYSLIP_PETSC(VecSet(result, 1e9));
      POLYSLIP_PETSC(MatMultTranspose(matrix, fine, result));
    }
    return result;
  };
  for (bool later : {false, true}) {  // it follows new entries
    for (Mat matrix : {plain.get(), prolongation.get()})
      if (later) POLYSLIP_PETSC(MatScale(matrix, -0.5));
    for (int kind = 0; kind < 3; ++kind) {
      const la::Handle<Vec> expected = product(plain, kind), found = product(prolongation, kind);
      PetscReal size = 0, difference = 0;
      POLYSLIP_PETSC(VecNorm(expected, NORM_2, &size));
      POLYSLIP_PETSC(VecAXPY(found, -1, expected));
      POLYSLIP_PETSC(VecNorm(found, NORM_2, &difference));
      EXPECT_LT(difference, 1e-14 * size) << kind << " " << later;
    }
  }
}

TEST_P(galerkin_product, of_the_left_factor_alone_is_that_of_petsc) {
  const la::Handle<Mat> prolongation = p(0.1);
  const la::Handle<Mat> expected = left(a(0.3), prolongation), product = by_blocks(left, a(0.3), prolongation);
  EXPECT_LT(distance(expected, product), 1e-14);
  EXPECT_EQ(entries(product), entries(expected));
}

TEST_P(galerkin_product, of_the_left_factor_alone_takes_up_a_subset) {
  const la::Handle<Mat> prolongation = p(0.1);
  const la::Handle<Mat> few = blocks(b, c, nodes, aggregates, [&](PetscInt i) {
    return i == 5 ? std::vector<PetscInt>() : std::vector<PetscInt>{(i / 5 + 1) % all_aggregates};
  }, 0.7);
  const la::Handle<Mat> expected = left(a(0.3), prolongation), product = by_blocks(left, a(0.3), prolongation);
  for (Mat sum : {expected.get(), product.get()}) POLYSLIP_PETSC(MatAXPY(sum, -0.4, few, SUBSET_NONZERO_PATTERN));
  EXPECT_LT(distance(expected, product), 1e-14);
  for (Mat sum : {expected.get(), product.get()}) POLYSLIP_PETSC(MatAXPY(sum, 0.3, prolongation, DIFFERENT_NONZERO_PATTERN));
  EXPECT_LT(distance(expected, product), 1e-14);
}

TEST_P(galerkin_product, is_left_to_petsc_where_a_block_is_not_whole) {
  const auto add_entry = [&](Mat matrix) { POLYSLIP_PETSC(MatSetValue(matrix, 0, 20 * b + 1, 1, INSERT_VALUES)); };
  const auto add_rows = [&](Mat matrix) {  // the first of a node in a column of blocks, the others in the next one
    for (PetscInt row = 0; row < b; ++row)
      for (PetscInt k = 0; k < b; ++k) POLYSLIP_PETSC(MatSetValue(matrix, row, (row == 0 ? 20 : 21) * b + k, 1, INSERT_VALUES));
  };
  for (const std::function<void(Mat)>& spoil : {std::function<void(Mat)>(add_entry), std::function<void(Mat)>(add_rows)}) {
    const la::Handle<Mat> plain = a(0.3), matrix = a(0.3), prolongation = p(0.1);
    for (Mat both : {plain.get(), matrix.get()}) {
      POLYSLIP_PETSC(MatSetOption(both, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
      if (rank == 0) spoil(both);
      assemble(both);
    }
    const la::Handle<Mat> expected = galerkin(plain, prolongation), product = by_blocks(galerkin, matrix, prolongation);
    EXPECT_FALSE(la::forms_galerkin_products_by_blocks(product));
    EXPECT_EQ(distance(expected, product), 0);
  }
}

TEST_P(galerkin_product, is_left_to_petsc_by_option) {
  POLYSLIP_PETSC(PetscOptionsSetValue(nullptr, "-galerkin_by_blocks", "false"));
  const la::Handle<Mat> product = by_blocks(galerkin, a(0.3), p(0.1));
  POLYSLIP_PETSC(PetscOptionsClearValue(nullptr, "-galerkin_by_blocks"));
  EXPECT_FALSE(la::forms_galerkin_products_by_blocks(product));
}

TEST_P(galerkin_product, begins_with_the_graph_of_petsc) {
  const la::Handle<Mat> symmetric = this->symmetric(0.3);
  for (const PetscBool scaled : {PETSC_FALSE, PETSC_TRUE})
    for (const double threshold : {-1.0, 0.8}) {
      la::Handle<Mat> matrix, expected, graph;
      POLYSLIP_PETSC(MatDuplicate(symmetric, MAT_COPY_VALUES, matrix.put()));
      la::form_graphs_by_blocks(matrix);
      POLYSLIP_PETSC(MatCreateGraph(symmetric, PETSC_FALSE, scaled, threshold, expected.put()));
      POLYSLIP_PETSC(MatCreateGraph(matrix, PETSC_FALSE, scaled, threshold, graph.put()));
      EXPECT_LT(distance(expected, graph), 1e-15);
      EXPECT_EQ(entries(graph), entries(expected)) << scaled << " " << threshold;
      const bool leaves_out = scaled == PETSC_TRUE && threshold >= 0;
      EXPECT_TRUE(!leaves_out || entries(graph) < entries(symmetric) / (b * b));
    }
}

INSTANTIATE_TEST_SUITE_P(blocks, galerkin_product, testing::Values(std::array<PetscInt, 2>{2, 3}, std::array<PetscInt, 2>{3, 3},
                                                                   std::array<PetscInt, 2>{3, 6}, std::array<PetscInt, 2>{6, 6}));

}  // namespace
}  // namespace polyslip
