#include "polyslip/mesh/slices.hpp"

#include <algorithm>
#include <numeric>

#include "polyslip/common/mpi.hpp"

namespace polyslip::mesh {

namespace {

std::vector<int> begins(const std::vector<int>& counts) {
  std::vector<int> result(counts.size());
  std::exclusive_scan(counts.begin(), counts.end(), result.begin(), 0);
  return result;
}

/// Rank that holds each row; `first` is the first row of each rank.
std::vector<int> holders(const std::vector<Index>& first, const std::vector<Index>& rows) {
  std::vector<int> result;
  result.reserve(rows.size());
  for (const Index row : rows) {
    result.push_back(static_cast<int>(std::upper_bound(first.begin(), first.end(), row) - first.begin()) - 1);
  }
  return result;
}

}  // namespace

RemoteRows::RemoteRows(MPI_Comm comm, const RowRange& mine, const std::vector<Index>& rows)
    : comm_(comm), held_(mine.size), counts_(mpi::size(comm), 0), order_(rows.size()), asked_counts_(counts_.size()) {
  std::vector<Index> first(counts_.size());
  MPI_Allgather(&mine.first, 1, MPI_INT32_T, first.data(), 1, MPI_INT32_T, comm);
  const std::vector<int> holder = holders(first, rows);
  for (const int rank : holder) ++counts_[rank];
  MPI_Alltoall(counts_.data(), 1, MPI_INT, asked_counts_.data(), 1, MPI_INT, comm);

  std::vector<int> next = begins(counts_);
  std::vector<Index> sent(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const int place = next[holder[i]]++;
    order_[place] = static_cast<Index>(i);
    sent[place] = rows[i] - first[holder[i]];
  }
  asked_.resize(std::accumulate(asked_counts_.begin(), asked_counts_.end(), std::size_t{0}));
  exchange(sent.data(), counts_, asked_.data(), asked_counts_, sizeof(Index));
}

Csr RemoteRows::get(const Csr& held) const {
  std::vector<Index> sizes, sent;
  for (Index row = 0; row < held.rows(); ++row) sizes.push_back(held.row_size(row));
  sizes = get(sizes);
  std::vector<int> sent_counts(counts_.size(), 0), got_counts(counts_.size(), 0);
  for (std::size_t rank = 0, i = 0; rank < counts_.size(); ++rank) {
    const std::size_t before = sent.size();
    for (const std::size_t end = i + asked_counts_[rank]; i < end; ++i) {
      const auto row = held[asked_[i]];
      sent.insert(sent.end(), row.begin(), row.end());
    }
    sent_counts[rank] = static_cast<int>(sent.size() - before);
  }
  for (std::size_t rank = 0, i = 0; rank < counts_.size(); ++rank) {
    for (const std::size_t end = i + counts_[rank]; i < end; ++i) got_counts[rank] += sizes[order_[i]];
  }
  Csr result;
  result.offsets.resize(sizes.size() + 1);
  std::partial_sum(sizes.begin(), sizes.end(), result.offsets.begin() + 1);
  std::vector<Index> got(static_cast<std::size_t>(result.offsets.back()));
  exchange(sent.data(), sent_counts, got.data(), got_counts, sizeof(Index));
  result.values.resize(got.size());
  auto from = got.begin();
  for (const Index row : order_) {
    std::copy(from, from + sizes[row], result.values.begin() + result.offsets[row]);
    from += sizes[row];
  }
  return result;
}

std::vector<Index> RemoteRows::sent_to_holders(const std::vector<Index>& values) const {
  std::vector<Index> sent, got(asked_.size());
  sent.reserve(order_.size());
  for (const Index place : order_) sent.push_back(values[place]);
  exchange(sent.data(), counts_, got.data(), asked_counts_, sizeof(Index));
  return got;
}

void RemoteRows::put(const std::vector<Index>& values, std::vector<Index>& held) const {
  const std::vector<Index> got = sent_to_holders(values);
  for (std::size_t i = 0; i < got.size(); ++i) held[asked_[i]] = got[i];
}

Csr RemoteRows::collect(const std::vector<Index>& values) const {
  const std::vector<Index> got = sent_to_holders(values);
  Csr result;
  result.offsets.resize(static_cast<std::size_t>(held_) + 1, 0);
  for (const Index row : asked_) ++result.offsets[row + 1];
  std::partial_sum(result.offsets.begin(), result.offsets.end(), result.offsets.begin());
  result.values.resize(got.size());
  std::vector<Index> next(result.offsets.begin(), result.offsets.end() - 1);
  for (std::size_t i = 0; i < got.size(); ++i) result.values[next[asked_[i]]++] = got[i];
  return result;
}

void RemoteRows::exchange(const void* sent, const std::vector<int>& sent_counts, void* got, const std::vector<int>& got_counts,
                          std::size_t size) const {
  const mpi::BlockType unit(MPI_BYTE, static_cast<int>(size));
  MPI_Alltoallv(sent, sent_counts.data(), begins(sent_counts).data(), unit, got, got_counts.data(), begins(got_counts).data(), unit,
                comm_);
}

RowRange rows_behind(MPI_Comm comm, Index size) {
  return {.first = static_cast<Index>(mpi::exclusive_sum(comm, static_cast<long long>(size))),
          .size = size,
          .total = static_cast<Index>(mpi::sum(comm, static_cast<long long>(size)))};
}

}  // namespace polyslip::mesh
