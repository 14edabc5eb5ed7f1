// Blocks of nodes by vectors of the processor. In memory a node fills whole ones, with zeros behind its b components; rows of blocks are read as
// such vectors, too, but stored without gaps: what follows them meets the zeros, or adds to lanes that nobody reads.
#pragma once

#include <Eigen/Core>
#include <array>

#include "polyslip/common/types.hpp"

namespace polyslip::la {

/// Asks for what follows numbers that are read once, one after the other, two pages behind them: prefetchers of processors stop where a page ends.
/// From products by halves it takes a quarter of their time.
template <class Number>
void fetch_beyond(const Number* first, const Number* last) {
  constexpr std::ptrdiff_t line = 64, ahead = 8192;
  const char* const end = reinterpret_cast<const char*>(last) + ahead;
  for (const char* at = reinterpret_cast<const char*>(first) + ahead; at < end; at += line) __builtin_prefetch(at);
}
/// The same, downwards in memory.
template <class Number>
void fetch_before(const Number* first, const Number* last) {
  constexpr std::ptrdiff_t line = 64, ahead = 8192;
  const char* const end = reinterpret_cast<const char*>(last) - ahead;
  for (const char* at = reinterpret_cast<const char*>(first) - ahead; at < end; at += line) __builtin_prefetch(at);
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
