// Ranks that share unknowns, in an order in which they can work one after the other, and messages between them.
#pragma once

#include <span>
#include <vector>

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// A rank beside this one.
struct Neighbour {
  int rank = 0, colour = 0;
  std::vector<PetscInt> nodes;   ///< Of this rank, that the other sees, in the order in which they are its ghosts.
  std::vector<PetscInt> ghosts;  ///< Of the other, by their place among the ghosts of this rank.
};

/// The ranks that own some of the ghosts (global numbers, ascending) or have some of the nodes of this rank as ghosts, by rank.
std::vector<Neighbour> find_neighbours(MPI_Comm comm, PetscInt nodes, const std::vector<PetscInt>& ghosts);

/// Each rank takes the lowest colour that no lower rank beside it has; returns that of this one, and sets those of the neighbours.
int choose_colours(MPI_Comm comm, PetscMPIInt tag, std::span<Neighbour> neighbours);

/// Messages between this rank and those beside it.
class Exchange {
 public:
  Exchange(MPI_Comm comm, PetscMPIInt tag) : comm_(comm), tag_(tag) {}

  /// The buffer must stay until finish().
  template <class T>
  void send(int rank, const std::vector<T>& buffer) {
    MPI_Isend(buffer.data(), static_cast<int>(buffer.size()), type(buffer), rank, tag_, comm_, &requests_.emplace_back());
  }
  template <class T>
  void receive(int rank, std::vector<T>& buffer) {
    MPI_Status status;
    int n = 0;
    MPI_Probe(rank, tag_, comm_, &status);
    MPI_Get_count(&status, type(buffer), &n);
    buffer.resize(static_cast<std::size_t>(n));
    MPI_Recv(buffer.data(), n, type(buffer), rank, tag_, comm_, MPI_STATUS_IGNORE);
  }
  /// Until all that was sent has gone.
  void finish() {
    MPI_Waitall(static_cast<int>(requests_.size()), requests_.data(), MPI_STATUSES_IGNORE);
    requests_.clear();
  }

 private:
  static MPI_Datatype type(const std::vector<float>&) { return MPI_FLOAT; }
  static MPI_Datatype type(const std::vector<double>&) { return MPI_DOUBLE; }
  static MPI_Datatype type(const std::vector<PetscInt>&) { return MPIU_INT; }

  MPI_Comm comm_;
  PetscMPIInt tag_;
  std::vector<MPI_Request> requests_;
};

}  // namespace polyslip::la
