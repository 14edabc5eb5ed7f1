// Template bodies of mpi.hpp.
#pragma once

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"

namespace polyslip::mpi {

template <class Body>
void on_root(MPI_Comm comm, Body&& body, int root) {
  std::string failure;
  if (rank(comm) == root) {
    try {
      body();
    } catch (const std::exception&) {
      failure = packed_exception();
    }
  }
  failure = broadcast(comm, failure, root);
  if (!failure.empty()) raise(failure);
}

template <class Body>
void together(MPI_Comm comm, Body&& body) {
  std::string failure;
  try {
    body();
  } catch (const std::exception&) {
    failure = packed_exception();
  }
  const auto first = static_cast<int>(min(comm, failure.empty() ? size(comm) : rank(comm)));
  if (first < size(comm)) raise(broadcast(comm, failure, first));
}

template <class Make>
auto made_together(MPI_Comm comm, Make&& make) {
  decltype(make()) result;
  together(comm, [&] { result = make(); });
  return result;
}

}  // namespace polyslip::mpi
