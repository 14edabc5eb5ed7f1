// Blocks of nodes by vectors of the processor. In memory a node fills whole ones, with zeros behind its b components; rows of blocks are read as
// such vectors, too, but stored without gaps: what follows them meets the zeros, or adds to lanes that nobody reads.
#pragma once

#include <array>
#include <cstddef>
#include <cstring>
#include <span>

#include "polyslip/common/types.hpp"

namespace polyslip::la {

constexpr std::ptrdiff_t two_pages = 8192;  ///< [bytes]

/// Of numbers that are read once and in order, asks for what comes two pages after these (before: -two_pages): the prefetchers of processors stop
/// where a page ends. Products by halves take three quarters of their time with it.
template <class Number>
void prefetch(const Number* first, const Number* last, std::ptrdiff_t ahead = two_pages) {
  constexpr std::ptrdiff_t line = 64;
  const char* const end = reinterpret_cast<const char*>(last) + ahead;
  for (const char* at = reinterpret_cast<const char*>(first) + ahead; at < end; at += line) __builtin_prefetch(at);
}

/// So few numbers in line: std::copy_n asks the library for each, as its ranges might overlap.
template <int n>
void copy_numbers(const double* from, double* to) {
  std::memcpy(to, from, n * sizeof(double));
}

/// Numbers of a node of b components in memory.
constexpr int lanes_of(int b) { return b == 3 ? 4 : b; }
/// Numbers behind the last block that are read, too.
constexpr std::size_t beyond_blocks = 1;

/// A vector of the compilers (GCC's and Clang's), which make of it what the processor has.
template <int b>
struct LanesOf {
  using type [[gnu::vector_size(lanes_of(b) * sizeof(double))]] = double;
};
template <int b>
using Lanes = typename LanesOf<b>::type;
template <int b>
void load(const double* values, Lanes<b>& lanes) {
  std::memcpy(&lanes, values, sizeof lanes);
}
template <int b>
void add_to(double* values, const Lanes<b>& lanes) {
  Lanes<b> sum;
  load<b>(values, sum);
  sum += lanes;
  std::memcpy(values, &sum, sizeof sum);
}
template <int b, class Number>
Number* node(Number* values, Index i) {
  return values + static_cast<std::ptrdiff_t>(i) * lanes_of(b);
}

/// Products of the rows of blocks with vectors, summed up by lanes.
template <int b>
struct Sums {
  std::array<Lanes<b>, b> of_row{};
  void add(const double* block, const double* x) {
    Lanes<b> factor, row;
    load<b>(x, factor);
    for (int r = 0; r < b; ++r) {
      load<b>(block + r * b, row);
      of_row[r] += row * factor;
    }
  }
  [[nodiscard]] double value(int r) const {
    const Lanes<b>& lanes = of_row[r];
    if constexpr (lanes_of(b) == 4) return (lanes[0] + lanes[2]) + (lanes[1] + lanes[3]);
    if constexpr (lanes_of(b) == 2) return lanes[0] + lanes[1];
    return lanes[0];
  }
};

/// lanes = B^T x of a block.
template <int b>
void multiply_transposed(const double* block, const Lanes<b>& x, Lanes<b>& lanes) {
  Lanes<b> row;
  load<b>(block, row);
  lanes = row * x[0];
  for (int r = 1; r < b; ++r) {
    load<b>(block + r * b, row);
    lanes += row * x[r];
  }
}

/// y_i = sum_j B_ij x_j over the blocks of a row, which lie behind one another, and to the rows of the first `mirrored` of them B_ij^T x_i.
template <int b>
[[gnu::always_inline]] inline void multiply_row(Index i, std::span<const Index> columns, Index mirrored, const double* block, const double* x, double* y) {
  Sums<b> sums;
  Lanes<b> x_i, transposed;
  load<b>(node<b>(x, i), x_i);
  prefetch(block, block + columns.size() * b * b);
  auto column = columns.begin();
  for (const auto end = column + mirrored; column != end; ++column, block += b * b) {
    sums.add(block, node<b>(x, *column));
    multiply_transposed<b>(block, x_i, transposed);
    add_to<b>(node<b>(y, *column), transposed);
  }
  for (; column != columns.end(); ++column, block += b * b) sums.add(block, node<b>(x, *column));
  for (int r = 0; r < b; ++r) node<b>(y, i)[r] = sums.value(r);
}

}  // namespace polyslip::la
