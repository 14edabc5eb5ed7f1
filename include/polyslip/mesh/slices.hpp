// Tables in slices: each rank holds a contiguous run of rows, and any rank may read or write any rows by their numbers.
#pragma once

#include <mpi.h>

#include <vector>

#include "polyslip/mesh/row_range.hpp"

namespace polyslip::mesh {

/// Rows of a sliced table that this rank has to do with, in any order, also several times. All functions are collective.
class RemoteRows {
 public:
  /// `mine` are the rows that this rank holds: those of the ranks follow on one another.
  RemoteRows(MPI_Comm comm, const RowRange& mine, const std::vector<Index>& rows);

  /// The rows of a table of which this rank holds `held`.
  template <class T>
  [[nodiscard]] std::vector<T> get(const std::vector<T>& held) const {
    std::vector<T> sent, got(order_.size()), values(order_.size());
    sent.reserve(asked_.size());
    for (const Index row : asked_) sent.push_back(held[row]);
    exchange(sent.data(), asked_counts_, got.data(), counts_, sizeof(T));
    for (std::size_t i = 0; i < got.size(); ++i) values[order_[i]] = got[i];
    return values;
  }
  [[nodiscard]] Csr get(const Csr& held) const;
  /// Writes values into the rows; where several are written into one row, any of them stays.
  void put(const std::vector<Index>& values, std::vector<Index>& held) const;
  /// For each row that this rank holds, the values that the ranks have sent to it, rank by rank in the order of their lists.
  [[nodiscard]] Csr collect(const std::vector<Index>& values) const;

 private:
  [[nodiscard]] std::vector<Index> sent_to_holders(const std::vector<Index>& values) const;
  /// So many units of `size` bytes for each rank, and from each.
  void exchange(const void* sent, const std::vector<int>& sent_counts, void* got, const std::vector<int>& got_counts,
                std::size_t size) const;

  MPI_Comm comm_;
  Index held_;                 ///< Number of rows held.
  std::vector<int> counts_;    ///< Rows that this rank asks of each rank;
  std::vector<Index> order_;   ///< their places in the list given, rank by rank.
  std::vector<int> asked_counts_;  ///< Rows that each rank asks of this one;
  std::vector<Index> asked_;       ///< their places among those held, rank by rank.
};

/// The run of `size` rows of this rank behind those of the lower ranks.
RowRange rows_behind(MPI_Comm comm, Index size);

}  // namespace polyslip::mesh
