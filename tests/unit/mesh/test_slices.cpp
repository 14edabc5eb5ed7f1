// Rows of sliced tables: every rank gets what it asks for, from slices of any size.
#include <gtest/gtest.h>

#include <algorithm>

#include "polyslip/common/mpi.hpp"
#include "polyslip/mesh/slices.hpp"
#include "unit/mesh/part_cases.hpp"

namespace polyslip::mesh {
namespace {

/// Row r holds 10 r, and as a row of variable length r % 3 times r. Rank 1 holds none.
struct Table {
  RowRange rows = rows_behind(world, mpi::rank(world) == 1 ? 0 : 5 + 3 * mpi::rank(world));
  std::vector<Index> tens;
  Csr repeated;

  Table() {
    for (Index row = rows.first; row < rows.first + rows.size; ++row) {
      tens.push_back(10 * row);
      repeated.push_row(std::vector<Index>(row % 3, row));
    }
  }
  /// Rows from the last to the first, the even ones twice; other ranks ask for fewer.
  [[nodiscard]] std::vector<Index> wanted() const {
    std::vector<Index> result;
    for (Index row = rows.total - 1; row >= mpi::rank(world); --row) result.insert(result.end(), row % 2 == 0 ? 2 : 1, row);
    return result;
  }
};

TEST(remote_rows, come_in_the_order_in_which_they_are_asked_for) {
  const Table table;
  const std::vector<Index> wanted = table.wanted();
  const RemoteRows remote(world, table.rows, wanted);
  const std::vector<Index> tens = remote.get(table.tens);
  const Csr repeated = remote.get(table.repeated);
  ASSERT_EQ(tens.size(), wanted.size());
  ASSERT_EQ(repeated.rows(), static_cast<Index>(wanted.size()));
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_EQ(tens[i], 10 * wanted[i]);
    const auto row = repeated[static_cast<Index>(i)];
    EXPECT_EQ(std::vector<Index>(row.begin(), row.end()), std::vector<Index>(wanted[i] % 3, wanted[i]));
  }
}

TEST(remote_rows, are_written_where_they_are_held) {
  Table table;
  const std::vector<Index> wanted = table.wanted();
  std::vector<Index> values;
  for (const Index row : wanted) values.push_back(-row);
  RemoteRows(world, table.rows, wanted).put(values, table.tens);
  for (Index i = 0; i < table.rows.size; ++i) EXPECT_EQ(table.tens[i], -(table.rows.first + i));
}

TEST(remote_rows, collect_what_all_ranks_send) {
  const Table table;
  const std::vector<Index> wanted = table.wanted();
  const Csr collected = RemoteRows(world, table.rows, wanted).collect(std::vector<Index>(wanted.size(), mpi::rank(world)));
  ASSERT_EQ(collected.rows(), table.rows.size);
  for (Index i = 0; i < collected.rows(); ++i) {
    const Index row = table.rows.first + i;
    std::vector<Index> expected;
    for (Index rank = 0; rank <= std::min(row, mpi::size(world) - 1); ++rank) expected.insert(expected.end(), row % 2 == 0 ? 2 : 1, rank);
    EXPECT_EQ(std::vector<Index>(collected[i].begin(), collected[i].end()), expected);
  }
}

}  // namespace
}  // namespace polyslip::mesh
