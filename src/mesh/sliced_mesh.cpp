#include "polyslip/mesh/sliced_mesh.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <numeric>
#include <span>
#include <utility>

#include "polyslip/common/mpi.hpp"
#include "polyslip/mesh/formats.hpp"
#include "polyslip/mesh/partition.hpp"
#include "polyslip/mesh/slices.hpp"

namespace polyslip::mesh {

namespace {

/// Distinct numbers, none negative, sorted digit by digit: for millions of them several times as fast as by comparing.
std::vector<Index> ascending(std::vector<Index> numbers) {
  constexpr Index base = 2048;
  std::vector<Index> sorted(numbers.size());
  for (int shift = 0; shift < 31; shift += 11) {
    std::array<Index, base + 1> next{};
    for (const Index number : numbers) ++next[(number >> shift) % base + 1];
    std::partial_sum(next.begin(), next.end(), next.begin());
    for (const Index number : numbers) sorted[next[(number >> shift) % base]++] = number;
    numbers.swap(sorted);
  }
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  return numbers;
}

std::vector<Index> united(const std::vector<Index>& a, const std::vector<Index>& b) {
  std::vector<Index> result;
  std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(result));
  return result;
}

std::vector<Index> minus(const std::vector<Index>& a, const std::vector<Index>& b) {
  std::vector<Index> result;
  std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(result));
  return result;
}

/// Finds the places of numbers in an ascending list. A table of where each run of 2^shift numbers begins leaves little to search.
class Places {
 public:
  explicit Places(const std::vector<Index>& numbers) : numbers_(numbers) {
    const Index end = numbers.empty() ? 0 : numbers.back() + 1;
    while ((end >> shift_) > static_cast<Index>(numbers.size())) ++shift_;
    begin_.resize(static_cast<std::size_t>(end >> shift_) + 2, 0);
    for (const Index number : numbers) ++begin_[(number >> shift_) + 1];
    std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  }
  /// Each value becomes its place, or -1 where it is not in the list.
  void replace(std::span<Index> values) const {
    for (Index& value : values) value = find(value);
  }

 private:
  [[nodiscard]] Index find(Index number) const {
    if (number < 0 || numbers_.empty() || number > numbers_.back()) return -1;
    const auto begin = numbers_.begin() + begin_[number >> shift_], end = numbers_.begin() + begin_[(number >> shift_) + 1];
    const auto found = std::lower_bound(begin, end, number);
    return found != end && *found == number ? static_cast<Index>(found - numbers_.begin()) : -1;
  }
  const std::vector<Index>& numbers_;
  int shift_ = 0;
  std::vector<Index> begin_;
};

std::vector<Index> counting(const RowRange& rows) {
  std::vector<Index> result(static_cast<std::size_t>(rows.size));
  std::iota(result.begin(), result.end(), rows.first);
  return result;
}

/// The values of all ranks behind one another, on rank 0.
std::vector<Index> gather_on_root(MPI_Comm comm, const std::vector<Index>& mine) {
  const int size = static_cast<int>(mine.size());
  std::vector<int> sizes(static_cast<std::size_t>(mpi::size(comm))), begins(sizes.size());
  MPI_Gather(&size, 1, MPI_INT, sizes.data(), 1, MPI_INT, 0, comm);
  std::exclusive_scan(sizes.begin(), sizes.end(), begins.begin(), 0);
  std::vector<Index> all(mpi::rank(comm) == 0 ? static_cast<std::size_t>(begins.back() + sizes.back()) : 0);
  MPI_Gatherv(mine.data(), size, MPI_INT32_T, all.data(), sizes.data(), begins.data(), MPI_INT32_T, 0, comm);
  return all;
}

CellGraph gather_on_root(MPI_Comm comm, const CellGraph& mine) {
  std::vector<Index> sizes;
  for (Index row = 0; row < mine.neighbours.rows(); ++row) sizes.push_back(mine.neighbours.row_size(row));
  sizes = gather_on_root(comm, sizes);
  CellGraph all;
  all.neighbours.offsets.resize(sizes.size() + 1, 0);
  std::partial_sum(sizes.begin(), sizes.end(), all.neighbours.offsets.begin() + 1);
  all.neighbours.values = gather_on_root(comm, mine.neighbours.values);
  all.edge_weights = gather_on_root(comm, mine.edge_weights);
  all.cell_weights = gather_on_root(comm, mine.cell_weights);
  return all;
}

/// Distinct nodes of each cell, ascending; `nodes` are those of the faces, entry by entry of cell_faces.
Csr nodes_of_cells(const Csr& cell_faces, const Csr& nodes) {
  Csr result;
  std::vector<Index> row;
  for (Index cell = 0; cell < cell_faces.rows(); ++cell) {
    const auto first = nodes.values.begin();
    row.assign(first + nodes.offsets[cell_faces.offsets[cell]], first + nodes.offsets[cell_faces.offsets[cell + 1]]);
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
    result.push_row(row);
  }
  return result;
}

}  // namespace

SlicedMesh::SlicedMesh(MPI_Comm comm, NativeSlice slice, CellSides sides, Csr cell_nodes)
    : comm_(comm),
      slice_(std::move(slice)),
      sides_(std::move(sides)),
      cell_nodes_(std::move(cell_nodes)),
      node_cells_(cells_around_nodes()),
      across_(cells_across_fractures()) {}

Csr SlicedMesh::cells_around_nodes() const {
  std::vector<Index> cells;
  cells.reserve(cell_nodes_.values.size());
  for (Index cell = 0; cell < slice_.cells.size; ++cell) cells.insert(cells.end(), cell_nodes_[cell].size(), slice_.cells.first + cell);
  return RemoteRows(comm_, slice_.nodes, cell_nodes_.values).collect(cells);
}

Csr SlicedMesh::cells_across_fractures() const {
  const Csr& faces = slice_.mesh.cell_faces;
  Csr result;
  std::vector<Index> cells;
  for (Index cell = 0; cell < faces.rows(); ++cell) {
    cells.clear();
    for (Index i = faces.offsets[cell]; i < faces.offsets[cell + 1]; ++i) {
      if (sides_.on_fracture(i)) cells.insert(cells.end(), sides_.cells[i].begin(), sides_.cells[i].end());
    }
    result.push_row(cells);
  }
  return result;
}

std::vector<Index> SlicedMesh::partition(const PartitionOptions& options) const {
  CellGraph graph = gather_on_root(comm_, cell_graph(slice_.mesh.cell_faces, slice_.cells.first, sides_, options));
  std::vector<Index> part;
  mpi::on_root(comm_, [&] { part = split_graph(std::move(graph), mpi::size(comm_)); });
  return RemoteRows(comm_, rows_behind(comm_, static_cast<Index>(part.size())), counting(slice_.cells)).get(part);
}

/// Every cell reports to its rank; ascending, as the slices of the ranks are.
std::vector<Index> SlicedMesh::owned_cells(const std::vector<Index>& part) const {
  return RemoteRows(comm_, rows_behind(comm_, 1), part).collect(counting(slice_.cells)).values;
}

std::vector<Index> SlicedMesh::around(const std::vector<Index>& cells, std::vector<Index>& seen) const {
  const std::vector<Index> nodes = minus(ascending(RemoteRows(comm_, slice_.cells, cells).get(cell_nodes_).values), seen);
  seen = united(seen, nodes);
  return ascending(RemoteRows(comm_, slice_.nodes, nodes).get(node_cells_).values);
}

Piece SlicedMesh::piece(const std::vector<Index>& part) const {
  std::vector<Index> nodes;
  const std::vector<Index> owned = owned_cells(part), near = around(owned, nodes);
  const std::vector<Index> local = united(near, ascending(RemoteRows(comm_, slice_.cells, near).get(across_).values));
  Piece piece;
  piece.cells = united(local, around(minus(local, owned), nodes));
  fill_cells(piece, part);
  fill_faces(piece);
  return piece;
}

void SlicedMesh::fill_cells(Piece& piece, const std::vector<Index>& part) const {
  PolyMesh& mesh = piece.mesh;
  const RemoteRows cells(comm_, slice_.cells, piece.cells);
  mesh.dim = slice_.mesh.dim;
  mesh.region_names = slice_.mesh.region_names;
  mesh.cell_region = cells.get(slice_.mesh.cell_region);
  piece.part = cells.get(part);
  mesh.cell_faces = cells.get(slice_.mesh.cell_faces);
  piece.faces = ascending(mesh.cell_faces.values);
  Places(piece.faces).replace(mesh.cell_faces.values);
}

std::vector<Index> SlicedMesh::first_entries() const {
  std::vector<Index> result(slice_.mesh.face_nodes.offsets.begin(), slice_.mesh.face_nodes.offsets.end() - 1);
  for (Index& entry : result) entry += slice_.face_corners.first;
  return result;
}

void SlicedMesh::fill_faces(Piece& piece) const {
  PolyMesh& mesh = piece.mesh;
  const RemoteRows faces(comm_, slice_.faces, piece.faces);
  mesh.face_nodes = faces.get(slice_.mesh.face_nodes);
  piece.face_entries = faces.get(first_entries());
  piece.nodes = ascending(mesh.face_nodes.values);
  Places(piece.nodes).replace(mesh.face_nodes.values);
  mesh.nodes = RemoteRows(comm_, slice_.nodes, piece.nodes).get(slice_.mesh.nodes);

  mesh.face_cells = faces.get(slice_.mesh.face_cells);
  const Places cell_places(piece.cells);
  for (auto& cells : mesh.face_cells) {
    cell_places.replace(cells);
    if (cells[0] < 0) std::swap(cells[0], cells[1]);
  }
  mesh.tag_names = slice_.mesh.tag_names;
  mesh.face_tag = faces.get(slice_.mesh.face_tag);
  if (!slice_.fractured) return;
  mesh.fracture_names = slice_.mesh.fracture_names;
  mesh.fracture_length = slice_.mesh.fracture_length;
  mesh.face_fracture = faces.get(slice_.mesh.face_fracture);
  mesh.face_tip_distance = faces.get(slice_.mesh.face_tip_distance);
}

SlicedMesh read_sliced(MPI_Comm comm, const std::filesystem::path& file) {
  NativeSlice slice = mpi::made_together(comm, [&] {
    require_file(file);
    return read_native_slice(file, mpi::rank(comm), mpi::size(comm));
  });
  const PolyMesh& mesh = slice.mesh;
  const RemoteRows faces(comm, slice.faces, mesh.cell_faces.values);
  CellSides sides{.cells = faces.get(mesh.face_cells), .fracture = {}};
  if (slice.fractured) sides.fracture = faces.get(mesh.face_fracture);
  std::vector<Index> used(mesh.nodes.size(), 0);
  RemoteRows(comm, slice.nodes, mesh.face_nodes.values).put(std::vector<Index>(mesh.face_nodes.values.size(), 1), used);
  const long long named = mpi::sum(comm, named_sides(slice));
  mpi::together(comm, [&] { check_native_slice(slice, sides, named, used); });
  Csr cell_nodes = nodes_of_cells(mesh.cell_faces, faces.get(mesh.face_nodes));
  return {comm, std::move(slice), std::move(sides), std::move(cell_nodes)};
}

}  // namespace polyslip::mesh
