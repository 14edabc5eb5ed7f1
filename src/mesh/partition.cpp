#include "polyslip/mesh/partition.hpp"

#include <fmt/format.h>
#include <metis.h>

#include <algorithm>
#include <new>
#include <numeric>

#include "polyslip/common/error.hpp"

namespace polyslip::mesh {

namespace {

static_assert(sizeof(idx_t) == sizeof(Index), "METIS must be built with 32-bit indices");

constexpr idx_t seed = 1;                 // Any fixed number: the same mesh gives the same parts in every run.
constexpr Index ranks_for_recursion = 8;  // Recursive bisection cuts less up to here; beyond it k-way is as good and faster.

/// Joins the cell of the row that begins at `row`, the last of the graph, with another. Rows are short enough to be searched.
void join(CellGraph& graph, Index row, Index other, Index weight) {
  std::vector<Index>& neighbours = graph.neighbours.values;
  const auto found = std::find(neighbours.begin() + row, neighbours.end(), other);
  const auto place = found - neighbours.begin();
  if (found == neighbours.end()) {
    neighbours.push_back(other);
    graph.edge_weights.push_back(0);
  }
  graph.edge_weights[place] += weight;
}

}  // namespace

CellGraph cell_graph(const Csr& cell_faces, Index first_cell, const CellSides& sides, const PartitionOptions& options) {
  CellGraph graph;
  graph.neighbours.offsets.reserve(cell_faces.offsets.size());
  graph.neighbours.values.reserve(cell_faces.values.size());
  graph.edge_weights.reserve(cell_faces.values.size());
  graph.cell_weights.assign(cell_faces.rows(), 1);
  for (Index cell = 0; cell < cell_faces.rows(); ++cell) {
    const Index row = graph.neighbours.offsets.back();
    for (Index i = cell_faces.offsets[cell]; i < cell_faces.offsets[cell + 1]; ++i) {
      const bool fracture = sides.on_fracture(i);
      if (fracture) graph.cell_weights[cell] = options.fracture_cell_weight;
      const auto& [first, second] = sides.cells[i];
      const Index other = first == first_cell + cell ? second : first;
      if (other >= 0) join(graph, row, other, fracture ? options.fracture_edge_weight : 1);
    }
    graph.neighbours.offsets.push_back(static_cast<Index>(graph.neighbours.values.size()));
  }
  return graph;
}

std::vector<Index> split_graph(CellGraph&& graph, Index ranks) {
  const Index n = graph.neighbours.rows();
  std::vector<Index> part(n, 0);
  if (ranks == 1) return part;
  if (n <= ranks) {  // METIS needs more cells than parts.
    std::iota(part.begin(), part.end(), 0);
    return part;
  }
  idx_t settings[METIS_NOPTIONS];
  METIS_SetDefaultOptions(settings);
  settings[METIS_OPTION_SEED] = seed;
  idx_t n_cells = n, n_constraints = 1, n_parts = ranks, cut = 0;
  const auto split = ranks <= ranks_for_recursion ? METIS_PartGraphRecursive : METIS_PartGraphKway;
  const int status = split(&n_cells, &n_constraints, graph.neighbours.offsets.data(), graph.neighbours.values.data(),
                           graph.cell_weights.data(), nullptr, graph.edge_weights.data(), &n_parts, nullptr, nullptr, settings, &cut,
                           part.data());
  if (status == METIS_ERROR_MEMORY) throw std::bad_alloc();
  if (status != METIS_OK)
    throw InputError(fmt::format("METIS could not split {} cells into {} parts (METIS status {})", n, ranks, status), "mesh partition",
                     "Run on fewer ranks");
  return part;
}

std::vector<Index> partition_cells(const PolyMesh& mesh, Index ranks, const PartitionOptions& options) {
  return split_graph(cell_graph(mesh.cell_faces, 0, cell_sides(mesh), options), ranks);
}

}  // namespace polyslip::mesh
