#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/mesh/cut.hpp"
#include "polyslip/mesh/distributed_mesh.hpp"
#include "polyslip/mesh/flow_entities.hpp"
#include "polyslip/mesh/packing.hpp"
#include "polyslip/mesh/partition.hpp"

namespace polyslip::mesh {

namespace {

constexpr std::size_t largest_message = std::size_t{1} << 30;  // Bytes; an MPI count is a 32-bit int.
constexpr int tag = 1;

/// Calls visit(bytes) for pieces of a run that a message can hold.
template <class Byte, class Visit>
void by_messages(std::span<Byte> run, Visit&& visit) {
  for (; !run.empty(); run = run.subspan(std::min(largest_message, run.size()))) visit(run.first(std::min(largest_message, run.size())));
}

/// A part on its way to its rank.
class Parcel {
 public:
  explicit Parcel(DistributedMesh&& part) : part_(std::move(part)) {
    visit_fields(packer_, std::as_const(part_));
    size_ = packer_.bytes().size();
  }
  void send(MPI_Comm comm, int to) {
    MPI_Isend(&size_, 1, MPI_UINT64_T, to, tag, comm, &requests_.emplace_back());
    const auto send_run = [&](std::span<const std::byte> run) {
      by_messages(run, [&](std::span<const std::byte> piece) {
        MPI_Isend(piece.data(), static_cast<int>(piece.size()), MPI_BYTE, to, tag, comm, &requests_.emplace_back());
      });
    };
    send_run(packer_.bytes());
    for (const auto array : packer_.arrays()) send_run(array);
  }
  void wait() { MPI_Waitall(static_cast<int>(requests_.size()), requests_.data(), MPI_STATUSES_IGNORE); }

 private:
  DistributedMesh part_;
  Packer packer_;
  std::uint64_t size_ = 0;
  std::vector<MPI_Request> requests_;
};

DistributedMesh receive_part(MPI_Comm comm, int from) {
  const auto fetch = [=](std::span<std::byte> run) {
    by_messages(run, [&](std::span<std::byte> piece) {
      MPI_Recv(piece.data(), static_cast<int>(piece.size()), MPI_BYTE, from, tag, comm, MPI_STATUS_IGNORE);
    });
  };
  std::uint64_t size = 0;
  MPI_Recv(&size, 1, MPI_UINT64_T, from, tag, comm, MPI_STATUS_IGNORE);
  std::vector<std::byte> bytes(size);
  fetch(bytes);
  Unpacker unpacker(std::move(bytes), fetch);
  DistributedMesh part;
  visit_fields(unpacker, part);
  return part;
}

/// The whole mesh as the part of the only rank: arrays are moved, not copied.
DistributedMesh whole_part(PolyMesh&& serial, const PartitionOptions& options) {
  DistributedMesh part;
  part.mesh = std::move(serial);
  const PolyMesh& mesh = part.mesh;
  part.cells = all_owned(mesh.n_cells());
  part.copies = all_owned(mesh.n_copies());
  part.cell_input = counted(part.cells);
  part.copy_input = counted(part.copies);
  part.face_is_boundary.resize(mesh.n_faces());
  for (Index face = 0; face < mesh.n_faces(); ++face) part.face_is_boundary[face] = mesh.on_boundary(face) ? 1 : 0;
  part.fracture_faces = inner_fracture_faces(mesh);
  part.fractures = all_owned(static_cast<Index>(part.fracture_faces.size()));
  part.fracture_face_input = part.fracture_faces;
  part.total_faces = mesh.n_faces();
  part.total_nodes = mesh.n_nodes();
  if (options.flow) part.flow = flow_entities(mesh);
  return part;
}

/// Rank 0 cuts and sends part by part, so that beside the whole mesh it holds the one under way and the next, and keeps its own.
DistributedMesh cut_and_send(MPI_Comm comm, const PolyMesh& serial, const std::vector<Index>& part,
                             const PartitionOptions& options) {
  const int ranks = mpi::size(comm);
  PartCutter cutter(serial, part, borders_come_early(serial, part, ranks), options.flow ? flow_entities(serial) : FlowEntities());
  std::optional<Parcel> under_way;
  const auto cut = [&](int rank) {
    DistributedMesh next = cutter.cut(rank);
    if (under_way) under_way->wait();
    return next;
  };
  for (int rank = 1; rank < ranks; ++rank) under_way.emplace(cut(rank)).send(comm, rank);
  return cut(0);
}

void check_mesh(const PolyMesh& serial) {
  if (serial.n_cells() == 0) throw InputError("the mesh has no cells", "mesh partition");
  if (serial.cell_nodes.rows() != serial.n_cells()) {
    throw std::logic_error("distribute: the copies of the serial mesh are not built; call build_copies first");
  }
}

void check_part(const PolyMesh& serial, const std::vector<Index>& part, int ranks) {
  if (part.size() != static_cast<std::size_t>(serial.n_cells())) {
    throw InputError(fmt::format("{} parts are given for {} cells", part.size(), serial.n_cells()), "mesh partition");
  }
  const auto bad = std::find_if(part.begin(), part.end(), [&](Index rank) { return rank < 0 || rank >= ranks; });
  if (bad != part.end()) {
    throw InputError(fmt::format("cell {} is given to rank {}, but there are {} ranks", bad - part.begin(), *bad, ranks),
                     "mesh partition");
  }
}

/// `choose_part` gives the rank of each cell; it runs on rank 0 only and its errors reach all ranks.
template <class ChoosePart>
DistributedMesh distribute_by(MPI_Comm comm, PolyMesh&& serial, const PartitionOptions& options, ChoosePart&& choose_part) {
  PolyMesh whole = std::move(serial);  // freed on return, on every rank
  std::vector<Index> part;
  mpi::on_root(comm, [&] {
    check_mesh(whole);
    part = choose_part(whole);
  });
  DistributedMesh mine;
  if (mpi::size(comm) == 1) {
    mine = whole_part(std::move(whole), options);
  } else if (mpi::rank(comm) == 0) {
    mine = cut_and_send(comm, whole, part, options);
  } else {
    mine = receive_part(comm, 0);
  }
  mine.comm = comm;
  return mine;
}

}  // namespace

std::vector<Index> fracture_numbers(const DistributedMesh& mesh) {
  std::vector<Index> number(static_cast<std::size_t>(mesh.mesh.n_faces()), -1);
  for (std::size_t k = 0; k < mesh.fracture_faces.size(); ++k) number[mesh.fracture_faces[k]] = static_cast<Index>(k);
  return number;
}

DistributedMesh distribute(MPI_Comm comm, PolyMesh&& serial, const PartitionOptions& options) {
  const int ranks = mpi::size(comm);
  return distribute_by(comm, std::move(serial), options, [&](const PolyMesh& whole) {
    return ranks == 1 ? std::vector<Index>() : partition_cells(whole, ranks, options);
  });
}

DistributedMesh distribute(MPI_Comm comm, PolyMesh&& serial, const std::vector<Index>& part,
                           const PartitionOptions& options) {
  return distribute_by(comm, std::move(serial), options, [&](const PolyMesh& whole) {
    check_part(whole, part, mpi::size(comm));
    return part;
  });
}

}  // namespace polyslip::mesh
