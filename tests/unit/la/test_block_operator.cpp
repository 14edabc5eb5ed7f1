#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>
#include <tuple>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/block_operator.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::la {
namespace {

/// A matrix over numbered entities of which each rank owns some (the last of several ranks none) and sees all others, in no order. All have as
/// many components, or two and one by turns (0); `by_halves` it is symmetric.
class block_operator : public testing::TestWithParam<std::tuple<int, bool>> {
 protected:
  MPI_Comm comm_ = PETSC_COMM_WORLD;
  int block_ = std::get<0>(GetParam());
  bool by_halves_ = std::get<1>(GetParam());
  Index owned_ = mpi::size(comm_) > 2 && mpi::rank(comm_) == mpi::size(comm_) - 1 ? 0 : 7 + 4 * mpi::rank(comm_);
  GlobalIndex first_ = static_cast<GlobalIndex>(mpi::exclusive_sum(comm_, owned_));
  GlobalIndex total_ = static_cast<GlobalIndex>(mpi::sum(comm_, static_cast<long long>(owned_)));
  std::vector<GlobalIndex> number_;  ///< Of local entities.
  std::vector<GlobalIndex> start_;   ///< First component of each entity.
  std::vector<char> widths_;         ///< Of local entities.
  std::unique_ptr<BlockMatrix> matrix_;

  block_operator() {
    for (GlobalIndex i = first_; i < first_ + owned_; ++i) number_.push_back(i);
    for (GlobalIndex i = 0; i < total_; ++i)
      if (i < first_ || i >= first_ + owned_) number_.push_back(i);
    std::shuffle(number_.begin() + owned_, number_.end(), std::mt19937(5));
    start_ = {0};
    for (GlobalIndex i = 0; i < total_; ++i) start_.push_back(start_.back() + width(i));
    std::vector<GlobalIndex> ghosts;
    for (GlobalIndex i : number_) widths_.push_back(static_cast<char>(width(i)));
    for (std::size_t i = static_cast<std::size_t>(owned_); i < number_.size(); ++i) ghosts.push_back(start_[number_[i]]);
    Csr graph;
    std::vector<Index> row;
    for (Index i = 0; i < owned_; ++i) {
      row.clear();
      for (Index j = static_cast<Index>(number_.size()) - 1; j >= 0; --j)
        if (coupled(number_[i], number_[j])) row.push_back(j);
      graph.push_row(row);
    }
    matrix_ = std::make_unique<BlockMatrix>(
        BlockMatrix::Layout{comm_, block_, owned_, start_[first_], ghosts, block_ > 0 ? std::span<const char>() : std::span<const char>(widths_)},
        graph);
  }
  [[nodiscard]] int width(GlobalIndex i) const { return block_ > 0 ? block_ : 1 + i % 2; }
  [[nodiscard]] static bool coupled(GlobalIndex i, GlobalIndex j) { return i == j || (i + j + i * j) % 3 != 0; }
  /// Of components.
  [[nodiscard]] double entry(GlobalIndex i, GlobalIndex j) const {
    return by_halves_ ? std::sin(1.0 + i + j + 2.0 * i * j) : std::sin(1.0 + 3.0 * i + 7.0 * j);
  }
  [[nodiscard]] static double x(GlobalIndex i) { return std::cos(2.0 * i); }

  /// Half of each block at a time, by turns as it is and from its transposed.
  void assemble(BlockOperator& a) const {
    std::vector<double> block(9);
    const auto local = static_cast<Index>(number_.size());
    for (int half = 0; half < 2; ++half)
      for (Index i = 0; i < owned_; ++i)
        for (Index j = 0; j < local; ++j) {
          if (!a.holds(i, j) || !coupled(number_[i], number_[j])) continue;
          const int rows = widths_[i], columns = widths_[j];
          const int row_step = half == 0 ? columns : 1, column_step = half == 0 ? 1 : rows;
          for (int r = 0; r < rows; ++r)
            for (int c = 0; c < columns; ++c)
              block[static_cast<std::size_t>(r * row_step + c * column_step)] = entry(start_[number_[i]] + r, start_[number_[j]] + c) / 2;
          a.add(i, j, block.data(), row_step, column_step);
        }
  }
  /// visit(row, column) for the components that are coupled, in the rows of this rank.
  void visit_entries(const std::function<void(GlobalIndex, GlobalIndex)>& visit) const {
    for (GlobalIndex i = first_; i < first_ + owned_; ++i)
      for (GlobalIndex j = 0; j < total_; ++j)
        if (coupled(i, j))
          for (GlobalIndex row = start_[i]; row < start_[i + 1]; ++row)
            for (GlobalIndex column = start_[j]; column < start_[j + 1]; ++column) visit(row, column);
  }
};

TEST_P(block_operator, holds_one_of_two_blocks_by_halves_and_all_of_them_otherwise) {
  const BlockOperator a(*matrix_, by_halves_);
  double blocks = 0;
  for (Index i = 0; i < owned_; ++i)
    for (Index j = 0; j < static_cast<Index>(number_.size()); ++j) {
      EXPECT_EQ(a.holds(i, j), !by_halves_ || j <= i || j >= owned_);
      EXPECT_FALSE(a.holds(owned_, j)) << "the row of a ghost";
      if (coupled(number_[i], number_[j])) blocks += a.holds(i, j) ? 1 : 0;
    }
  EXPECT_EQ(a.blocks(), blocks);
}

TEST_P(block_operator, multiplies_by_all_that_was_added) {
  BlockOperator a(*matrix_, by_halves_);
  assemble(a);
  std::vector<double> expected(static_cast<std::size_t>(start_[first_ + owned_] - start_[first_])), found(expected.size(), 1e9), local;
  visit_entries([&](GlobalIndex i, GlobalIndex j) { expected[static_cast<std::size_t>(i - start_[first_])] += entry(i, j) * x(j); });
  for (GlobalIndex i : number_)
    for (GlobalIndex component = start_[i]; component < start_[i + 1]; ++component) local.push_back(x(component));
  for (int times = 0; times < 2; ++times) a.multiply(local, found);
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-12) << i;
}

TEST_P(block_operator, is_written_with_both_halves) {
  BlockOperator a(*matrix_, by_halves_);
  assemble(a);
  matrix_->begin_writing();
  a.write_to(*matrix_);
  matrix_->end_writing();
  PetscInt entries = 0;
  visit_entries([&](PetscInt i, PetscInt j) {
    PetscScalar value = 0;
    POLYSLIP_PETSC(MatGetValues(matrix_->get(), 1, &i, 1, &j, &value));
    EXPECT_NEAR(value, entry(i, j), 1e-15) << i << " " << j;
    ++entries;
  });
  MatInfo info;
  POLYSLIP_PETSC(MatGetInfo(matrix_->get(), MAT_LOCAL, &info));
  EXPECT_EQ(info.nz_used, entries);
}

INSTANTIATE_TEST_SUITE_P(blocks, block_operator, testing::Combine(testing::Values(1, 2, 3, 0), testing::Bool()));

}  // namespace
}  // namespace polyslip::la
