// Serial meshes and what this rank gets of them, for the tests of distribution.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "polyslip/common/mpi.hpp"
#include "polyslip/mesh/distributed_mesh.hpp"
#include "unit/mesh/grid.hpp"

namespace polyslip::mesh {

inline const MPI_Comm world = MPI_COMM_WORLD;

inline std::vector<Index> gather_all(const std::vector<Index>& mine) {
  int n = static_cast<int>(mine.size());
  std::vector<int> counts(mpi::size(world)), starts(mpi::size(world));
  MPI_Allgather(&n, 1, MPI_INT, counts.data(), 1, MPI_INT, world);
  std::exclusive_scan(counts.begin(), counts.end(), starts.begin(), 0);
  std::vector<Index> all(starts.back() + counts.back());
  MPI_Allgatherv(mine.data(), n, MPI_INT, all.data(), counts.data(), starts.data(), MPI_INT, world);
  return all;
}

/// Planes across x, y and z in the middle; a cross in 2D.
inline FractureMark three_planes() {
  return [](const Vec3& x, int axis) { return std::abs(x[axis] - 0.5) < 1e-9; };
}

/// A serial mesh (known to every rank here), how it was split, and this rank's part.
struct Case {
  std::string name;
  PolyMesh serial;
  DistributedMesh part;
};

inline std::vector<std::pair<std::string, std::vector<Index>>> splits(Index n, Index ranks) {
  std::vector<Index> blocks(n), scattered(n), last(n, ranks - 1), single_cell(n, 0);
  for (Index c = 0; c < n; ++c) blocks[c] = static_cast<Index>(static_cast<long>(c) * ranks / n);
  for (Index c = 0; c < n; ++c) scattered[c] = (c * 7919 + c / 5) % ranks;
  single_cell[n / 2] = ranks - 1;
  return {{"blocks", blocks}, {"scattered", scattered}, {"all on the last rank", last}, {"one cell on the last rank", single_cell}};
}

/// The owner of what cells of these ranks see, its node or face by the number in the whole mesh: the lowest or the highest, by runs of 256.
inline Index owner_among(const std::set<Index>& ranks, Index number) {
  return number / 256 % 2 == 0 ? *ranks.begin() : *ranks.rbegin();
}

/// Meshes with and without fractures, each split by METIS and in bad ways.
inline std::vector<Case> cases(const PartitionOptions& options = {}) {
  std::vector<Case> result;
  const std::vector<std::pair<std::string, PolyMesh>> meshes{
      {"2D, no fracture", grid(2, {5, 4, 0})},
      {"2D, crossing", grid(2, {8, 6, 0}, crossing())},
      {"3D, crossing", grid(3, {4, 4, 3}, crossing())},
      {"3D, three planes that meet", grid(3, {4, 4, 4}, three_planes())},
      {"3D, some runs of nodes and faces", grid(3, {10, 9, 8}, crossing())},
      {"2D, every face a fracture", grid(2, {9, 5, 0}, [](auto&, int) { return true; })},
      {"3D, every face a fracture", grid(3, {4, 3, 3}, [](auto&, int) { return true; })}};
  for (const auto& [name, mesh] : meshes) {
    result.push_back({name + ", METIS", mesh, distribute(world, PolyMesh(mesh), options)});
    for (const auto& [how, part] : splits(mesh.n_cells(), mpi::size(world))) {
      result.push_back({name + ", " + how, mesh, distribute(world, PolyMesh(mesh), part, options)});
    }
  }
  return result;
}

/// Whether a rank has its entities from the last one of the serial mesh to the first.
inline bool is_backwards(const DistributedMesh& part) { return part.cells.owned > 1 && part.cell_input[0] > part.cell_input[1]; }

/// Whether the first ones of the input numbers ascend, or descend.
template <class Number>
bool is_in_order(const std::vector<Number>& input, Index owned, bool backwards) {
  return backwards ? std::is_sorted(input.begin(), input.begin() + owned, std::greater<>()) : std::is_sorted(input.begin(), input.begin() + owned);
}

}  // namespace polyslip::mesh
