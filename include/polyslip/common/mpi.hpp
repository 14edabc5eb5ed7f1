// Thin, typed wrappers of the few MPI calls that the modules need.
#pragma once

#include <mpi.h>

#include <span>
#include <string>
#include <vector>

namespace polyslip::mpi {

int rank(MPI_Comm comm);
int size(MPI_Comm comm);

double sum(MPI_Comm comm, double value);
double max(MPI_Comm comm, double value);
double min(MPI_Comm comm, double value);
long long sum(MPI_Comm comm, long long value);
long long max(MPI_Comm comm, long long value);
/// Element-wise sum over the ranks, in place.
void sum_in_place(MPI_Comm comm, std::span<double> values);
void sum_in_place(MPI_Comm comm, std::span<long long> values);
/// Sum of the values of the lower ranks; 0 on rank 0.
long long exclusive_sum(MPI_Comm comm, long long value);
bool any(MPI_Comm comm, bool value);

/// Sends the text of rank `root` to all ranks.
std::string broadcast(MPI_Comm comm, const std::string& text, int root = 0);
/// One value of each rank, known on all ranks.
std::vector<double> all_gather(MPI_Comm comm, double value);

/// Runs `body` on rank `root` only; if it throws an InputError there, every rank throws the same InputError.
/// Ranks therefore never wait for one that has failed.
template <class Body>
void on_root(MPI_Comm comm, Body&& body, int root = 0);

}  // namespace polyslip::mpi

#include "polyslip/common/mpi_impl.hpp"
