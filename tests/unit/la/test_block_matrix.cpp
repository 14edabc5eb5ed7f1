#include <gtest/gtest.h>
#include <petsc/private/petscimpl.h>  // PetscObjectStateGet

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <numeric>
#include <random>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/block_matrix.hpp"
#include "polyslip/la/block_operator.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::la {
namespace {

/// A random graph over numbered copies: rank r owns 5 + 4 r of them (the last of several ranks none) and sees some of the others as
/// ghosts, in no order.
struct RandomGraph {
  std::mt19937 random;
  Index owned = 0;
  GlobalIndex first = 0;
  std::vector<GlobalIndex> ghosts;
  Csr graph;

  RandomGraph(MPI_Comm comm, unsigned seed) : random(seed + 17 * static_cast<unsigned>(mpi::rank(comm))) {
    const int rank = mpi::rank(comm), size = mpi::size(comm);
    owned = size > 2 && rank == size - 1 ? 0 : 5 + 4 * rank;
    first = static_cast<GlobalIndex>(mpi::exclusive_sum(comm, owned));
    const auto total = static_cast<GlobalIndex>(mpi::sum(comm, static_cast<long long>(owned)));
    for (GlobalIndex i = 0; i < total; ++i)
      if ((i < first || i >= first + owned) && random() % 3 != 0) ghosts.push_back(i);
    std::shuffle(ghosts.begin(), ghosts.end(), random);
    for (Index row = 0; row < owned; ++row) {
      std::vector<Index> columns{row};
      for (Index col = 0; col < owned + static_cast<Index>(ghosts.size()); ++col)
        if (col != row && random() % 2 == 0) columns.push_back(col);
      std::shuffle(columns.begin(), columns.end(), random);
      graph.push_row(columns);
    }
  }
  [[nodiscard]] GlobalIndex global(Index i) const { return i < owned ? first + i : ghosts[i - owned]; }
  /// Local entities, ghosts included.
  [[nodiscard]] Index local() const { return owned + static_cast<Index>(ghosts.size()); }
};

/// Components of the entities of a graph: as many each, or one and `widest` by turns of their global numbers (widest < 0).
struct Components {
  std::vector<char> widths;            ///< Of local entities.
  std::vector<GlobalIndex> first;      ///< Global number of their first component.
  Index owned = 0;                     ///< Components of this rank.

  Components(MPI_Comm comm, const RandomGraph& graph, int width) {
    const auto total = static_cast<GlobalIndex>(mpi::sum(comm, static_cast<long long>(graph.owned)));
    std::vector<GlobalIndex> start{0};
    const auto width_of = [&](GlobalIndex i) { return width > 0 ? width : i % 3 == 1 ? -width : 1; };
    for (GlobalIndex i = 0; i < total; ++i) start.push_back(start.back() + width_of(i));
    for (Index i = 0; i < graph.local(); ++i) {
      widths.push_back(static_cast<char>(width_of(graph.global(i))));
      first.push_back(start[graph.global(i)]);
    }
    owned = start[graph.first + graph.owned] - start[graph.first];
    first_owned = start[graph.first];
  }
  GlobalIndex first_owned = 0;
};

/// The same matrix by MatSetValues.
struct Reference {
  Handle<Mat> matrix;

  Reference(MPI_Comm comm, Index components) {
    POLYSLIP_PETSC(MatCreate(comm, matrix.put()));
    POLYSLIP_PETSC(MatSetSizes(matrix, components, components, PETSC_DETERMINE, PETSC_DETERMINE));
    POLYSLIP_PETSC(MatSetType(matrix, MATAIJ));
    POLYSLIP_PETSC(MatSetUp(matrix));
    POLYSLIP_PETSC(MatSetOption(matrix, MAT_NEW_NONZERO_ALLOCATION_ERR, PETSC_FALSE));
  }
  void finish() {
    POLYSLIP_PETSC(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
    POLYSLIP_PETSC(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
  }
  /// |reference - other| / |reference|
  [[nodiscard]] double distance(Mat other) const {
    Handle<Mat> difference;
    PetscReal whole = 0, rest = 0;
    POLYSLIP_PETSC(MatNorm(matrix, NORM_FROBENIUS, &whole));
    POLYSLIP_PETSC(MatDuplicate(matrix, MAT_COPY_VALUES, difference.put()));
    POLYSLIP_PETSC(MatAXPY(difference, -1.0, other, DIFFERENT_NONZERO_PATTERN));
    POLYSLIP_PETSC(MatNorm(difference, NORM_FROBENIUS, &rest));
    return rest / whole;
  }
};

class block_matrix : public testing::TestWithParam<int> {
 protected:
  MPI_Comm comm_ = PETSC_COMM_WORLD;
  int block_ = GetParam();  ///< Of all entities; negative: of some, the others have one component.
  RandomGraph graph_{comm_, 3};
  Components components_{comm_, graph_, block_};
  BlockMatrix matrix_{{comm_, block_, graph_.owned, components_.first_owned,
                       std::span<const GlobalIndex>(components_.first).subspan(static_cast<std::size_t>(graph_.owned)),
                       block_ > 0 ? std::span<const char>() : std::span<const char>(components_.widths)},
                      graph_.graph};
  Reference reference_{comm_, components_.owned};

  /// Adds random blocks, cut out of wider rows, to both matrices `times` times.
  void add_everywhere(int times) {
    std::uniform_real_distribution<double> value(-1, 1);
    constexpr int stride = 7;
    std::vector<double> wide(3 * stride);
    for (int k = 0; k < times; ++k)
      for (Index row = 0; row < graph_.owned; ++row)
        for (Index col : graph_.graph[row]) {
          for (double& v : wide) v = value(graph_.random);
          matrix_.add(row, col, wide.data(), stride);
          for (int a = 0; a < components_.widths[row]; ++a)
            for (int b = 0; b < components_.widths[col]; ++b)
              POLYSLIP_PETSC(MatSetValue(reference_.matrix, components_.first[row] + a, components_.first[col] + b,
                                         wide[static_cast<std::size_t>(stride * a + b)], ADD_VALUES));
        }
  }
};

TEST_P(block_matrix, holds_what_set_values_would_hold_on_random_graphs) {
  matrix_.begin_writing();
  matrix_.set_zero();
  add_everywhere(2);
  matrix_.end_writing();
  reference_.finish();
  EXPECT_LT(reference_.distance(matrix_.get()), 1e-15);
}

TEST_P(block_matrix, rows_can_be_cleared_and_written_again) {
  matrix_.begin_writing();
  const double garbage[9] = {9, 9, 9, 9, 9, 9, 9, 9, 9};
  for (Index row = 0; row < graph_.owned; ++row)
    for (Index col : graph_.graph[row]) matrix_.add(row, col, garbage, 3);
  matrix_.end_writing();
  matrix_.begin_writing();
  for (Index row = 0; row < graph_.owned; ++row)
    for (auto values : {matrix_.diagonal_row(row), matrix_.offdiagonal_row(row)}) std::fill(values.begin(), values.end(), 0.0);
  add_everywhere(1);
  matrix_.end_writing();
  reference_.finish();
  EXPECT_LT(reference_.distance(matrix_.get()), 1e-15);
}

TEST_P(block_matrix, tells_petsc_that_values_changed) {
  PetscObjectState before = 0, after = 0;
  POLYSLIP_PETSC(PetscObjectStateGet(reinterpret_cast<PetscObject>(matrix_.get()), &before));
  matrix_.begin_writing();
  matrix_.end_writing();
  POLYSLIP_PETSC(PetscObjectStateGet(reinterpret_cast<PetscObject>(matrix_.get()), &after));
  EXPECT_GT(after, before);
}

TEST_P(block_matrix, has_the_block_size_that_multigrid_needs) {
  Mat own = nullptr;  // what block Jacobi solves with
  POLYSLIP_PETSC(MatGetDiagonalBlock(matrix_.get(), &own));
  for (Mat matrix : {matrix_.get(), own}) {
    PetscInt size = 0;
    POLYSLIP_PETSC(MatGetBlockSize(matrix, &size));
    EXPECT_EQ(size, block_ > 0 ? block_ : 1);
  }
}

INSTANTIATE_TEST_SUITE_P(blocks, block_matrix, testing::Values(1, 2, 3, -2, -3));

}  // namespace
}  // namespace polyslip::la
