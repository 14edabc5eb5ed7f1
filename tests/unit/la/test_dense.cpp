#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "polyslip/la/dense.hpp"

namespace polyslip::la {
namespace {

TEST(dense, multiplies_rows_of_any_length_and_leaves_out_what_lies_between_them) {
  for (int columns = 0; columns < 21; ++columns)
    for (const int gap : {0, 3}) {
      const int rows = 5, step = columns + gap;
      std::vector<double> a(static_cast<std::size_t>(rows * step), std::nan("")), x(static_cast<std::size_t>(columns)), y(rows + 1, 7.0);
      for (int j = 0; j < columns; ++j) {
        x[static_cast<std::size_t>(j)] = j % 3 - 1;
        for (int i = 0; i < rows; ++i) a[static_cast<std::size_t>(i * step + j)] = 10 * i + j;
      }
      multiply(rows, columns, a.data(), step, x.data(), y.data());
      for (int i = 0; i < rows; ++i) {
        double expected = 0;
        for (int j = 0; j < columns; ++j) expected += (10 * i + j) * (j % 3 - 1);
        EXPECT_EQ(y[static_cast<std::size_t>(i)], expected) << columns << " columns";
      }
      EXPECT_EQ(y.back(), 7);
    }
}

}  // namespace
}  // namespace polyslip::la
