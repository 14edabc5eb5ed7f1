// The parts of the ranks against the serial mesh: nothing lost, nothing twice, ghosts complete, numbers agreed on.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/mesh/distributed_mesh.hpp"
#include "polyslip/mesh/halo.hpp"
#include "polyslip/mesh/partition.hpp"
#include "unit/mesh/part_cases.hpp"

namespace polyslip::mesh {
namespace {

TEST(distribution, owns_every_cell_copy_and_fracture_face_exactly_once) {
  for (const auto& [name, serial, part] : cases()) {
    SCOPED_TRACE(name);
    auto cells = gather_all({part.cell_input.begin(), part.cell_input.begin() + part.cells.owned});
    std::sort(cells.begin(), cells.end());
    std::vector<Index> expected(serial.n_cells());
    std::iota(expected.begin(), expected.end(), 0);
    EXPECT_EQ(cells, expected);

    auto faces = gather_all({part.fracture_face_input.begin(), part.fracture_face_input.begin() + part.fractures.owned});
    std::sort(faces.begin(), faces.end());
    expected.clear();
    for (Index f = 0; f < serial.n_faces(); ++f) {
      if (serial.on_fracture(f)) expected.push_back(f);
    }
    EXPECT_EQ(faces, expected);

    for (const Numbering* numbers : {&part.cells, &part.copies, &part.fractures}) {
      EXPECT_EQ(numbers->first, mpi::exclusive_sum(world, numbers->owned));
      EXPECT_EQ(numbers->total, mpi::sum(world, static_cast<long long>(numbers->owned)));
    }
    EXPECT_EQ(part.cells.total, serial.n_cells());
    EXPECT_EQ(part.copies.total, serial.n_copies());
    EXPECT_EQ(part.fractures.total, static_cast<Index>(expected.size()));
    EXPECT_EQ(part.total_faces, serial.n_faces());
    EXPECT_EQ(part.total_nodes, serial.n_nodes());
  }
}

TEST(distribution, keeps_the_serial_order_within_a_rank_or_in_3d_turns_it_round_so_that_cells_at_other_ranks_come_late) {
  for (const auto& [name, serial, part] : cases()) {
    SCOPED_TRACE(name);
    EXPECT_TRUE(is_in_order(part.cell_input, part.cells.owned, is_backwards(part)));
    EXPECT_TRUE(is_in_order(part.fracture_face_input, part.fractures.owned, is_backwards(part)));
    EXPECT_TRUE(serial.dim == 3 || !is_backwards(part));
    std::vector<char> is_seen(part.mesh.n_cells(), 0);
    const auto visit_pairs = [&, &part = part](auto&& visit) {
      for (const auto& [a, b] : part.mesh.face_cells)
        if (std::min(a, b) >= 0 && std::min(a, b) < part.cells.owned) visit(std::min(a, b), std::max(a, b));
    };
    visit_pairs([&, &part = part](Index first, Index second) { is_seen[first] |= second >= part.cells.owned ? 1 : 0; });
    long long before = 0, behind = 0;
    visit_pairs([&, &part = part](Index first, Index second) {
      if (second < part.cells.owned && is_seen[first] != is_seen[second]) ++(is_seen[second] ? before : behind);
    });
    EXPECT_TRUE(serial.dim == 2 || behind <= before) << before << " before, " << behind << " behind";
    for (const Numbering* numbers : {&part.cells, &part.copies, &part.fractures}) {
      EXPECT_TRUE(std::is_sorted(numbers->ghosts.begin(), numbers->ghosts.end()));
    }
  }
}

/// Local cells that a rank must have, by definition, in serial numbers.
std::set<Index> needed_cells(const PolyMesh& serial, const std::vector<Index>& owned) {
  std::vector<std::set<Index>> around(serial.n_nodes());
  for (Index c = 0; c < serial.n_cells(); ++c) {
    for (const Index s : serial.cell_nodes[c]) around[s].insert(c);
  }
  std::set<Index> near;
  for (const Index c : owned) {
    for (const Index s : serial.cell_nodes[c]) near.insert(around[s].begin(), around[s].end());
  }
  std::set<Index> result = near;
  for (const Index c : near) {
    for (const Index f : serial.cell_faces[c]) {
      if (serial.on_fracture(f)) result.insert(serial.face_cells[f].begin(), serial.face_cells[f].end());
    }
  }
  return result;
}

TEST(distribution, ghosts_are_the_cells_around_owned_nodes_and_across_their_fracture_faces) {
  for (const auto& [name, serial, part] : cases()) {
    SCOPED_TRACE(name);
    const std::set<Index> local(part.cell_input.begin(), part.cell_input.end());
    EXPECT_EQ(local.size(), part.cell_input.size());
    EXPECT_EQ(part.mesh.n_cells(), part.cells.local());
    EXPECT_EQ(local, needed_cells(serial, {part.cell_input.begin(), part.cell_input.begin() + part.cells.owned}));
  }
}

TEST(distribution, every_owned_copy_has_all_its_cells_here) {
  for (const auto& [name, serial, part] : cases()) {
    SCOPED_TRACE(name);
    std::vector<Index> seen_in_serial(serial.n_copies(), 0), seen_here(part.mesh.n_copies(), 0),
        serial_copy(part.mesh.n_copies(), -1);
    for (const Index copy : serial.cell_copies) ++seen_in_serial[copy];
    for (Index c = 0; c < part.mesh.n_cells(); ++c) {
      for (std::size_t i = 0; i < part.mesh.copies_of(c).size(); ++i) {
        const Index copy = part.mesh.copies_of(c)[i];
        ++seen_here[copy];
        serial_copy[copy] = serial.copies_of(part.cell_input[c])[i];
      }
    }
    for (Index copy = 0; copy < part.copies.owned; ++copy) EXPECT_EQ(seen_here[copy], seen_in_serial[serial_copy[copy]]);
    EXPECT_TRUE(is_in_order(serial_copy, part.copies.owned, is_backwards(part)));
  }
}

TEST(distribution, a_copy_belongs_to_the_lowest_or_the_highest_rank_that_owns_a_cell_which_sees_it) {
  for (const auto& [name, serial, part] : cases()) {
    SCOPED_TRACE(name);
    std::vector<Index> cell_rank(part.mesh.n_cells(), mpi::rank(world)), copy_rank(part.mesh.n_copies(), mpi::rank(world));
    Halo(world, part.cells).owner_to_ghost(std::span<Index>(cell_rank));
    Halo(world, part.copies).owner_to_ghost(std::span<Index>(copy_rank));
    std::vector<std::set<Index>> ranks(part.mesh.n_copies());
    for (Index c = 0; c < part.mesh.n_cells(); ++c) {
      for (const Index copy : part.mesh.copies_of(c)) ranks[copy].insert(cell_rank[c]);
    }
    for (Index copy = 0; copy < part.copies.owned; ++copy)
      EXPECT_EQ(owner_among(ranks[copy], serial.copy_node[part.copy_input[copy]]), copy_rank[copy]);
  }
}

TEST(distribution, gives_every_rank_nearly_the_same_number_of_copies) {
  const DistributedMesh part = distribute(world, grid(3, {24, 24, 24}, crossing()), PartitionOptions{});
  const double mean = static_cast<double>(part.copies.total) / mpi::size(world);
  EXPECT_NEAR(part.copies.owned, mean, 0.015 * mean);
}

TEST(distribution, local_cells_equal_serial_cells_entry_by_entry) {
  for (const auto& [name, serial, part] : cases()) {
    SCOPED_TRACE(name);
    const PolyMesh& mesh = part.mesh;
    EXPECT_EQ(mesh.dim, serial.dim);
    EXPECT_EQ(mesh.region_names, serial.region_names);
    EXPECT_EQ(mesh.tag_names, serial.tag_names);
    EXPECT_EQ(mesh.fracture_names, serial.fracture_names);
    EXPECT_EQ(mesh.fracture_length, serial.fracture_length);
    for (Index c = 0; c < mesh.n_cells(); ++c) {
      const Index input = part.cell_input[c];
      EXPECT_EQ(mesh.cell_region[c], serial.cell_region[input]);
      ASSERT_EQ(mesh.cell_nodes.row_size(c), serial.cell_nodes.row_size(input));
      for (Index i = 0; i < mesh.cell_nodes.row_size(c); ++i) {
        EXPECT_EQ(mesh.nodes[mesh.cell_nodes[c][i]], serial.nodes[serial.cell_nodes[input][i]]);
        EXPECT_EQ(mesh.copy_node[mesh.copies_of(c)[i]], mesh.cell_nodes[c][i]);
      }
      ASSERT_EQ(mesh.cell_faces.row_size(c), serial.cell_faces.row_size(input));
      for (Index i = 0; i < mesh.cell_faces.row_size(c); ++i) {
        const Index f = mesh.cell_faces[c][i], g = serial.cell_faces[input][i];
        EXPECT_EQ(mesh.face_tag[f], serial.face_tag[g]);
        EXPECT_EQ(mesh.on_fracture(f), serial.on_fracture(g));
        if (mesh.on_fracture(f)) {
          EXPECT_EQ(mesh.face_fracture[f], serial.face_fracture[g]);
          EXPECT_EQ(mesh.face_tip_distance[f], serial.face_tip_distance[g]);
        }
        EXPECT_EQ(part.face_is_boundary[f] != 0, serial.on_boundary(g));
        const bool turned = mesh.orientation(c, f) != serial.orientation(input, g);
        const bool first_is_missing =
            std::find(part.cell_input.begin(), part.cell_input.end(), serial.face_cells[g][0]) == part.cell_input.end();
        EXPECT_EQ(turned, first_is_missing && !serial.on_fracture(g));
        std::vector<Vec3> here, there;
        for (const Index s : mesh.face_nodes[f]) here.push_back(mesh.nodes[s]);
        for (const Index s : serial.face_nodes[g]) there.push_back(serial.nodes[s]);
        if (turned) std::reverse(there.begin() + (serial.dim == 3 ? 1 : 0), there.end());
        EXPECT_EQ(here, there);
      }
    }
  }
}

TEST(distribution, owners_and_ghosts_agree_on_global_numbers) {
  for (const auto& [name, serial, part] : cases()) {
    SCOPED_TRACE(name);
    std::vector<Index> input = part.cell_input;
    const Halo cells(world, part.cells);
    cells.owner_to_ghost(std::span<Index>(input));
    EXPECT_EQ(input, part.cell_input);

    const Index corners = part.mesh.dim == 2 ? 4 : 8;
    std::vector<Index> copies;
    for (const Index copy : part.mesh.cell_copies) copies.push_back(part.copies.global(copy));
    std::vector<Index> from_owner = copies;
    cells.owner_to_ghost(std::span<Index>(from_owner), corners);
    EXPECT_EQ(from_owner, copies);

    input = part.fracture_face_input;
    Halo(world, part.fractures).owner_to_ghost(std::span<Index>(input));
    EXPECT_EQ(input, part.fracture_face_input);
  }
}

TEST(distribution, fracture_faces_with_both_sides_here_are_listed_once_with_the_plus_side_first) {
  for (const auto& [name, serial, part] : cases()) {
    SCOPED_TRACE(name);
    const PolyMesh& mesh = part.mesh;
    std::set<Index> expected;
    for (Index f = 0; f < mesh.n_faces(); ++f) {
      if (mesh.on_fracture(f) && mesh.face_cells[f][0] >= 0 && mesh.face_cells[f][1] >= 0) expected.insert(f);
    }
    EXPECT_EQ(expected, std::set<Index>(part.fracture_faces.begin(), part.fracture_faces.end()));
    EXPECT_EQ(expected.size(), part.fracture_faces.size());
    EXPECT_EQ(part.fractures.local(), static_cast<Index>(part.fracture_faces.size()));
    for (Index i = 0; i < part.fractures.local(); ++i) {
      const auto& sides = mesh.face_cells[part.fracture_faces[i]];
      const auto& serial_sides = serial.face_cells[part.fracture_face_input[i]];
      EXPECT_EQ(part.cell_input[sides[0]], serial_sides[0]);
      EXPECT_EQ(part.cell_input[sides[1]], serial_sides[1]);
      EXPECT_EQ(sides[0] < part.cells.owned, i < part.fractures.owned);
    }
    // What the rows of owned copies need: the + cell that sees the copy's node, and all of its other sides.
    for (Index c = 0; c < mesh.n_cells(); ++c) {
      const auto copies = mesh.copies_of(c);
      const bool sees_owned = std::any_of(copies.begin(), copies.end(), [&](Index copy) { return copy < part.copies.owned; });
      for (const Index f : mesh.cell_faces[c]) {
        EXPECT_TRUE(!sees_owned || !mesh.on_fracture(f) || expected.contains(f));
      }
    }
  }
}

TEST(distribution, moves_the_mesh_on_one_rank) {
  PolyMesh serial = grid(3, {4, 4, 3}, crossing());
  const Vec3* nodes = serial.nodes.data();
  const Index* faces = serial.cell_faces.values.data();
  const DistributedMesh part = distribute(MPI_COMM_SELF, std::move(serial));
  EXPECT_EQ(part.mesh.nodes.data(), nodes);
  EXPECT_EQ(part.mesh.cell_faces.values.data(), faces);
  EXPECT_TRUE(part.cells.ghosts.empty());
}

TEST(distribution, tells_all_ranks_of_bad_parts) {
  const PolyMesh serial = grid(2, {3, 3, 0});
  EXPECT_THROW(distribute(world, PolyMesh(serial), std::vector<Index>(4, 0)), InputError);
  EXPECT_THROW(distribute(world, PolyMesh(serial), std::vector<Index>(9, mpi::size(world))), InputError);
  EXPECT_THROW(distribute(world, PolyMesh()), InputError);
}

TEST(partition, balances_a_grid_of_20x20x20_within_five_per_cent) {
  const PolyMesh mesh = grid(3, {20, 20, 20});
  const auto part = partition_cells(mesh, 2, {});
  const auto first = std::count(part.begin(), part.end(), 0);
  EXPECT_NEAR(static_cast<double>(first), 4000.0, 200.0);
}

TEST(partition, does_not_cut_a_fracture_that_it_can_go_round) {
  // The long box would be cut in the middle, where the fracture is.
  const PolyMesh mesh = grid(3, {12, 4, 4}, [](const Vec3& x, int axis) { return axis == 0 && std::abs(x[0] - 0.5) < 1e-9; });
  const auto part = partition_cells(mesh, 2, {});
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    EXPECT_TRUE(!mesh.on_fracture(f) || part[mesh.face_cells[f][0]] == part[mesh.face_cells[f][1]]);
  }
}

TEST(partition, gives_few_cells_to_as_many_ranks) {
  const PolyMesh mesh = grid(2, {2, 1, 0});
  EXPECT_EQ(partition_cells(mesh, 5, {}), (std::vector<Index>{0, 1}));
}

}  // namespace
}  // namespace polyslip::mesh
