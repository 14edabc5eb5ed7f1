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
    } catch (const std::exception& e) {
      failure = *e.what() ? e.what() : "unknown failure";
    }
  }
  failure = broadcast(comm, failure, root);
  if (!failure.empty()) throw InputError(failure);
}

template <class Body>
void together(MPI_Comm comm, Body&& body) {
  std::string failure;
  try {
    body();
  } catch (const std::exception& e) {
    failure = *e.what() ? e.what() : "unknown failure";
  }
  const auto first = static_cast<int>(min(comm, failure.empty() ? size(comm) : rank(comm)));
  if (first < size(comm)) throw InputError(broadcast(comm, failure, first));
}

}  // namespace polyslip::mpi
