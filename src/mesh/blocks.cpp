#include "polyslip/mesh/blocks.hpp"

#include <algorithm>
#include <numeric>

#include "polyslip/common/mpi.hpp"
#include "polyslip/mesh/halo.hpp"

namespace polyslip::mesh {

namespace {

/// For each local cell the first of those that it is joined to through local cells.
std::vector<Index> joined_locally(const PolyMesh& mesh) {
  std::vector<Index> parent(static_cast<std::size_t>(mesh.n_cells()));
  std::iota(parent.begin(), parent.end(), 0);
  const auto find = [&](Index i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    const auto [first, second] = mesh.face_cells[f];
    if (first < 0 || second < 0 || mesh.on_fracture(f)) continue;
    const Index a = find(first), b = find(second);
    parent[std::max(a, b)] = std::min(a, b);
  }
  for (Index& cell : parent) cell = find(cell);
  return parent;
}

/// For each local cell the smallest serial number in its block.
std::vector<Index> first_cells(const DistributedMesh& mesh) {
  const std::vector<Index> part = joined_locally(mesh.mesh);
  const Halo halo(mesh.comm, mesh.cells);
  std::vector<Index> label(mesh.cell_input.begin(), mesh.cell_input.end());
  for (bool changed = true; mpi::any(mesh.comm, changed);) {
    changed = false;
    std::vector<Index> smallest = label;
    for (std::size_t cell = 0; cell < part.size(); ++cell) smallest[part[cell]] = std::min(smallest[part[cell]], label[cell]);
    for (std::size_t cell = 0; cell < part.size(); ++cell) {
      changed = changed || label[cell] != smallest[part[cell]];
      label[cell] = smallest[part[cell]];
    }
    halo.owner_to_ghost(std::span<Index>(label));
  }
  return label;
}

/// One row a block: its first cell, then that cell's centre; known on all ranks, in order.
std::vector<std::array<double, 4>> gather_roots(const DistributedMesh& mesh, std::span<const Index> label) {
  std::vector<Index> roots;
  for (Index cell = 0; cell < mesh.cells.owned; ++cell)
    if (label[cell] == mesh.cell_input[cell]) roots.push_back(cell);
  const auto here = static_cast<long long>(roots.size());
  std::vector<double> table(4 * static_cast<std::size_t>(mpi::sum(mesh.comm, here)), 0.0);
  auto row = static_cast<std::size_t>(4 * mpi::exclusive_sum(mesh.comm, here));
  for (const Index cell : roots) {
    const Vec3 centre = cell_node_average(mesh.mesh, cell);
    table[row] = mesh.cell_input[cell];
    std::copy(centre.begin(), centre.end(), table.begin() + static_cast<std::ptrdiff_t>(row) + 1);
    row += 4;
  }
  mpi::sum_in_place(mesh.comm, std::span<double>(table));
  std::vector<std::array<double, 4>> rows;
  for (std::size_t i = 0; i < table.size(); i += 4) rows.push_back({table[i], table[i + 1], table[i + 2], table[i + 3]});
  std::sort(rows.begin(), rows.end());
  return rows;
}

}  // namespace

Blocks find_blocks(const DistributedMesh& mesh) {
  const std::vector<Index> label = first_cells(mesh);
  const auto roots = gather_roots(mesh, label);
  Blocks result;
  for (const Index first : label) {
    const auto root = std::lower_bound(roots.begin(), roots.end(), std::array<double, 4>{static_cast<double>(first), -1e300, 0, 0});
    result.of_cell.push_back(static_cast<Index>(root - roots.begin()));
  }
  std::vector<long long> cells(roots.size(), 0);
  for (Index cell = 0; cell < mesh.cells.owned; ++cell) ++cells[result.of_cell[cell]];
  mpi::sum_in_place(mesh.comm, std::span<long long>(cells));
  for (std::size_t b = 0; b < roots.size(); ++b)
    result.blocks.push_back({static_cast<GlobalIndex>(cells[b]), Vec3(roots[b][1], roots[b][2], roots[b][3])});
  return result;
}

}  // namespace polyslip::mesh
