#include "polyslip/common/mpi.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <new>

#include "polyslip/common/error.hpp"

namespace polyslip::mpi {

namespace {
template <class T>
T reduce(MPI_Comm comm, T value, MPI_Datatype type, MPI_Op op) {
  T result{};
  MPI_Allreduce(&value, &result, 1, type, op, comm);
  return result;
}
}  // namespace

void choose_file_layer() { (void)setenv("OMPI_MCA_io", "romio321", 0); }

int rank(MPI_Comm comm) {
  int r = 0;
  MPI_Comm_rank(comm, &r);
  return r;
}

int size(MPI_Comm comm) {
  int s = 1;
  MPI_Comm_size(comm, &s);
  return s;
}

double sum(MPI_Comm comm, double value) { return reduce(comm, value, MPI_DOUBLE, MPI_SUM); }
double max(MPI_Comm comm, double value) { return reduce(comm, value, MPI_DOUBLE, MPI_MAX); }
double min(MPI_Comm comm, double value) { return reduce(comm, value, MPI_DOUBLE, MPI_MIN); }
long long sum(MPI_Comm comm, long long value) { return reduce(comm, value, MPI_LONG_LONG, MPI_SUM); }
long long max(MPI_Comm comm, long long value) { return reduce(comm, value, MPI_LONG_LONG, MPI_MAX); }
bool any(MPI_Comm comm, bool value) { return reduce(comm, static_cast<int>(value), MPI_INT, MPI_LOR) != 0; }

void sum_in_place(MPI_Comm comm, std::span<double> values) {
  MPI_Allreduce(MPI_IN_PLACE, values.data(), static_cast<int>(values.size()), MPI_DOUBLE, MPI_SUM, comm);
}

void sum_in_place(MPI_Comm comm, std::span<long long> values) {
  MPI_Allreduce(MPI_IN_PLACE, values.data(), static_cast<int>(values.size()), MPI_LONG_LONG, MPI_SUM, comm);
}

void min_in_place(MPI_Comm comm, std::span<double> values) {
  MPI_Allreduce(MPI_IN_PLACE, values.data(), static_cast<int>(values.size()), MPI_DOUBLE, MPI_MIN, comm);
}

long long exclusive_sum(MPI_Comm comm, long long value) {
  long long result = 0;
  MPI_Exscan(&value, &result, 1, MPI_LONG_LONG, MPI_SUM, comm);
  return rank(comm) == 0 ? 0 : result;
}

std::string broadcast(MPI_Comm comm, const std::string& text, int root) {
  auto length = static_cast<long long>(text.size());
  MPI_Bcast(&length, 1, MPI_LONG_LONG, root, comm);
  std::string result = rank(comm) == root ? text : std::string(static_cast<std::size_t>(length), '\0');
  MPI_Bcast(result.data(), static_cast<int>(length), MPI_CHAR, root, comm);
  return result;
}

std::vector<double> all_gather(MPI_Comm comm, double value) {
  std::vector<double> values(static_cast<std::size_t>(size(comm)));
  MPI_Allgather(&value, 1, MPI_DOUBLE, values.data(), 1, MPI_DOUBLE, comm);
  return values;
}

std::string packed_exception() {
  try {
    throw;
  } catch (const InputError& e) {
    return std::string("i") + e.what();
  } catch (const ResourceError& e) {
    return std::string("r") + e.what();
  } catch (const std::bad_alloc&) {
    return "r" + out_of_memory();
  } catch (const std::filesystem::filesystem_error& e) {
    return "r" + e.path1().string() + ": " + e.code().message() + ". Check that the directory exists, is writable and has room";
  } catch (const std::exception& e) {
    return std::string("e") + e.what();
  }
}

void raise(const std::string& packed) {
  const std::string text = packed.substr(1);
  if (packed[0] == 'i') throw InputError(text);
  if (packed[0] == 'r') throw ResourceError(text);
  throw std::runtime_error(text);
}

std::string out_of_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return "out of memory: this rank has used " + std::to_string(usage.ru_maxrss / 1024) +
         " MB and gets no more. Use fewer cells, or more machines; -options_file options/amg.opts needs less than factorising";
}

bool Muster::all_come() const {
  MPI_Request request = MPI_REQUEST_NULL;
  if (MPI_Ibarrier(comm_, &request) != MPI_SUCCESS) return false;
  // The lower ranks give up first, so that one of several speaks.
  const double until = MPI_Wtime() + 2 + 0.2 * rank(comm_);
  int all = 0;
  while (all == 0 && MPI_Wtime() < until) {
    MPI_Test(&request, &all, MPI_STATUS_IGNORE);
    if (all == 0) usleep(1000);
  }
  return all != 0;
}

}  // namespace polyslip::mpi
