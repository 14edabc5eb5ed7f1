#include "polyslip/mesh/partition.hpp"

#include <fmt/format.h>
#include <metis.h>

#include <new>
#include <numeric>

#include "polyslip/common/error.hpp"

namespace polyslip::mesh {

namespace {

static_assert(sizeof(idx_t) == sizeof(Index), "METIS must be built with 32-bit indices");

constexpr idx_t seed = 1;                 // Any fixed number: the same mesh gives the same parts in every run.
constexpr Index ranks_for_recursion = 8;  // Recursive bisection cuts less up to here; beyond it k-way is as good and faster.

struct Graph {
  std::vector<idx_t> offsets{0}, neighbours;
  std::vector<idx_t> cell_weights, edge_weights;
};

/// Cells that share several faces are joined by one edge with the sum of the weights (METIS wants simple graphs).
Graph cell_graph(const PolyMesh& mesh, const PartitionOptions& options) {
  Graph graph;
  const Index n = mesh.n_cells();
  graph.offsets.reserve(static_cast<std::size_t>(n) + 1);
  graph.neighbours.reserve(mesh.cell_faces.values.size());
  graph.edge_weights.reserve(mesh.cell_faces.values.size());
  graph.cell_weights.assign(n, 1);
  std::vector<Index> slot(n, -1);  // Where the edge to a neighbour stands, valid from the start of the current row on.
  for (Index cell = 0; cell < n; ++cell) {
    const Index row = graph.offsets.back();
    for (const Index face : mesh.cell_faces[cell]) {
      const bool fracture = mesh.on_fracture(face);
      if (fracture) graph.cell_weights[cell] = options.fracture_cell_weight;
      const auto& sides = mesh.face_cells[face];
      const Index other = sides[0] == cell ? sides[1] : sides[0];
      if (other < 0) continue;
      const idx_t weight = fracture ? options.fracture_edge_weight : 1;
      if (slot[other] >= row) {
        graph.edge_weights[slot[other]] += weight;
      } else {
        slot[other] = static_cast<Index>(graph.neighbours.size());
        graph.neighbours.push_back(other);
        graph.edge_weights.push_back(weight);
      }
    }
    graph.offsets.push_back(static_cast<idx_t>(graph.neighbours.size()));
  }
  return graph;
}

}  // namespace

std::vector<Index> partition_cells(const PolyMesh& mesh, Index ranks, const PartitionOptions& options) {
  const Index n = mesh.n_cells();
  std::vector<Index> part(n, 0);
  if (ranks == 1) return part;
  if (n <= ranks) {  // METIS needs more cells than parts.
    std::iota(part.begin(), part.end(), 0);
    return part;
  }
  Graph graph = cell_graph(mesh, options);
  idx_t settings[METIS_NOPTIONS];
  METIS_SetDefaultOptions(settings);
  settings[METIS_OPTION_SEED] = seed;
  idx_t n_cells = n, n_constraints = 1, n_parts = ranks, cut = 0;
  const auto split = ranks <= ranks_for_recursion ? METIS_PartGraphRecursive : METIS_PartGraphKway;
  const int status = split(&n_cells, &n_constraints, graph.offsets.data(), graph.neighbours.data(), graph.cell_weights.data(),
                           nullptr, graph.edge_weights.data(), &n_parts, nullptr, nullptr, settings, &cut, part.data());
  if (status == METIS_ERROR_MEMORY) throw std::bad_alloc();
  if (status != METIS_OK)
    throw InputError(fmt::format("METIS could not split {} cells into {} parts (METIS status {})", n, ranks, status), "mesh partition",
                     "Run on fewer ranks");
  return part;
}

}  // namespace polyslip::mesh
