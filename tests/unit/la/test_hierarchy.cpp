// What is done to the coarse operators of algebraic multigrid behind its back.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <tuple>
#include <vector>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/hierarchy_update.hpp"
#include "polyslip/la/incomplete_cholesky.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip {
namespace {

constexpr PetscInt nodes = 400, dim = 3;

/// Springs between the nodes of a line, so many on each rank, each also held a little; the last node is all but loose from the others.
la::Handle<Mat> line_of_springs(MPI_Comm comm) {
  la::Handle<Mat> matrix;
  POLYSLIP_PETSC(MatCreateAIJ(comm, nodes * dim, nodes * dim, PETSC_DETERMINE, PETSC_DETERMINE, 3, nullptr, 1, nullptr, matrix.put()));
  POLYSLIP_PETSC(MatSetBlockSize(matrix, dim));
  const PetscInt first = mpi::rank(comm) * nodes, end = mpi::size(comm) * nodes;
  for (PetscInt node = first; node < first + nodes; ++node)
    for (PetscInt c = 0; c < dim; ++c) {
      const PetscInt row = node * dim + c, next = row + dim;
      POLYSLIP_PETSC(MatSetValue(matrix, row, row, 1e-3, ADD_VALUES));
      if (node + 1 == end) continue;
      const double k = node + 2 == end ? 1e-9 : 1;
      for (const auto& [i, j, value] : {std::tuple{row, row, k}, {next, next, k}, {row, next, -k}, {next, row, -k}})
        POLYSLIP_PETSC(MatSetValue(matrix, i, j, value, ADD_VALUES));
    }
  POLYSLIP_PETSC(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
  la::Handle<Vec> coordinates;
  POLYSLIP_PETSC(MatCreateVecs(matrix, coordinates.put(), nullptr));
  POLYSLIP_PETSC(VecSetBlockSize(coordinates, dim));
  for (PetscInt node = first; node < first + nodes; ++node) POLYSLIP_PETSC(VecSetValue(coordinates, node * dim, node, INSERT_VALUES));
  POLYSLIP_PETSC(VecAssemblyBegin(coordinates));
  POLYSLIP_PETSC(VecAssemblyEnd(coordinates));
  MatNullSpace modes = nullptr;
  POLYSLIP_PETSC(MatNullSpaceCreateRigidBody(coordinates, &modes));
  POLYSLIP_PETSC(MatSetNearNullSpace(matrix, modes));
  POLYSLIP_PETSC(MatNullSpaceDestroy(&modes));
  return matrix;
}

std::vector<double> coarse_diagonal(PC pc, PetscInt level) {
  KSP smoother = nullptr;
  Mat matrix = nullptr;
  la::Handle<Vec> diagonal;
  POLYSLIP_PETSC(PCMGGetSmoother(pc, level, &smoother));
  POLYSLIP_PETSC(KSPGetOperators(smoother, nullptr, &matrix));
  POLYSLIP_PETSC(MatCreateVecs(matrix, nullptr, diagonal.put()));
  POLYSLIP_PETSC(MatGetDiagonal(matrix, diagonal));
  PetscInt n = 0;
  POLYSLIP_PETSC(VecGetLocalSize(diagonal, &n));
  const la::VecRead values(diagonal);
  return {values.data(), values.data() + n};
}

class hierarchy : public testing::Test {
 protected:
  explicit hierarchy(const std::string& prefix = "", const std::string& options = "", MPI_Comm comm = PETSC_COMM_SELF)
      : matrix_(line_of_springs(comm)) {
    POLYSLIP_PETSC(PetscOptionsInsertString(nullptr, options.c_str()));
    POLYSLIP_PETSC(KSPCreate(comm, ksp_.put()));
    POLYSLIP_PETSC(KSPSetOptionsPrefix(ksp_, prefix.c_str()));
    POLYSLIP_PETSC(KSPSetFromOptions(ksp_));
    POLYSLIP_PETSC(KSPSetOperators(ksp_, matrix_, matrix_));
    POLYSLIP_PETSC(KSPGetPC(ksp_, &pc_));
    POLYSLIP_PETSC(PCSetType(pc_, PCGAMG));
    const PetscReal threshold = 0.01;
    POLYSLIP_PETSC(PCGAMGSetThreshold(pc_, const_cast<PetscReal*>(&threshold), 1));
    POLYSLIP_PETSC(PCGAMGSetUseSAEstEig(pc_, PETSC_FALSE));
    POLYSLIP_PETSC(PCSetUp(pc_));
    POLYSLIP_PETSC(PCMGGetLevels(pc_, &levels_));
  }

  la::Handle<Mat> matrix_;
  la::Handle<KSP> ksp_;
  PC pc_ = nullptr;
  PetscInt levels_ = 0;
};

/// With smoothers whose residual is not small, though they know the factors.
struct hierarchy_of_block_icc : hierarchy {
  hierarchy_of_block_icc() : hierarchy("icc_", options()) {}
  static const char* options() {
    POLYSLIP_PETSC(la::register_block_icc());
    return "-icc_mg_levels_ksp_type richardson -icc_mg_levels_ksp_max_it 1 -icc_mg_levels_pc_type block_icc -icc_mg_levels_pc_block_icc_steps 1";
  }
  la::Handle<Vec> cycle(Vec b) {
    la::Handle<Vec> x;
    POLYSLIP_PETSC(VecDuplicate(b, x.put()));
    POLYSLIP_PETSC(PCApply(pc_, b, x));
    return x;
  }
};

TEST_F(hierarchy_of_block_icc, takes_residuals_from_smoothers) {
  ASSERT_GT(levels_, 1);
  la::Handle<Vec> b;
  POLYSLIP_PETSC(MatCreateVecs(matrix_, nullptr, b.put()));
  POLYSLIP_PETSC(VecSetRandom(b, nullptr));
  la::complete_hierarchy(pc_);
  const la::Handle<Vec> x = cycle(b);
  KSP smoother = nullptr;
  POLYSLIP_PETSC(PCMGGetSmoother(pc_, levels_ - 1, &smoother));
  POLYSLIP_PETSC(PCMGSetResidual(pc_, levels_ - 1, PCMGResidualDefault, matrix_));
  const la::Handle<Vec> exact = cycle(b);
  PetscReal difference = 0, size = 0;
  POLYSLIP_PETSC(VecNorm(exact, NORM_2, &size));
  POLYSLIP_PETSC(VecAXPY(x, -1, exact));
  POLYSLIP_PETSC(VecNorm(x, NORM_2, &difference));
  EXPECT_GT(difference, 0) << "they are in single precision";
  EXPECT_LT(difference, 1e-3 * size) << "springs are a thousand times as stiff as what holds them";
}

TEST_F(hierarchy, gives_empty_rows_of_coarse_operators_a_diagonal_and_leaves_the_others) {
  ASSERT_GT(levels_, 1);
  const std::vector<double> before = coarse_diagonal(pc_, levels_ - 2);
  ASSERT_GT(std::count(before.begin(), before.end(), 0.0), 0) << "the loose node must be an aggregate of its own";
  la::complete_hierarchy(pc_);
  const std::vector<double> after = coarse_diagonal(pc_, levels_ - 2);
  const double largest = *std::max_element(before.begin(), before.end());
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_EQ(after[i], before[i] == 0 ? largest : before[i]);
}

TEST_F(hierarchy, smooths_with_the_eigenvalues_of_the_rows_at_hand) {
  ASSERT_GT(levels_, 1);
  const PetscInt row = dim * nodes / 2;
  la::HierarchyUpdate update(matrix_, {row});
  for (PetscInt level = 1; level < levels_; ++level) {
    KSP smoother = nullptr, estimate = nullptr;
    PetscInt before = 0, after = 0;
    POLYSLIP_PETSC(PCMGGetSmoother(pc_, level, &smoother));
    POLYSLIP_PETSC(KSPChebyshevEstEigGetKSP(smoother, &estimate));
    POLYSLIP_PETSC(KSPGetTotalIterations(estimate, &before));
    POLYSLIP_PETSC(MatSetValue(matrix_, row, row, 5, ADD_VALUES));
    POLYSLIP_PETSC(MatAssemblyBegin(matrix_, MAT_FINAL_ASSEMBLY));
    POLYSLIP_PETSC(MatAssemblyEnd(matrix_, MAT_FINAL_ASSEMBLY));
    update.apply(pc_);
    POLYSLIP_PETSC(KSPGetTotalIterations(estimate, &after));
    EXPECT_GT(after, before) << "level " << level << " still has those of the set-up";
  }
}

struct hierarchy_over_all_ranks : hierarchy {
  hierarchy_over_all_ranks() : hierarchy("", "", PETSC_COMM_WORLD) {}
};

TEST_F(hierarchy_over_all_ranks, has_the_coarse_operators_of_the_rows_at_hand) {
  ASSERT_GT(levels_, 1);
  PetscInt begin = 0, total = 0;
  POLYSLIP_PETSC(MatGetOwnershipRange(matrix_, &begin, nullptr));
  POLYSLIP_PETSC(MatGetSize(matrix_, &total, nullptr));
  // The first and the last node of each rank, which a spring ties to those of other ranks.
  la::HierarchyUpdate update(matrix_, {0, 1, dim * nodes - dim, dim * nodes - dim + 1});
  for (double k : {3.0, -1.0}) {
    for (PetscInt row : {begin + dim * nodes - dim, begin + dim * nodes - dim + 1}) {
      const PetscInt next = row + dim;
      if (next >= total) continue;
      for (const auto& [i, j, value] : {std::tuple{row, row, k}, {next, next, k}, {row, next, -k}, {next, row, -k}})
        POLYSLIP_PETSC(MatSetValue(matrix_, i, j, value, ADD_VALUES));
    }
    POLYSLIP_PETSC(MatSetValue(matrix_, begin, begin, k, ADD_VALUES));
    POLYSLIP_PETSC(MatAssemblyBegin(matrix_, MAT_FINAL_ASSEMBLY));
    POLYSLIP_PETSC(MatAssemblyEnd(matrix_, MAT_FINAL_ASSEMBLY));
    update.apply(pc_);
    Mat fine = matrix_;
    for (PetscInt level = levels_ - 1; level > 0; --level) {
      Mat prolongation = nullptr, coarse = nullptr;
      KSP smoother = nullptr;
      la::Handle<Mat> difference;
      PetscReal of_difference = 0, of_coarse = 0;
      POLYSLIP_PETSC(PCMGGetInterpolation(pc_, level, &prolongation));
      POLYSLIP_PETSC(PCMGGetSmoother(pc_, level - 1, &smoother));
      POLYSLIP_PETSC(KSPGetOperators(smoother, nullptr, &coarse));
      POLYSLIP_PETSC(MatPtAP(fine, prolongation, MAT_INITIAL_MATRIX, PETSC_DEFAULT, difference.put()));
      POLYSLIP_PETSC(MatAXPY(difference, -1, coarse, DIFFERENT_NONZERO_PATTERN));
      POLYSLIP_PETSC(MatNorm(difference, NORM_FROBENIUS, &of_difference));
      POLYSLIP_PETSC(MatNorm(coarse, NORM_FROBENIUS, &of_coarse));
      EXPECT_LT(of_difference, 1e-12 * of_coarse) << "level " << level - 1 << ", k = " << k;
      fine = coarse;
    }
  }
}

/// Without a preconditioner the smoother feels a stiff spring most.
struct hierarchy_of_plain_smoothers : hierarchy {
  hierarchy_of_plain_smoothers()
      : hierarchy("few_", "-few_mg_levels_ksp_chebyshev_esteig 0,0.3,0,1.1 -few_mg_levels_pc_type none -few_ksp_type cg -few_ksp_max_it 60") {}
};

TEST_F(hierarchy_of_plain_smoothers, forgets_the_rows_that_were_in_between) {
  ASSERT_GT(levels_, 1);
  const PetscInt row = dim * nodes / 2, next = row + dim;
  la::HierarchyUpdate update(matrix_, {row, next});
  la::Handle<Vec> x, b;
  POLYSLIP_PETSC(MatCreateVecs(matrix_, x.put(), b.put()));
  POLYSLIP_PETSC(VecSetRandom(b, nullptr));
  POLYSLIP_PETSC(KSPSetReusePreconditioner(ksp_, PETSC_TRUE));
  const auto iterations = [&] {
    PetscInt n = 0;
    KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
    POLYSLIP_PETSC(KSPSolve(ksp_, b, x));
    POLYSLIP_PETSC(KSPGetConvergedReason(ksp_, &reason));
    POLYSLIP_PETSC(KSPGetIterationNumber(ksp_, &n));
    EXPECT_GT(reason, 0);
    return n;
  };
  const auto iterations_with_spring = [&](double k) {
    for (const auto& [i, j, value] : {std::tuple{row, row, k}, {next, next, k}, {row, next, -k}, {next, row, -k}})
      POLYSLIP_PETSC(MatSetValue(matrix_, i, j, value, ADD_VALUES));
    POLYSLIP_PETSC(MatAssemblyBegin(matrix_, MAT_FINAL_ASSEMBLY));
    POLYSLIP_PETSC(MatAssemblyEnd(matrix_, MAT_FINAL_ASSEMBLY));
    update.apply(pc_);
    return iterations();
  };
  const PetscInt at_set_up = iterations();
  EXPECT_EQ(iterations_with_spring(0), at_set_up);
  EXPECT_GT(iterations_with_spring(100), at_set_up);
  EXPECT_EQ(iterations_with_spring(-100), at_set_up) << "what was stiff in between must leave nothing";
}

}  // namespace
}  // namespace polyslip
