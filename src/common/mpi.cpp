#include "polyslip/common/mpi.hpp"

#include <cstdlib>

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

}  // namespace polyslip::mpi
