// Incomplete Cholesky by blocks of one node, across the borders of ranks.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <tuple>
#include <vector>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/incomplete_cholesky.hpp"

namespace polyslip {
namespace {

/// A matrix of nodes with `block` components, empty but for its layout: the nodes of each rank one after the other.
la::Handle<Mat> matrix_of(PetscInt nodes, PetscInt block, PetscInt row_width) {
  la::Handle<Mat> matrix;
  POLYSLIP_PETSC(MatCreateAIJ(PETSC_COMM_WORLD, nodes * block, nodes * block, PETSC_DETERMINE, PETSC_DETERMINE, row_width, nullptr, row_width,
                              nullptr, matrix.put()));
  POLYSLIP_PETSC(MatSetBlockSize(matrix, block));
  return matrix;
}

void assemble(Mat matrix) {
  POLYSLIP_PETSC(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
}

/// A spring between two nodes, stiffer along some direction of its own.
void add_spring(Mat matrix, PetscInt block, PetscInt i, PetscInt j, double stiffness) {
  Eigen::VectorXd along(block);
  for (PetscInt c = 0; c < block; ++c) along[c] = std::sin(1.0 + static_cast<double>(c * (j - i)));
  const Eigen::MatrixXd k = stiffness * (along * along.transpose() + 0.3 * Eigen::MatrixXd::Identity(block, block));
  for (PetscInt r = 0; r < block; ++r)
    for (PetscInt c = 0; c < block; ++c)
      for (const auto& [row, column, sign] : {std::tuple{i, i, 1}, {j, j, 1}, {i, j, -1}, {j, i, -1}})
        POLYSLIP_PETSC(MatSetValue(matrix, row * block + r, column * block + c, sign * k(r, c), ADD_VALUES));
}

void hold(Mat matrix, PetscInt block, PetscInt node, double stiffness) {
  for (PetscInt c = 0; c < block; ++c) POLYSLIP_PETSC(MatSetValue(matrix, node * block + c, node * block + c, stiffness, ADD_VALUES));
}

/// A grid of 6 x 6 x n nodes with springs to the 26 around each, n in proportion to the ranks and the last nodes on the last one.
la::Handle<Mat> grid(PetscInt block, double held, PetscInt layers = 5) {
  const PetscInt side = 6, ranks = mpi::size(PETSC_COMM_WORLD), rank = mpi::rank(PETSC_COMM_WORLD);
  la::Handle<Mat> matrix = matrix_of(side * side * layers, block, 27 * block);
  const auto node = [&](PetscInt x, PetscInt y, PetscInt z) { return x + side * (y + side * z); };
  for (PetscInt z = rank * layers; z < (rank + 1) * layers; ++z)
    for (PetscInt y = 0; y < side; ++y)
      for (PetscInt x = 0; x < side; ++x) {
        hold(matrix, block, node(x, y, z), held);
        for (PetscInt dz = -1; dz <= 1; ++dz)
          for (PetscInt dy = -1; dy <= 1; ++dy)
            for (PetscInt dx = -1; dx <= 1; ++dx) {
              const bool is_inside = x + dx >= 0 && x + dx < side && y + dy >= 0 && y + dy < side && z + dz >= 0 && z + dz < ranks * layers;
              const PetscInt i = node(x, y, z), j = node(x + dx, y + dy, z + dz);
              if (is_inside && j > i) add_spring(matrix, block, i, j, 1.0 + 0.5 * std::cos(static_cast<double>(i)));
            }
      }
  assemble(matrix);
  return matrix;
}

/// Adds a node's part of (I + L) D (I + L)^T, with entries of L and D that few bits hold.
void add_eliminated(Mat matrix, PetscInt block, PetscInt node, const std::vector<PetscInt>& later) {
  const auto l = [&](PetscInt i) {
    Eigen::MatrixXd entries = Eigen::MatrixXd::Identity(block, block);
    for (PetscInt r = 0; i != node && r < block; ++r)
      for (PetscInt c = 0; c < block; ++c) entries(r, c) = static_cast<double>((3 * r + 5 * c + i - node) % 7 - 3) / 8;
    return entries;
  };
  const double d = node % 2 == 0 ? 4 : 16;
  std::vector<PetscInt> all = later;
  all.push_back(node);
  for (PetscInt i : all)
    for (PetscInt j : all) {
      const Eigen::MatrixXd entries = d * l(i) * l(j).transpose();
      for (PetscInt r = 0; r < block; ++r)
        for (PetscInt c = 0; c < block; ++c) POLYSLIP_PETSC(MatSetValue(matrix, i * block + r, j * block + c, entries(r, c), ADD_VALUES));
    }
}

/// Each rank has a chain, and behind it two nodes that it shares with the ranks before and after it, all four tied to one another. Up to three
/// ranks eliminate this without fill, those of even numbers first, and no rounding: half precision holds the factors.
la::Handle<Mat> chains(PetscInt block) {
  const PetscInt nodes = 8, ranks = mpi::size(PETSC_COMM_WORLD), rank = mpi::rank(PETSC_COMM_WORLD), first = rank * nodes;
  la::Handle<Mat> matrix = matrix_of(nodes, block, nodes * block);
  for (PetscInt i = first; i < first + nodes; ++i) {
    std::vector<PetscInt> later;
    if (i + 1 < first + nodes) later.push_back(i + 1);
    for (PetscInt other : {rank - 1, rank + 1})
      if (rank % 2 == 0 && i >= first + nodes - 2 && other >= 0 && other < ranks)
        for (PetscInt j : {6, 7}) later.push_back(other * nodes + j);
    add_eliminated(matrix, block, i, later);
  }
  assemble(matrix);
  return matrix;
}

/// A chain on each rank. The first two are joined, where one ends and the other begins, and eliminate this without fill if both do so towards
/// where they meet.
la::Handle<Mat> chains_that_meet(PetscInt block) {
  const PetscInt nodes = 8, rank = mpi::rank(PETSC_COMM_WORLD), first = rank * nodes, last = first + nodes - 1;
  la::Handle<Mat> matrix = matrix_of(nodes, block, nodes * block);
  for (PetscInt i = first; i <= last; ++i) {
    std::vector<PetscInt> later;
    if (rank == 1 ? i > first : i < last) later.push_back(rank == 1 ? i - 1 : i + 1);
    if (rank == 0 && i == last && mpi::size(PETSC_COMM_WORLD) > 1) later.push_back(i + 1);
    add_eliminated(matrix, block, i, later);
  }
  assemble(matrix);
  return matrix;
}

la::Handle<PC> preconditioner(Mat matrix, const char* type, const char* prefix = "", const char* options = "") {
  POLYSLIP_PETSC(la::register_block_icc());
  la::Handle<PC> pc;
  POLYSLIP_PETSC(PCCreate(PETSC_COMM_WORLD, pc.put()));
  POLYSLIP_PETSC(PCSetOperators(pc, matrix, matrix));
  POLYSLIP_PETSC(PCSetType(pc, type));
  POLYSLIP_PETSC(PetscOptionsInsertString(nullptr, options));
  POLYSLIP_PETSC(PCSetOptionsPrefix(pc, prefix));
  POLYSLIP_PETSC(PCSetFromOptions(pc));
  POLYSLIP_PETSC(PCSetUp(pc));
  return pc;
}

la::Handle<Vec> noise(Mat matrix, int seed) {
  la::Handle<Vec> x;
  POLYSLIP_PETSC(MatCreateVecs(matrix, x.put(), nullptr));
  PetscInt begin = 0, end = 0;
  POLYSLIP_PETSC(VecGetOwnershipRange(x, &begin, &end));
  for (PetscInt i = begin; i < end; ++i) POLYSLIP_PETSC(VecSetValue(x, i, std::sin(static_cast<double>((i + 1) * (seed + 1))), INSERT_VALUES));
  POLYSLIP_PETSC(VecAssemblyBegin(x));
  POLYSLIP_PETSC(VecAssemblyEnd(x));
  return x;
}

la::Handle<Vec> applied(PC pc, Vec b) {
  la::Handle<Vec> x;
  POLYSLIP_PETSC(VecDuplicate(b, x.put()));
  POLYSLIP_PETSC(PCApply(pc, b, x));
  return x;
}

double dot(Vec a, Vec b) {
  PetscScalar value = 0;
  POLYSLIP_PETSC(VecDot(a, b, &value));
  return value;
}

/// |a - b| / |b|
double difference(Vec a, Vec b) {
  la::Handle<Vec> d;
  PetscReal of_difference = 0, of_b = 0;
  POLYSLIP_PETSC(VecDuplicate(a, d.put()));
  POLYSLIP_PETSC(VecWAXPY(d, -1.0, a, b));
  POLYSLIP_PETSC(VecNorm(d, NORM_2, &of_difference));
  POLYSLIP_PETSC(VecNorm(b, NORM_2, &of_b));
  return of_difference / of_b;
}

/// Iterations of conjugate gradients to 1e-8.
PetscInt iterations(Mat matrix, const char* type, const char* options) {
  POLYSLIP_PETSC(la::register_block_icc());
  POLYSLIP_PETSC(PetscOptionsInsertString(nullptr, options));
  la::Handle<KSP> ksp;
  PC pc = nullptr;
  PetscInt n = 0;
  POLYSLIP_PETSC(KSPCreate(PETSC_COMM_WORLD, ksp.put()));
  POLYSLIP_PETSC(KSPSetOperators(ksp, matrix, matrix));
  POLYSLIP_PETSC(KSPSetType(ksp, KSPCG));
  POLYSLIP_PETSC(KSPSetTolerances(ksp, 1e-8, 0, PETSC_DEFAULT, 1000));
  POLYSLIP_PETSC(KSPGetPC(ksp, &pc));
  POLYSLIP_PETSC(PCSetType(pc, type));
  POLYSLIP_PETSC(KSPSetFromOptions(ksp));
  const la::Handle<Vec> b = noise(matrix, 1), x = noise(matrix, 2);
  POLYSLIP_PETSC(KSPSolve(ksp, b, x));
  KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
  POLYSLIP_PETSC(KSPGetConvergedReason(ksp, &reason));
  EXPECT_GT(reason, 0) << type;
  POLYSLIP_PETSC(KSPGetIterationNumber(ksp, &n));
  return n;
}

/// On each rank the matrix of Kershaw (J. Comput. Phys. 26, 1978), which is positive definite while its factorisation without fill is not,
/// and an empty row.
la::Handle<Mat> kershaw() {
  la::Handle<Mat> matrix = matrix_of(5, 1, 5);
  const PetscInt first = 5 * mpi::rank(PETSC_COMM_WORLD);
  const double values[4][4] = {{3, -2, 0, 2}, {-2, 3, -2, 0}, {0, -2, 3, -2}, {2, 0, -2, 3}};
  for (PetscInt i = 0; i < 4; ++i)
    for (PetscInt j = 0; j < 4; ++j)
      if (values[i][j] != 0) POLYSLIP_PETSC(MatSetValue(matrix, first + i, first + j, values[i][j], INSERT_VALUES));
  POLYSLIP_PETSC(MatSetValue(matrix, first + 4, first + 4, 0, INSERT_VALUES));
  assemble(matrix);
  return matrix;
}

struct block_icc_of_nodes : testing::TestWithParam<PetscInt> {};

TEST_P(block_icc_of_nodes, solves_exactly_where_nothing_is_filled_in_whatever_ranks_the_rows_are_on) {
  for (const la::Handle<Mat>& matrix : {chains(GetParam()), chains_that_meet(GetParam())}) {
    const la::Handle<PC> pc = preconditioner(matrix, la::block_icc);
    const la::Handle<Vec> exact = noise(matrix, 0);
    la::Handle<Vec> b;
    POLYSLIP_PETSC(VecDuplicate(exact, b.put()));
    POLYSLIP_PETSC(MatMult(matrix, exact, b));
    EXPECT_LT(difference(applied(pc, b), exact), 1e-6);
  }
}

TEST_P(block_icc_of_nodes, is_symmetric_and_positive_on_any_number_of_ranks) {
  const la::Handle<Mat> matrix = grid(GetParam(), 1e-3);
  const la::Handle<PC> pc = preconditioner(matrix, la::block_icc);
  const la::Handle<Vec> a = noise(matrix, 0), b = noise(matrix, 1);
  const la::Handle<Vec> of_a = applied(pc, a), of_b = applied(pc, b);
  EXPECT_GT(dot(a, of_a), 0);
  EXPECT_NEAR(dot(a, of_b), dot(b, of_a), 1e-5 * dot(a, of_a));
}

TEST_P(block_icc_of_nodes, takes_fewer_iterations_than_factors_that_end_at_borders) {
  const la::Handle<Mat> matrix = grid(GetParam(), 1e-3);
  const PetscInt across = iterations(matrix, la::block_icc, ""), ending = iterations(matrix, PCBJACOBI, "-sub_pc_type icc");
  if (mpi::size(PETSC_COMM_WORLD) == 1) {
    EXPECT_LE(std::abs(across - ending), 1);
  } else {
    EXPECT_LT(across, ending);
  }
}

/// Some steps of a smoother from a start, whose norm is known beforehand.
la::Handle<Vec> smoothed(KSP ksp, Mat matrix, Vec start) {
  la::Handle<Vec> x;
  PetscReal norm = 0;
  const la::Handle<Vec> b = noise(matrix, 3);
  POLYSLIP_PETSC(VecDuplicate(start, x.put()));
  POLYSLIP_PETSC(VecCopy(start, x));
  POLYSLIP_PETSC(VecNorm(x, NORM_2, &norm));
  POLYSLIP_PETSC(KSPSetInitialGuessNonzero(ksp, PETSC_TRUE));
  POLYSLIP_PETSC(KSPSetNormType(ksp, KSP_NORM_NONE));
  POLYSLIP_PETSC(KSPSolve(ksp, b, x));
  return x;
}

TEST_P(block_icc_of_nodes, iterates_as_chebyshevs_method_of_petsc) {
  const la::Handle<Mat> matrix = grid(GetParam(), 1e-3);
  const la::Handle<PC> factors = preconditioner(matrix, la::block_icc);
  const la::Handle<PC> iterating = preconditioner(matrix, la::block_icc, "iterating_",
                                                  "-iterating_pc_block_icc_steps 3 -iterating_pc_block_icc_interval 0.2,1.3");
  la::Handle<KSP> ours, theirs;
  POLYSLIP_PETSC(KSPCreate(PETSC_COMM_WORLD, ours.put()));
  POLYSLIP_PETSC(KSPSetType(ours, KSPRICHARDSON));
  POLYSLIP_PETSC(KSPSetOperators(ours, matrix, matrix));
  POLYSLIP_PETSC(KSPSetPC(ours, iterating));
  POLYSLIP_PETSC(KSPSetTolerances(ours, 0, 0, PETSC_DEFAULT, 1));
  POLYSLIP_PETSC(KSPSetUp(ours));
  const double largest = la::largest_eigenvalue(iterating);
  POLYSLIP_PETSC(KSPCreate(PETSC_COMM_WORLD, theirs.put()));
  POLYSLIP_PETSC(KSPSetType(theirs, KSPCHEBYSHEV));
  POLYSLIP_PETSC(KSPChebyshevSetEigenvalues(theirs, 1.3 * largest, 0.2 * largest));
  POLYSLIP_PETSC(KSPSetOperators(theirs, matrix, matrix));
  POLYSLIP_PETSC(KSPSetPC(theirs, factors));
  POLYSLIP_PETSC(KSPSetTolerances(theirs, 0, 0, PETSC_DEFAULT, 3));
  for (const double scale : {0.0, 1.0}) {
    const la::Handle<Vec> start = noise(matrix, 2);
    POLYSLIP_PETSC(VecScale(start, scale));
    EXPECT_LT(difference(smoothed(ours, matrix, start), smoothed(theirs, matrix, start)), 1e-5) << "from " << scale;
  }
  const la::Handle<Vec> zero = noise(matrix, 2), b = noise(matrix, 3);
  POLYSLIP_PETSC(VecZeroEntries(zero));
  EXPECT_LT(difference(applied(iterating, b), smoothed(theirs, matrix, zero)), 1e-5) << "applied";
}

/// Of the preconditioned matrix, by conjugate gradients to the end.
double largest_singular_value(Mat matrix, PC factors) {
  la::Handle<KSP> ksp;
  PetscReal largest = 0, smallest = 0;
  POLYSLIP_PETSC(KSPCreate(PETSC_COMM_WORLD, ksp.put()));
  POLYSLIP_PETSC(KSPSetType(ksp, KSPCG));
  POLYSLIP_PETSC(KSPSetOperators(ksp, matrix, matrix));
  POLYSLIP_PETSC(KSPSetPC(ksp, factors));
  POLYSLIP_PETSC(KSPSetTolerances(ksp, 1e-12, 0, PETSC_DEFAULT, 100));
  POLYSLIP_PETSC(KSPSetComputeSingularValues(ksp, PETSC_TRUE));
  const la::Handle<Vec> b = noise(matrix, 1), x = noise(matrix, 2);
  POLYSLIP_PETSC(KSPSolve(ksp, b, x));
  POLYSLIP_PETSC(KSPComputeExtremeSingularValues(ksp, &largest, &smallest));
  return largest;
}

TEST_P(block_icc_of_nodes, estimates_the_largest_eigenvalue) {
  const la::Handle<Mat> matrix = grid(GetParam(), 1e-3);
  const auto estimate = [&](const std::string& its) {
    const std::string options = "-estimate_pc_block_icc_steps 1 -estimate_pc_block_icc_estimate_its " + its;
    return la::largest_eigenvalue(preconditioner(matrix, la::block_icc, "estimate_", options.c_str()));
  };
  const double largest = largest_singular_value(matrix, preconditioner(matrix, la::block_icc));
  EXPECT_NEAR(estimate("40"), largest, 1e-2 * largest);
  EXPECT_NEAR(estimate("5"), largest, 0.3 * largest);
}

TEST_P(block_icc_of_nodes, estimates_1_where_the_factors_are_exact) {
  const la::Handle<Mat> matrix = chains(GetParam());
  const la::Handle<PC> pc =
      preconditioner(matrix, la::block_icc, "exact_", "-exact_pc_block_icc_steps 1 -exact_pc_block_icc_estimate_its 20");
  EXPECT_NEAR(la::largest_eigenvalue(pc), 1, 1e-5) << "rounding must not be taken for eigenvectors";
}

/// A solver that applies a preconditioner alone, set up.
la::Handle<KSP> solver_of(const la::Handle<PC>& pc) {
  la::Handle<KSP> ksp;
  POLYSLIP_PETSC(KSPCreate(PETSC_COMM_WORLD, ksp.put()));
  POLYSLIP_PETSC(KSPSetType(ksp, KSPPREONLY));
  POLYSLIP_PETSC(KSPSetPC(ksp, pc));
  return ksp;
}

la::Handle<KSP> factors_of(Mat matrix) { return solver_of(preconditioner(matrix, la::block_icc)); }

la::Handle<Vec> solved(KSP ksp, Vec b) {
  PC pc = nullptr;
  POLYSLIP_PETSC(KSPGetPC(ksp, &pc));
  return applied(pc, b);
}

/// Holds one node of each rank by that much more, and returns its rows on this rank.
std::vector<PetscInt> hold_more(Mat matrix, PetscInt block, PetscInt node, double stiffness) {
  PetscInt begin = 0;
  std::vector<PetscInt> rows;
  POLYSLIP_PETSC(MatGetOwnershipRange(matrix, &begin, nullptr));
  hold(matrix, block, begin / block + node, stiffness);
  assemble(matrix);
  for (PetscInt c = 0; c < block; ++c) rows.push_back(node * block + c);
  return rows;
}

TEST_P(block_icc_of_nodes, follows_changed_rows_and_two_steps_below_them_as_if_all_were_factorised_anew) {
  const la::Handle<Mat> matrix = chains(GetParam());
  const la::Handle<KSP> updated = factors_of(matrix);
  const la::Handle<Vec> b = noise(matrix, 0);
  const bool is_first = mpi::rank(PETSC_COMM_WORLD) == 0;
  std::vector<PetscInt> rows = hold_more(matrix, GetParam(), 5, is_first ? 7 : 0);  // 6 and 7 follow, and those of the next rank
  if (!is_first) rows.clear();
  la::set_up_for_changed_rows(updated, matrix, rows);
  EXPECT_EQ(difference(solved(updated, b), solved(factors_of(matrix), b)), 0);
}

TEST_P(block_icc_of_nodes, keeps_what_was_factorised_in_full_but_for_the_rows_that_it_is_told_of) {
  const la::Handle<Mat> matrix = grid(GetParam(), 1e-3);
  const la::Handle<KSP> twice = factors_of(matrix), once = factors_of(matrix);
  const la::Handle<Vec> b = noise(matrix, 0), before = solved(once, b);
  const PetscInt node = 6 * 6 * 2, far_away = 5 + 6 * 5;  // in the middle of its rank and, on others than the first, at the border
  const std::vector<PetscInt> rows = hold_more(matrix, GetParam(), node, 7);
  la::set_up_for_changed_rows(once, matrix, {});
  EXPECT_EQ(difference(solved(once, b), before), 0);

  la::set_up_for_changed_rows(twice, matrix, rows);
  (void)hold_more(matrix, GetParam(), node, 1);
  for (KSP ksp : {twice.get(), once.get()}) la::set_up_for_changed_rows(ksp, matrix, rows);
  const la::Handle<Vec> after = solved(once, b);
  EXPECT_EQ(difference(solved(twice, b), after), 0);
  EXPECT_GT(difference(after, before), 1e-4);

  const auto set_up = [&] {
    (void)hold_more(matrix, GetParam(), far_away, 1);
    POLYSLIP_PETSC(KSPSetOperators(once, matrix, matrix));
    POLYSLIP_PETSC(KSPSetUp(once));
  };
  set_up();  // at borders, too
  EXPECT_EQ(difference(solved(once, b), after), 0);
  la::forget_changed_rows(once);
  set_up();
  EXPECT_EQ(difference(solved(once, b), solved(factors_of(matrix), b)), 0);
}

/// Adds springs from the middle of each rank's part of a grid to the nodes around it, and returns the rows of these.
std::vector<PetscInt> tie_together(Mat matrix, PetscInt block, double stiffness) {
  const PetscInt middle = 3 + 6 * (3 + 6 * 2);
  PetscInt begin = 0;
  std::vector<PetscInt> rows;
  POLYSLIP_PETSC(MatGetOwnershipRange(matrix, &begin, nullptr));
  for (PetscInt dz : {-1, 0, 1})
    for (PetscInt dy : {-1, 0, 1})
      for (PetscInt dx : {-1, 0, 1}) {
        const PetscInt node = middle + dx + 6 * (dy + 6 * dz), first = begin / block;
        if (node != middle) add_spring(matrix, block, first + middle, first + node, stiffness);
        for (PetscInt c = 0; c < block; ++c) rows.push_back(node * block + c);
      }
  assemble(matrix);
  return rows;
}

TEST_P(block_icc_of_nodes, estimates_more_where_changed_rows_ask_for_it) {
  for (const PetscInt layers : {4, 12}) {  // of which the rows that change are many, or few
    SCOPED_TRACE(layers);
    const la::Handle<Mat> matrix = grid(GetParam(), 1e-3, layers);
    const la::Handle<PC> factors = preconditioner(matrix, la::block_icc);
    const la::Handle<PC> smoother = preconditioner(matrix, la::block_icc, "changed_", "-changed_pc_block_icc_steps 1");
    const la::Handle<KSP> of_factors = solver_of(factors), of_smoother = solver_of(smoother);
    const double before = la::largest_eigenvalue(smoother);
    la::set_up_for_changed_rows(of_smoother, matrix, tie_together(matrix, GetParam(), 0));
    EXPECT_NEAR(la::largest_eigenvalue(smoother), before, 0.1 * before) << "nothing is new";

    const std::vector<PetscInt> rows = tie_together(matrix, GetParam(), 1000);
    for (KSP ksp : {of_factors.get(), of_smoother.get()}) la::set_up_for_changed_rows(ksp, matrix, rows);
    const double largest = largest_singular_value(matrix, factors);
    EXPECT_NEAR(la::largest_eigenvalue(smoother), largest, 0.5 * (largest - before));
  }
}

TEST(block_icc, stays_positive_where_the_factorisation_does_not_and_leaves_empty_rows_alone) {
  const la::Handle<Mat> matrix = kershaw();
  const la::Handle<PC> pc = preconditioner(matrix, la::block_icc);
  const la::Handle<Vec> e = noise(matrix, 0);
  const PetscInt first = 5 * mpi::rank(PETSC_COMM_WORLD);
  for (PetscInt i = 0; i < 5; ++i) {
    POLYSLIP_PETSC(VecZeroEntries(e));
    POLYSLIP_PETSC(VecSetValue(e, first + i, 1, INSERT_VALUES));
    POLYSLIP_PETSC(VecAssemblyBegin(e));
    POLYSLIP_PETSC(VecAssemblyEnd(e));
    const double energy = dot(e, applied(pc, e)) / mpi::size(PETSC_COMM_WORLD);
    if (i == 3) {
      EXPECT_NEAR(energy, 1 / (0.05 * 3), 1e-5);  // the last pivot would be -5
    }
    if (i == 4) {
      EXPECT_EQ(energy, 0);
    } else {
      EXPECT_GT(energy, 0);
    }
  }
}

/// A lattice of springs whose cells hardly change their volumes on the first rank: rows that are all but dependent.
la::Handle<Mat> nearly_incompressible(double penalty) {
  constexpr PetscInt block = 3, side = 14, nodes = side * side * side;
  la::Handle<Mat> matrix = matrix_of(nodes, block, 27 * block);
  const PetscInt first = mpi::rank(PETSC_COMM_WORLD) * nodes;
  const auto node = [&](PetscInt x, PetscInt y, PetscInt z) { return first + x + side * (y + side * z); };
  const auto add_cell = [&](PetscInt x, PetscInt y, PetscInt z) {
    std::vector<PetscInt> rows;
    Eigen::VectorXd divergence(8 * block);
    for (PetscInt corner = 0; corner < 8; ++corner)
      for (PetscInt c = 0; c < block; ++c) {
        divergence[static_cast<Eigen::Index>(rows.size())] = ((corner >> c) & 1) != 0 ? 1 : -1;
        rows.push_back(node(x + (corner & 1), y + ((corner >> 1) & 1), z + ((corner >> 2) & 1)) * block + c);
      }
    const Eigen::MatrixXd k = penalty * divergence * divergence.transpose();  // symmetric, so row by row or column by column
    POLYSLIP_PETSC(MatSetValues(matrix, 24, rows.data(), 24, rows.data(), k.data(), ADD_VALUES));
  };
  for (PetscInt z = 0; z < side; ++z)
    for (PetscInt y = 0; y < side; ++y)
      for (PetscInt x = 0; x < side; ++x) {
        hold(matrix, block, node(x, y, z), 1e-3);
        if (x + 1 < side) add_spring(matrix, block, node(x, y, z), node(x + 1, y, z), 1);
        if (y + 1 < side) add_spring(matrix, block, node(x, y, z), node(x, y + 1, z), 1);
        if (z + 1 < side) add_spring(matrix, block, node(x, y, z), node(x, y, z + 1), 1);
        if (first == 0 && x + 1 < side && y + 1 < side && z + 1 < side) add_cell(x, y, z);
      }
  const PetscInt last = first + nodes - 1;
  if (mpi::rank(PETSC_COMM_WORLD) + 1 < mpi::size(PETSC_COMM_WORLD)) add_spring(matrix, block, last, last + 1, 1);
  assemble(matrix);
  return matrix;
}

TEST(block_icc, begins_again_where_factors_grow_beyond_what_is_finite) {
  for (double penalty : {1e2, 1e4, 1e6}) {
    SCOPED_TRACE(penalty);
    const la::Handle<Mat> matrix = nearly_incompressible(penalty);
    const la::Handle<PC> pc = preconditioner(matrix, la::block_icc, "again_", "-again_pc_block_icc_steps 2");
    PCFailedReason reason = PC_NOERROR;
    POLYSLIP_PETSC(PCGetFailedReason(pc, &reason));
    EXPECT_EQ(reason, PC_NOERROR);
    const la::Handle<Vec> b = noise(matrix, 1);
    const double energy = dot(b, applied(pc, b));
    EXPECT_GT(energy, 0);
    EXPECT_TRUE(std::isfinite(energy));
  }
}

TEST(block_icc, refuses_what_is_not_finite) {
  const la::Handle<Mat> matrix = kershaw();
  const PetscInt row = 5 * mpi::rank(PETSC_COMM_WORLD);
  POLYSLIP_PETSC(MatSetValue(matrix, row, row, std::numeric_limits<double>::quiet_NaN(), INSERT_VALUES));
  assemble(matrix);
  const la::Handle<PC> pc = preconditioner(matrix, la::block_icc);
  PCFailedReason reason = PC_NOERROR;
  POLYSLIP_PETSC(PCGetFailedReasonRank(pc, &reason));
  EXPECT_NE(reason, PC_NOERROR);
}

INSTANTIATE_TEST_SUITE_P(blocks, block_icc_of_nodes, testing::Values(1, 2, 3, 4, 6));

}  // namespace
}  // namespace polyslip
