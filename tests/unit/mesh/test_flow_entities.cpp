// Traces and ridges of whole meshes, counted by hand, and of the parts of the ranks against the serial mesh.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "polyslip/mesh/face_tools.hpp"
#include "polyslip/mesh/flow_entities.hpp"
#include "polyslip/mesh/halo.hpp"
#include "unit/mesh/part_cases.hpp"

namespace polyslip::mesh {
namespace {

/// Number of fracture faces at each ridge.
std::vector<Index> faces_at_ridges(const FlowEntities& flow) {
  std::vector<Index> count(flow.ridge_nodes.size(), 0);
  for (const Index ridge : flow.fracture_ridges.values) ++count[ridge];
  return count;
}

/// Ridges at which exactly n fracture faces meet.
Index ridges_with(const FlowEntities& flow, Index n) {
  const auto count = faces_at_ridges(flow);
  return static_cast<Index>(std::count(count.begin(), count.end(), n));
}

Index ridges_on_boundary(const FlowEntities& flow) {
  Index n = 0;
  for (Index ridge = 0; ridge < flow.ridge_boundary_faces.rows(); ++ridge) n += flow.ridge_boundary_faces.row_size(ridge) > 0;
  return n;
}

TEST(flow_entities, a_node_where_two_fractures_cross_is_one_ridge_of_four_faces) {
  const PolyMesh mesh = grid(2, {4, 4, 0}, three_planes());
  const FlowEntities flow = flow_entities(mesh);
  EXPECT_EQ(flow.traces.total, mesh.n_faces() + 8);
  EXPECT_EQ(flow.ridges.total, 9);
  EXPECT_EQ(ridges_with(flow, 4), 1);
  EXPECT_EQ(ridges_with(flow, 2), 4);
  EXPECT_EQ(ridges_with(flow, 1), 4);
  EXPECT_EQ(ridges_on_boundary(flow), 4);
  const auto count = faces_at_ridges(flow);
  const auto middle = std::find(count.begin(), count.end(), 4) - count.begin();
  EXPECT_EQ(mesh.nodes[flow.ridge_nodes[middle][0]], Vec3(0.5, 0.5, 0));
  EXPECT_EQ(flow.ridge_nodes[middle][1], -1);
}

TEST(flow_entities, a_t_is_one_ridge_of_three_faces) {
  const FlowEntities flow = flow_entities(grid(
      2, {4, 4, 0}, [](const Vec3& x, int axis) { return std::abs(x[axis] - 0.5) < 1e-9 && (axis == 0 || x[0] < 0.5); }));
  EXPECT_EQ(flow.ridges.total, 7);
  EXPECT_EQ(ridges_with(flow, 3), 1);
  EXPECT_EQ(ridges_on_boundary(flow), 3);
}

TEST(flow_entities, a_corner_is_one_ridge_of_two_faces_and_a_tip_inside_is_off_the_boundary) {
  // An L whose arms end one cell before the boundary: five nodes less the two on the boundary.
  const FlowEntities flow = flow_entities(grid(2, {4, 4, 0}, [](const Vec3& x, int axis) {
    return std::abs(x[axis] - 0.5) < 1e-9 && x[1 - axis] < 0.5 && x[1 - axis] > 0.25;
  }));
  EXPECT_EQ(flow.ridges.total, 3);
  EXPECT_EQ(ridges_with(flow, 2), 1);
  EXPECT_EQ(ridges_with(flow, 1), 2);
  EXPECT_EQ(ridges_on_boundary(flow), 0);
}

TEST(flow_entities, three_planes_meet_along_edges_of_four_faces) {
  const PolyMesh mesh = grid(3, {2, 2, 2}, three_planes());
  const FlowEntities flow = flow_entities(mesh);
  EXPECT_EQ(flow.traces.total, mesh.n_faces() + 12);
  EXPECT_EQ(flow.ridges.total, 3 * 12 - 3 * 2);  // 12 edges a plane; each of three lines of 2 edges lies in two planes
  EXPECT_EQ(ridges_with(flow, 4), 6);
  EXPECT_EQ(ridges_with(flow, 1), 24);
  EXPECT_EQ(ridges_on_boundary(flow), 24);
  for (Index ridge = 0; ridge < flow.ridges.total; ++ridge) {
    const bool on_boundary = flow.ridge_boundary_faces.row_size(ridge) > 0;
    EXPECT_EQ(flow.ridge_boundary_faces.row_size(ridge), on_boundary ? 2 : 0);
  }
}

TEST(flow_entities, ridges_of_a_face_are_aligned_with_its_nodes) {
  for (const PolyMesh& mesh : {grid(2, {8, 6, 0}, crossing()), grid(3, {4, 4, 3}, crossing())}) {
    const FlowEntities flow = flow_entities(mesh);
    const auto faces = inner_fracture_faces(mesh);
    ASSERT_EQ(flow.fracture_ridges.rows(), static_cast<Index>(faces.size()));
    for (std::size_t i = 0; i < faces.size(); ++i) {
      const auto nodes = mesh.face_nodes[faces[i]];
      const auto ridges = flow.fracture_ridges[static_cast<Index>(i)];
      ASSERT_EQ(ridges.size(), nodes.size());
      for (std::size_t k = 0; k < nodes.size(); ++k) {
        const auto& ends = flow.ridge_nodes[ridges[k]];
        const Index next = mesh.dim == 2 ? -1 : nodes[(k + 1) % nodes.size()];
        EXPECT_EQ(std::set<Index>(ends.begin(), ends.end()), (std::set<Index>{nodes[k], next}));
      }
    }
  }
}

std::vector<Case> flow_cases() { return cases({.flow = true}); }

template <class T>
std::vector<T> first(const std::vector<T>& values, Index n) {
  return {values.begin(), values.begin() + n};
}

TEST(flow_parts, own_every_trace_and_ridge_exactly_once_in_serial_order) {
  for (const auto& [name, serial, part] : flow_cases()) {
    SCOPED_TRACE(name);
    const FlowEntities whole = flow_entities(serial);
    const auto check = [backwards = is_backwards(part)](const Numbering& numbers, const std::vector<GlobalIndex>& input, GlobalIndex total) {
      auto all = gather_all(first(input, numbers.owned));
      std::sort(all.begin(), all.end());
      std::vector<GlobalIndex> expected(total);
      std::iota(expected.begin(), expected.end(), 0);
      EXPECT_EQ(all, expected);
      EXPECT_EQ(numbers.total, total);
      EXPECT_EQ(numbers.first, mpi::exclusive_sum(world, numbers.owned));
      EXPECT_EQ(numbers.local(), static_cast<Index>(input.size()));
      EXPECT_TRUE(is_in_order(input, numbers.owned, backwards));
      EXPECT_TRUE(std::is_sorted(numbers.ghosts.begin(), numbers.ghosts.end()));
    };
    check(part.flow.traces, part.flow.trace_input, whole.traces.total);
    check(part.flow.ridges, part.flow.ridge_input, whole.ridges.total);
    EXPECT_FALSE(part.flow.empty());
  }
}

TEST(flow_parts, local_cells_see_the_traces_they_see_in_the_serial_mesh) {
  for (const auto& [name, serial, part] : flow_cases()) {
    SCOPED_TRACE(name);
    const FlowEntities whole = flow_entities(serial);
    const FlowEntities& flow = part.flow;
    ASSERT_EQ(static_cast<Index>(flow.face_traces.size()), part.mesh.n_faces());
    std::set<Index> seen;
    for (Index c = 0; c < part.mesh.n_cells(); ++c) {
      for (Index i = 0; i < part.mesh.cell_faces.row_size(c); ++i) {
        const Index f = part.mesh.cell_faces[c][i], g = serial.cell_faces[part.cell_input[c]][i];
        const Index trace = flow.face_traces[f][part.mesh.face_cells[f][0] == c ? 0 : 1];
        ASSERT_GE(trace, 0);
        EXPECT_EQ(flow.trace_input[trace], whole.face_traces[g][serial.face_cells[g][0] == part.cell_input[c] ? 0 : 1]);
        EXPECT_EQ(flow.trace_face[trace], f);
        seen.insert(trace);
      }
    }
    EXPECT_EQ(static_cast<Index>(seen.size()), flow.traces.local());
    for (Index f = 0; f < part.mesh.n_faces(); ++f) {
      for (int side = 0; side < 2; ++side) EXPECT_EQ(flow.face_traces[f][side] < 0, part.mesh.face_cells[f][side] < 0);
    }
  }
}

TEST(flow_parts, every_cell_that_sees_an_owned_trace_is_here) {
  for (const auto& [name, serial, part] : flow_cases()) {
    SCOPED_TRACE(name);
    for (Index trace = 0; trace < part.flow.traces.owned; ++trace) {
      const Index f = part.flow.trace_face[trace];
      EXPECT_GE(part.mesh.face_cells[f][0], 0);
      EXPECT_EQ(part.mesh.face_cells[f][1] < 0, part.face_is_boundary[f] != 0);
    }
  }
}

TEST(flow_parts, fracture_faces_and_boundary_faces_around_an_owned_ridge_are_all_here) {
  for (const auto& [name, serial, part] : flow_cases()) {
    SCOPED_TRACE(name);
    const FlowEntities whole = flow_entities(serial);
    const auto here = faces_at_ridges(part.flow), there = faces_at_ridges(whole);
    for (Index ridge = 0; ridge < part.flow.ridges.owned; ++ridge) {
      const Index input = part.flow.ridge_input[ridge];
      EXPECT_EQ(here[ridge], there[input]);
      std::set<std::array<double, 3>> centres, expected;
      const auto add = [](auto& set, const Vec3& x) { set.insert({x[0], x[1], x[2]}); };
      for (const Index f : part.flow.ridge_boundary_faces[ridge]) {
        EXPECT_TRUE(part.face_is_boundary[f]);
        add(centres, node_average(part.mesh, f));
      }
      for (const Index f : whole.ridge_boundary_faces[input]) add(expected, node_average(serial, f));
      EXPECT_EQ(centres, expected);
    }
  }
}

TEST(flow_parts, local_fracture_faces_have_their_serial_ridges) {
  for (const auto& [name, serial, part] : flow_cases()) {
    SCOPED_TRACE(name);
    const FlowEntities whole = flow_entities(serial);
    const auto faces = inner_fracture_faces(serial);
    ASSERT_EQ(part.flow.fracture_ridges.rows(), part.fractures.local());
    for (Index i = 0; i < part.fractures.local(); ++i) {
      const auto place = std::lower_bound(faces.begin(), faces.end(), part.fracture_face_input[i]) - faces.begin();
      const auto expected = whole.fracture_ridges[static_cast<Index>(place)];
      std::vector<Index> ridges;
      for (const Index ridge : part.flow.fracture_ridges[i]) ridges.push_back(part.flow.ridge_input[ridge]);
      EXPECT_EQ(ridges, std::vector<Index>(expected.begin(), expected.end()));
    }
    for (Index ridge = 0; ridge < part.flow.ridges.local(); ++ridge) {
      for (int end = 0; end < serial.dim - 1; ++end) {
        EXPECT_EQ(part.mesh.nodes[part.flow.ridge_nodes[ridge][end]],
                  serial.nodes[whole.ridge_nodes[part.flow.ridge_input[ridge]][end]]);
      }
    }
  }
}

TEST(flow_parts, belong_to_one_of_the_ranks_that_own_what_sees_them) {
  for (const auto& [name, serial, part] : flow_cases()) {
    SCOPED_TRACE(name);
    const auto ranks_of = [](const Numbering& numbers) {
      std::vector<Index> ranks(numbers.local(), mpi::rank(world));
      Halo(world, numbers).owner_to_ghost(std::span<Index>(ranks));
      return ranks;
    };
    const auto cell_rank = ranks_of(part.cells), fracture_rank = ranks_of(part.fractures);
    const FlowEntities whole = flow_entities(serial);
    std::vector<std::set<Index>> traces(part.flow.traces.local());
    std::vector<Index> ridges(part.flow.ridges.local(), mpi::size(world));
    for (Index f = 0; f < part.mesh.n_faces(); ++f) {
      for (int side = 0; side < 2; ++side) {
        const Index trace = part.flow.face_traces[f][side];
        if (trace >= 0) traces[trace].insert(cell_rank[part.mesh.face_cells[f][side]]);
      }
    }
    for (Index i = 0; i < part.fractures.local(); ++i) {
      for (const Index ridge : part.flow.fracture_ridges[i]) ridges[ridge] = std::min(ridges[ridge], fracture_rank[i]);
    }
    for (Index trace = 0; trace < part.flow.traces.owned; ++trace)
      EXPECT_EQ(owner_among(traces[trace], whole.trace_face[part.flow.trace_input[trace]]), mpi::rank(world));
    EXPECT_EQ(first(ridges, part.flow.ridges.owned), std::vector<Index>(part.flow.ridges.owned, mpi::rank(world)));
  }
}

TEST(flow_parts, the_owners_centres_arrive_at_the_ghosts) {
  for (const auto& [name, serial, part] : flow_cases()) {
    SCOPED_TRACE(name);
    const PolyMesh& mesh = part.mesh;
    const auto check = [](const Numbering& numbers, const std::vector<double>& centres) {
      std::vector<double> values = centres;
      std::fill(values.begin() + 3 * numbers.owned, values.end(), -1.0);
      Halo(world, numbers).owner_to_ghost(std::span<double>(values), 3);
      for (std::size_t i = 0; i < values.size(); ++i) EXPECT_DOUBLE_EQ(values[i], centres[i]);  // turned faces sum in another order
    };
    std::vector<double> traces, ridges;
    for (const Index f : part.flow.trace_face) {
      const Vec3 x = node_average(mesh, f);
      traces.insert(traces.end(), x.begin(), x.end());
    }
    for (const auto& [a, b] : part.flow.ridge_nodes) {
      const Vec3 x = b < 0 ? mesh.nodes[a] : Vec3(0.5 * (mesh.nodes[a] + mesh.nodes[b]));
      ridges.insert(ridges.end(), x.begin(), x.end());
    }
    check(part.flow.traces, traces);
    check(part.flow.ridges, ridges);
  }
}

TEST(flow_parts, carry_nothing_where_no_flow_is_asked_for) {
  const DistributedMesh part = distribute(world, grid(2, {8, 6, 0}, crossing()));
  EXPECT_TRUE(part.flow.empty());
  EXPECT_TRUE(part.flow.face_traces.empty());
  EXPECT_TRUE(part.flow.ridge_nodes.empty());
  EXPECT_EQ(part.flow.ridges.total, 0);
}

TEST(distribution, copies_keep_their_numbers_of_the_serial_mesh) {
  for (const auto& [name, serial, part] : cases()) {
    SCOPED_TRACE(name);
    ASSERT_EQ(static_cast<Index>(part.copy_input.size()), part.copies.local());
    for (Index c = 0; c < part.mesh.n_cells(); ++c) {
      for (std::size_t i = 0; i < part.mesh.copies_of(c).size(); ++i) {
        EXPECT_EQ(part.copy_input[part.mesh.copies_of(c)[i]], serial.copies_of(part.cell_input[c])[i]);
      }
    }
  }
}

}  // namespace
}  // namespace polyslip::mesh
