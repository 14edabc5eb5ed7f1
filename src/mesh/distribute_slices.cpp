// The parts of a mesh in slices. What cut.cpp makes of a piece is right but for the numbers over all ranks and in the whole mesh, which
// are found here.
#include <algorithm>
#include <numeric>

#include "polyslip/common/mpi.hpp"
#include "polyslip/mesh/cut.hpp"
#include "polyslip/mesh/flow_entities.hpp"
#include "polyslip/mesh/sliced_mesh.hpp"
#include "polyslip/mesh/slices.hpp"

namespace polyslip::mesh {

namespace {

/// How an entity is found in the whole mesh: it stands behind `before` others in a row (a node, a face ...) that has `count` of them.
struct Place {
  Index row, before, count;
};

/// Numbers in the whole mesh of entities that are counted row by row: a row has `usual` of them unless a place on some rank says
/// otherwise.
std::vector<GlobalIndex> numbers_of(MPI_Comm comm, const RowRange& table, Index usual, const std::vector<Place>& places) {
  std::vector<Index> rows, unusual, counts;
  for (const Place& place : places) {
    rows.push_back(place.row);
    if (place.count == usual) continue;
    unusual.push_back(place.row);
    counts.push_back(place.count);
  }
  std::vector<Index> first(static_cast<std::size_t>(table.size), usual);
  RemoteRows(comm, table, unusual).put(counts, first);
  const RowRange entities = rows_behind(comm, std::accumulate(first.begin(), first.end(), Index{0}));
  std::exclusive_scan(first.begin(), first.end(), first.begin(), entities.first);
  std::vector<GlobalIndex> numbers = RemoteRows(comm, table, rows).get(first);
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] += places[i].before;
  return numbers;
}

/// Places of the members, some of the entities of a piece. These are numbered row by row: row_of, ascending, is the row of each in the
/// piece, and row_number the number of that row in the whole mesh.
std::vector<Place> places_of(const std::vector<GlobalIndex>& members, const std::vector<Index>& row_of,
                             const std::vector<Index>& row_number) {
  std::vector<Place> places;
  places.reserve(members.size());
  for (const Index member : members) {
    Index begin = member, end = member + 1;
    while (begin > 0 && row_of[begin - 1] == row_of[member]) --begin;
    while (end < static_cast<Index>(row_of.size()) && row_of[end] == row_of[member]) ++end;
    places.push_back({row_number[row_of[member]], member - begin, end - begin});
  }
  return places;
}

/// Each ridge of the piece is a row of its own: its place in the nodes of the first fracture face that has it.
std::vector<Index> ridge_rows(const Piece& piece, const FlowEntities& flow) {
  std::vector<Index> rows;
  const std::vector<Index> faces = inner_fracture_faces(piece.mesh);
  for (std::size_t k = 0; k < faces.size(); ++k) {
    const auto ridges = flow.fracture_ridges[static_cast<Index>(k)];
    for (std::size_t i = 0; i < ridges.size(); ++i) {
      if (ridges[i] == static_cast<Index>(rows.size())) rows.push_back(piece.face_entries[faces[k]] + static_cast<Index>(i));
    }
  }
  return rows;
}

/// Owned entities count on from rank to rank; ghosts learn their numbers from their owners, who leave them by `input`, the number in the
/// whole mesh.
void number_over_ranks(MPI_Comm comm, Numbering& numbering, const std::vector<GlobalIndex>& input) {
  const RowRange owned = rows_behind(comm, numbering.owned);
  numbering.first = owned.first;
  numbering.total = owned.total;
  const long long largest = input.empty() ? -1 : *std::max_element(input.begin(), input.end());
  const auto table = RowRange::slice(static_cast<Index>(mpi::max(comm, largest)) + 1, mpi::rank(comm), mpi::size(comm));
  std::vector<GlobalIndex> mine(static_cast<std::size_t>(numbering.owned)), left(static_cast<std::size_t>(table.size), -1);
  std::iota(mine.begin(), mine.end(), owned.first);
  const auto ghosts = input.begin() + numbering.owned;
  RemoteRows(comm, table, {input.begin(), ghosts}).put(mine, left);
  numbering.ghosts = RemoteRows(comm, table, {ghosts, input.end()}).get(left);
}

void look_up(std::vector<GlobalIndex>& places, const std::vector<Index>& numbers) {
  for (GlobalIndex& place : places) place = numbers[place];
}

void number_flow(MPI_Comm comm, const Piece& piece, const FlowEntities& of_piece, const RowRange& faces, const RowRange& corners,
                 FlowEntities& flow) {
  flow.trace_input = numbers_of(comm, faces, 1, places_of(flow.trace_input, of_piece.trace_face, piece.faces));
  number_over_ranks(comm, flow.traces, flow.trace_input);
  std::vector<Place> ridges;
  const std::vector<Index> rows = ridge_rows(piece, of_piece);
  for (const Index ridge : flow.ridge_input) ridges.push_back({rows[ridge], 0, 1});
  flow.ridge_input = numbers_of(comm, corners, 0, ridges);
  number_over_ranks(comm, flow.ridges, flow.ridge_input);
}

}  // namespace

DistributedMesh distribute(SlicedMesh&& mesh, const std::vector<Index>& part, const PartitionOptions& options) {
  const MPI_Comm comm = mesh.comm();
  const RowRange nodes = mesh.slice().nodes, faces = mesh.slice().faces, corners = mesh.slice().face_corners;
  Piece piece = mesh.piece(part);
  mpi::together(comm, [&] { orient_native(mesh.slice().file, piece.mesh, piece.cells, piece.faces); });
  { const SlicedMesh freed = std::move(mesh); }
  build_copies(piece.mesh);
  const FlowEntities flow = options.flow ? flow_entities(piece.mesh) : FlowEntities();
  const WholeNumbers numbers{.nodes = piece.nodes, .faces = piece.faces};
  const char early = borders_come_early(piece.mesh, piece.part, mpi::size(comm))[mpi::rank(comm)];  // of others the piece does not tell
  const std::vector<double> all_early = mpi::all_gather(comm, early);
  DistributedMesh mine = PartCutter(piece.mesh, piece.part, {all_early.begin(), all_early.end()}, flow, numbers).cut(mpi::rank(comm));

  mine.comm = comm;
  mine.total_nodes = nodes.total;
  mine.total_faces = faces.total;
  look_up(mine.cell_input, piece.cells);
  number_over_ranks(comm, mine.cells, mine.cell_input);
  look_up(mine.fracture_face_input, piece.faces);
  number_over_ranks(comm, mine.fractures, mine.fracture_face_input);
  mine.copy_input = numbers_of(comm, nodes, 1, places_of(mine.copy_input, piece.mesh.copy_node, piece.nodes));
  number_over_ranks(comm, mine.copies, mine.copy_input);
  if (options.flow) number_flow(comm, piece, flow, faces, corners, mine.flow);
  return mine;
}

DistributedMesh distribute(SlicedMesh&& mesh, const PartitionOptions& options) {
  const std::vector<Index> part = mesh.partition(options);
  return distribute(std::move(mesh), part, options);
}

}  // namespace polyslip::mesh
