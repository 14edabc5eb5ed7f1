#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>
#include <tuple>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/aggregation_graph.hpp"
#include "polyslip/la/block_operator.hpp"
#include "polyslip/la/galerkin_product.hpp"
#include "polyslip/la/incomplete_cholesky.hpp"
#include "polyslip/la/principal_submatrix.hpp"
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
  std::vector<GlobalIndex> ghosts_;  ///< First component of each.
  BlockMatrix::Layout layout_;
  Csr graph_;

  block_operator() {
    for (GlobalIndex i = first_; i < first_ + owned_; ++i) number_.push_back(i);
    for (GlobalIndex i = 0; i < total_; ++i)
      if (i < first_ || i >= first_ + owned_) number_.push_back(i);
    std::shuffle(number_.begin() + owned_, number_.end(), std::mt19937(5));
    start_ = {0};
    for (GlobalIndex i = 0; i < total_; ++i) start_.push_back(start_.back() + width(i));
    for (GlobalIndex i : number_) widths_.push_back(static_cast<char>(width(i)));
    for (std::size_t i = static_cast<std::size_t>(owned_); i < number_.size(); ++i) ghosts_.push_back(start_[number_[i]]);
    layout_ = {comm_, block_, owned_, start_[first_], ghosts_, block_ > 0 ? std::span<const char>() : std::span<const char>(widths_)};
    std::vector<Index> row;
    for (Index i = 0; i < owned_; ++i) {
      row.clear();
      for (Index j = static_cast<Index>(number_.size()) - 1; j >= 0; --j)
        if (coupled(number_[i], number_[j])) row.push_back(j);
      graph_.push_row(row);
    }
  }
  [[nodiscard]] int width(GlobalIndex i) const { return block_ > 0 ? block_ : 1 + i % 2; }
  [[nodiscard]] static bool coupled(GlobalIndex i, GlobalIndex j) { return i == j || (i + j + i * j) % 3 != 0; }
  /// Of components, in so few digits that products among them are exact, in whatever order they are added up.
  [[nodiscard]] double entry(GlobalIndex i, GlobalIndex j) const {
    const double value = by_halves_ ? std::sin(1.0 + i + j + 2.0 * i * j) : std::sin(1.0 + 3.0 * i + 7.0 * j);
    return std::round(1024 * value) / 1024;
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
  const BlockOperator a(layout_, graph_, by_halves_);
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
  BlockOperator a(layout_, graph_, by_halves_);
  assemble(a);
  std::vector<double> expected(static_cast<std::size_t>(start_[first_ + owned_] - start_[first_])), found(expected.size(), 1e9), local;
  visit_entries([&](GlobalIndex i, GlobalIndex j) { expected[static_cast<std::size_t>(i - start_[first_])] += entry(i, j) * x(j); });
  for (GlobalIndex i : number_)
    for (GlobalIndex component = start_[i]; component < start_[i + 1]; ++component) local.push_back(x(component));
  for (int times = 0; times < 2; ++times) a.multiply(local, found);
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-12) << i;
}

TEST_P(block_operator, multiplies_in_the_rows_near_what_is_not_zero) {
  BlockOperator a(layout_, graph_, by_halves_);
  assemble(a);
  std::vector<Index> entities;
  for (Index i = 0; i < owned_; i += 5) entities.push_back(i);
  const auto is_kept = [&](std::size_t i) { return i % 5 == 0 || i >= static_cast<std::size_t>(owned_); };
  std::vector<double> expected(static_cast<std::size_t>(start_[first_ + owned_] - start_[first_])), found(expected.size(), 0), local;
  for (std::size_t i = 0; i < number_.size(); ++i)
    for (GlobalIndex component = start_[number_[i]]; component < start_[number_[i] + 1]; ++component) local.push_back(is_kept(i) ? x(component) : 0);
  std::vector<double> before(local.size(), 1e9);
  a.multiply(before, found);  // leaves large numbers in work space
  std::fill(found.begin(), found.end(), 0.0);
  a.multiply(local, expected);
  a.multiply_rows(a.rows_near(entities), local, found);
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-12) << i;
}

TEST_P(block_operator, gives_some_of_its_rows_and_columns_for_one_choice_after_the_other) {
  BlockOperator a(layout_, graph_, by_halves_);
  assemble(a);
  std::vector<double> all(static_cast<std::size_t>(start_[first_ + owned_] - start_[first_])), local;
  PrincipalSubmatrix part;
  for (const auto& [first, step] : {std::pair(1, 2), std::pair(0, 1), std::pair(4, 5), std::pair(mpi::rank(comm_) == 0 ? 3 : 1000, 1)}) {
    std::vector<Index> chosen;
    for (Index i = first; i < owned_; i += step) chosen.push_back(i);
    part.copy(a, chosen);
    const auto is_there = [&](std::size_t i) {
      return i >= static_cast<std::size_t>(owned_) || std::binary_search(chosen.begin(), chosen.end(), static_cast<Index>(i));
    };
    local.clear();
    std::vector<double> there, found(part.rows(), 1e9);
    std::vector<std::size_t> rows;
    for (std::size_t i = 0; i < number_.size(); ++i)
      for (GlobalIndex component = start_[number_[i]]; component < start_[number_[i] + 1]; ++component) {
        const auto place = static_cast<Index>(is_there(i) ? there.size() : -1);
        EXPECT_EQ(part.column(static_cast<Index>(local.size())), place);
        if (is_there(i) && i < static_cast<std::size_t>(owned_)) rows.push_back(local.size());
        if (is_there(i)) there.push_back(x(component));
        local.push_back(is_there(i) ? x(component) : 0);
      }
    ASSERT_EQ(there.size(), part.columns());
    ASSERT_EQ(rows.size(), part.rows());
    a.multiply(local, all);
    for (int times = 0; times < 2; ++times) part.multiply(there, found);
    const std::vector<double> whole = a.diagonal(), diagonal = part.diagonal();
    ASSERT_EQ(diagonal.size(), rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      EXPECT_NEAR(found[i], all[rows[i]], 1e-12) << i;
      EXPECT_EQ(diagonal[i], whole[rows[i]]);
    }
  }
}

TEST_P(block_operator, is_written_with_both_halves) {
  BlockOperator a(layout_, graph_, by_halves_);
  assemble(a);
  BlockMatrix matrix(layout_, graph_);
  matrix.begin_writing();
  a.write_to(matrix);
  matrix.end_writing();
  PetscInt entries = 0;
  visit_entries([&](PetscInt i, PetscInt j) {
    PetscScalar value = 0;
    POLYSLIP_PETSC(MatGetValues(matrix.get(), 1, &i, 1, &j, &value));
    EXPECT_NEAR(value, entry(i, j), 1e-15) << i << " " << j;
    ++entries;
  });
  MatInfo info;
  POLYSLIP_PETSC(MatGetInfo(matrix.get(), MAT_LOCAL, &info));
  EXPECT_EQ(info.nz_used, entries);
}

TEST_P(block_operator, knows_its_diagonal_and_its_couplings) {
  BlockOperator a(layout_, graph_, by_halves_);
  assemble(a);
  std::vector<double> expected;
  for (GlobalIndex i = start_[first_]; i < start_[first_ + owned_]; ++i) expected.push_back(entry(i, i));
  EXPECT_EQ(a.diagonal(), expected);
  Csr graph = a.graph();
  ASSERT_EQ(graph.rows(), owned_);
  for (Index i = 0; i < owned_; ++i) {
    std::vector<Index> row(graph_[i].begin(), graph_[i].end());
    std::sort(row.begin(), row.end());
    std::sort(graph[i].begin(), graph[i].end());
    EXPECT_TRUE(std::equal(row.begin(), row.end(), graph[i].begin(), graph[i].end())) << i;
  }
}

TEST_P(block_operator, lets_others_multiply_and_take_the_diagonal) {
  const BlockMatrix matrix(layout_, graph_);
  const MatrixOperations operations{[](Vec x, Vec y) { POLYSLIP_PETSC(VecAXPBY(y, 2, 0, x)); }, [](Vec y) { POLYSLIP_PETSC(VecSet(y, 7)); }};
  replace_operations(matrix.get(), operations);
  Handle<Vec> x, y;
  POLYSLIP_PETSC(MatCreateVecs(matrix.get(), x.put(), y.put()));
  const auto largest = [&] {
    PetscReal norm = 0;
    POLYSLIP_PETSC(VecNorm(y, NORM_INFINITY, &norm));
    return norm;
  };
  POLYSLIP_PETSC(VecSet(x, 3));
  POLYSLIP_PETSC(MatMult(matrix.get(), x, y));
  EXPECT_EQ(largest(), 6);
  POLYSLIP_PETSC(MatMultAdd(matrix.get(), x, y, y));
  EXPECT_EQ(largest(), 12);
  POLYSLIP_PETSC(MatMultAdd(matrix.get(), x, x, y));
  EXPECT_EQ(largest(), 9);
  POLYSLIP_PETSC(MatGetDiagonal(matrix.get(), y));
  EXPECT_EQ(largest(), 7);
}

INSTANTIATE_TEST_SUITE_P(blocks, block_operator, testing::Combine(testing::Values(1, 2, 3, 0), testing::Bool()));

/// Two of the same entries: one that holds all of them, and one that holds each third row, and of the others what belongs to ghosts.
class lent_rows_of_blocks : public block_operator {
 protected:
  BlockOperator a_{layout_, graph_, by_halves_};
  BlockMatrix whole_{layout_, graph_}, thin_{layout_, thin_graph()};

  lent_rows_of_blocks() {
    assemble(a_);
    for (BlockMatrix* matrix : {&whole_, &thin_}) {
      matrix->begin_writing();
      a_.write_to(*matrix);
      matrix->end_writing();
      form_galerkin_products_by_blocks(matrix->get(), by_halves_);
      form_graphs_by_blocks(matrix->get());
    }
    replace_operations(thin_.get(), operations_);
    lend_rows(thin_.get(), a_);
  }
  [[nodiscard]] Csr thin_graph() const {
    Csr graph;
    std::vector<Index> row;
    for (Index i = 0; i < owned_; ++i) {
      row.clear();
      for (Index j : graph_[i])
        if (number_[i] % 3 == 0 || j >= owned_) row.push_back(j);
      graph.push_row(row);
    }
    return graph;
  }
  /// Three modes of aggregates of three nodes, of which each node sees two, or six in 3D.
  [[nodiscard]] Handle<Mat> prolongation() const {
    const PetscInt modes = block_ == 2 ? 3 : 6, aggregates = (owned_ + 2) / 3;
    const auto first = static_cast<PetscInt>(mpi::exclusive_sum(comm_, static_cast<Index>(aggregates)));
    const auto all = static_cast<PetscInt>(mpi::sum(comm_, static_cast<long long>(aggregates)));
    Handle<Mat> p;
    POLYSLIP_PETSC(MatCreateAIJ(comm_, owned_ * block_, aggregates * modes, PETSC_DETERMINE, PETSC_DETERMINE, 2 * modes, nullptr, 2 * modes, nullptr,
                                p.put()));
    POLYSLIP_PETSC(MatSetBlockSizes(p, block_, modes));
    for (PetscInt row = 0; row < owned_ * block_; ++row)
      for (PetscInt aggregate : {first + row / block_ / 3, (first + row / block_ / 3 + 1) % all})
        for (PetscInt mode = 0; mode < modes; ++mode)
          POLYSLIP_PETSC(MatSetValue(p, start_[first_] + row, aggregate * modes + mode, std::cos(row + 2.0 * aggregate + 3.0 * mode), INSERT_VALUES));
    POLYSLIP_PETSC(MatAssemblyBegin(p, MAT_FINAL_ASSEMBLY));
    POLYSLIP_PETSC(MatAssemblyEnd(p, MAT_FINAL_ASSEMBLY));
    return p;
  }
  /// The same to the bit, and not nothing; `equal` and `norm` are PETSc's for such objects.
  template <class T, class Equal, class Norm>
  static void expect_same(const Handle<T>& of_whole, const Handle<T>& of_thin, Equal&& equal, Norm&& norm) {
    PetscBool same = PETSC_FALSE;
    PetscReal size = 0;
    POLYSLIP_PETSC(equal(of_whole, of_thin, &same));
    POLYSLIP_PETSC(norm(of_whole, NORM_FROBENIUS, &size));  // of vectors the 2-norm
    EXPECT_TRUE(same);
    EXPECT_GT(size, 0);
  }
  /// What `make` makes of the two matrices.
  template <class Make>
  void expect_same(Make&& make) const {
    expect_same(make(whole_.get()), make(thin_.get()), MatEqual, MatNorm);
  }
  static void expect_same(const Handle<Vec>& of_whole, const Handle<Vec>& of_thin) { expect_same(of_whole, of_thin, VecEqual, VecNorm); }
  [[nodiscard]] Handle<Vec> some_vector(Mat matrix) const {
    Handle<Vec> x;
    PetscInt first = 0, end = 0;
    POLYSLIP_PETSC(MatCreateVecs(matrix, x.put(), nullptr));
    POLYSLIP_PETSC(VecGetOwnershipRange(x, &first, &end));
    const VecWrite values(x);
    for (PetscInt i = first; i < end; ++i) values[i - first] = entry(i, 3);
    return x;
  }

 private:
  const MatrixOperations operations_{[](Vec, Vec) { FAIL() << "a product nobody has asked for"; }, [](Vec) { FAIL() << "a diagonal nobody has asked for"; }};
};

TEST_P(lent_rows_of_blocks, are_read_by_graphs_and_products_as_if_they_were_held) {
  const Handle<Mat> p = prolongation();
  expect_same([](Mat matrix) {
    Handle<Mat> graph;
    POLYSLIP_PETSC(MatCreateGraph(matrix, PETSC_TRUE, PETSC_TRUE, -1, graph.put()));
    return graph;
  });
  for (const auto form : {MatMatMult, MatPtAP})
    expect_same([&](Mat matrix) {
      Handle<Mat> product;
      POLYSLIP_PETSC(form(matrix, p, MAT_INITIAL_MATRIX, PETSC_DEFAULT, product.put()));
      return product;
    });
}

TEST_P(lent_rows_of_blocks, are_read_by_incomplete_factors_as_if_they_were_held) {
  POLYSLIP_PETSC(register_block_icc());
  const auto solution = [&](Mat matrix) {
    Handle<PC> pc;
    const Handle<Vec> r = some_vector(matrix);
    Handle<Vec> z;
    POLYSLIP_PETSC(VecDuplicate(r, z.put()));
    POLYSLIP_PETSC(PCCreate(comm_, pc.put()));
    POLYSLIP_PETSC(PCSetOperators(pc, matrix, matrix));
    POLYSLIP_PETSC(PCSetType(pc, block_icc));
    POLYSLIP_PETSC(PCSetUp(pc));
    POLYSLIP_PETSC(PCApply(pc, r, z));
    return z;
  };
  expect_same(solution(whole_.get()), solution(thin_.get()));
}

INSTANTIATE_TEST_SUITE_P(blocks, lent_rows_of_blocks, testing::Combine(testing::Values(2, 3), testing::Bool()));

}  // namespace
}  // namespace polyslip::la
