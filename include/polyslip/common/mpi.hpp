// Thin, typed wrappers of the few MPI calls that the modules need.
#pragma once

#include <mpi.h>

#include <span>
#include <string>
#include <vector>

namespace polyslip::mpi {

/// To be called before MPI starts: files through ROMIO unless the user has chosen (OMPI_MCA_io). Open MPI's own file layer takes, for each
/// open file, a semaphore of the machine that is named after the file alone: a run that is killed at the wrong moment leaves it taken,
/// and every later run that opens a file of this name waits for ever.
void choose_file_layer();

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
/// Element-wise minimum over the ranks, in place.
void min_in_place(MPI_Comm comm, std::span<double> values);
/// Sum of the values of the lower ranks; 0 on rank 0.
long long exclusive_sum(MPI_Comm comm, long long value);
bool any(MPI_Comm comm, bool value);

/// Sends the text of rank `root` to all ranks.
std::string broadcast(MPI_Comm comm, const std::string& text, int root = 0);
/// One value of each rank, known on all ranks.
std::vector<double> all_gather(MPI_Comm comm, double value);

/// Runs `body` on rank `root` only; if it throws there, every rank throws the same: InputError, ResourceError (also for lack of memory and
/// failures of the file system) or std::runtime_error. Ranks therefore never wait for one that has failed.
template <class Body>
void on_root(MPI_Comm comm, Body&& body, int root = 0);

/// Runs `body` on all ranks; if it throws on some, every rank throws what the lowest of them has thrown. `body` must not communicate, but
/// for one collective call at its end.
template <class Body>
void together(MPI_Comm comm, Body&& body);

/// What `make` returns, or its exception on all ranks alike.
template <class Make>
auto made_together(MPI_Comm comm, Make&& make);

/// The exception that is being handled, as a text for other ranks; raise() throws it there.
std::string packed_exception();
[[noreturn]] void raise(const std::string& packed);

/// The sentence for lack of memory.
std::string out_of_memory();

/// Where ranks that have failed find out whether all have: on a communicator of its own, so that nothing else can be mistaken for it.
class Muster {
 public:
  explicit Muster(MPI_Comm comm) { MPI_Comm_dup(comm, &comm_); }
  ~Muster() { MPI_Comm_free(&comm_); }
  Muster(const Muster&) = delete;
  Muster& operator=(const Muster&) = delete;
  /// Waits for the others, for a few seconds; false when some have not come: they are likely to wait for this rank elsewhere.
  [[nodiscard]] bool all_come() const;

 private:
  MPI_Comm comm_ = MPI_COMM_NULL;
};

/// `block` values of one kind as one MPI unit, for as long as this lives.
class BlockType {
 public:
  BlockType(MPI_Datatype base, int block) {
    MPI_Type_contiguous(block, base, &type_);
    MPI_Type_commit(&type_);
  }
  ~BlockType() { MPI_Type_free(&type_); }
  BlockType(const BlockType&) = delete;
  BlockType& operator=(const BlockType&) = delete;
  operator MPI_Datatype() const { return type_; }  // NOLINT: borrowed on purpose

 private:
  MPI_Datatype type_ = MPI_DATATYPE_NULL;
};

}  // namespace polyslip::mpi

#include "polyslip/common/mpi_impl.hpp"
