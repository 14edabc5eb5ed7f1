#include "polyslip/la/dense.hpp"

#include "polyslip/common/processor.hpp"
#include "polyslip/la/lanes.hpp"

namespace polyslip::la {

namespace {

constexpr int width = 4;

[[gnu::always_inline]] inline void add_product(const double* a, const double* x, Lanes<width>& sum) {
  Lanes<width> left, right;
  load<width>(a, left);
  load<width>(x, right);
  sum += left * right;
}

}  // namespace

POLYSLIP_BY_PROCESSOR void multiply(int rows, int columns, const double* a, int step, const double* x, double* y) {
  for (int i = 0; i < rows; ++i, a += step) {
    Lanes<width> sums{}, others{};  // in turn, as each waits for its last term
    int j = 0;
    for (; j + 2 * width <= columns; j += 2 * width) {
      add_product(a + j, x + j, sums);
      add_product(a + j + width, x + j + width, others);
    }
    if (j + width <= columns) {
      add_product(a + j, x + j, sums);
      j += width;
    }
    sums += others;
    double sum = (sums[0] + sums[2]) + (sums[1] + sums[3]);
    for (; j < columns; ++j) sum += a[j] * x[j];
    y[i] = sum;
  }
}

POLYSLIP_BY_PROCESSOR void add_transposed(int rows, int columns, double factor, const double* a, int step, const double* x, double* y) {
  for (int i = 0; i < rows; ++i, a += step) {
    const double x_i = factor * x[i];
    for (int j = 0; j < columns; ++j) y[j] += x_i * a[j];
  }
}

}  // namespace polyslip::la
