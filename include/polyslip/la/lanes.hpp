// Blocks of nodes by vectors of the processor. In memory a node fills whole ones, with zeros behind its b components; rows of blocks are read as
// such vectors, too, but stored without gaps: what follows them meets the zeros, or adds to lanes that nobody reads.
#pragma once

#include <Eigen/Core>
#include <array>

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

/// Numbers of a node of b components in memory.
constexpr int lanes_of(int b) { return b == 3 ? 4 : b; }
/// Numbers behind the last block that are read, too.
constexpr std::size_t beyond_blocks = 1;

template <int b>
using Lanes = Eigen::Array<double, lanes_of(b), 1>;
template <int b>
auto lanes(const double* values) {
  return Eigen::Map<const Lanes<b>>(values);
}
template <int b>
auto lanes(double* values) {
  return Eigen::Map<Lanes<b>>(values);
}
template <int b, class Number>
Number* node(Number* values, Index i) {
  return values + static_cast<std::ptrdiff_t>(i) * lanes_of(b);
}

/// Products of the rows of blocks with vectors, summed up by lanes.
template <int b>
struct Sums {
  std::array<Lanes<b>, b> of_row;
  Sums() { of_row.fill(Lanes<b>::Zero()); }
  void add(const double* block, const double* x) {
    const Lanes<b> factor = lanes<b>(x);
    for (int r = 0; r < b; ++r) of_row[r] += lanes<b>(block + r * b) * factor;
  }
};

}  // namespace polyslip::la
