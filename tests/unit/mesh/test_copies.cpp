#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "mesh_checks.hpp"
#include "polyslip/mesh/fractures.hpp"
#include "polyslip/mesh/generators.hpp"

namespace polyslip::mesh {
namespace {

using namespace checks;

FractureGeometry line(const std::string& name, const std::vector<Vec3>& points) { return {name, "test", "", points}; }

/// Square of corners x = +-a, ... normal to `axis` at 0.
FractureGeometry square(int axis, double a) {
  std::vector<Vec3> corners(4, Vec3::Zero());
  for (int i = 0; i < 4; ++i) {
    corners[i][(axis + 1) % 3] = i == 0 || i == 3 ? -a : a;
    corners[i][(axis + 2) % 3] = i < 2 ? -a : a;
  }
  return {std::string(1, static_cast<char>('x' + axis)), "test", "", corners};
}

PolyMesh fractured(const BoxSpec& spec, const std::vector<FractureGeometry>& fractures) {
  PolyMesh mesh = make_box(spec);
  mark_fractures(mesh, fractures);
  build_copies(mesh);
  return mesh;
}

Index copies_at(const PolyMesh& mesh, const Vec3& x) {
  const auto node = std::find_if(mesh.nodes.begin(), mesh.nodes.end(), [&](const Vec3& y) { return (x - y).norm() < 1e-9; });
  EXPECT_NE(node, mesh.nodes.end()) << x.transpose();
  return static_cast<Index>(std::count(mesh.copy_node.begin(), mesh.copy_node.end(), node - mesh.nodes.begin()));
}

/// A copy is seen by cells at its node only, by at least one, and no non-fracture face separates cells of different copies.
void expect_sound_copies(const PolyMesh& mesh) {
  EXPECT_TRUE(std::is_sorted(mesh.copy_node.begin(), mesh.copy_node.end()));
  std::vector<char> seen(mesh.n_copies(), false);
  std::vector<std::map<Index, Index>> copy(mesh.n_cells());
  for (Index c = 0; c < mesh.n_cells(); ++c) {
    const auto nodes = mesh.cell_nodes[c];
    const auto copies = mesh.copies_of(c);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      EXPECT_EQ(mesh.copy_node[copies[i]], nodes[i]);
      EXPECT_TRUE(copy[c].emplace(nodes[i], copies[i]).second) << "a node twice in cell " << c;
      seen[copies[i]] = true;
    }
    for (const Index f : mesh.cell_faces[c]) {
      for (const Index s : mesh.face_nodes[f]) EXPECT_EQ(copy[c].count(s), 1U);
    }
  }
  EXPECT_EQ(std::count(seen.begin(), seen.end(), false), 0);
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    if (mesh.on_boundary(f) || mesh.on_fracture(f)) continue;
    for (const Index s : mesh.face_nodes[f]) EXPECT_EQ(copy[mesh.face_cells[f][0]][s], copy[mesh.face_cells[f][1]][s]);
  }
}

TEST(copies, coincide_with_nodes_without_fractures) {
  for (const char* shape : {"hexahedra", "polyhedra", "tets"}) {
    PolyMesh mesh = make_box(cube(shape, 3));
    build_copies(mesh);
    expect_sound_copies(mesh);
    EXPECT_EQ(mesh.n_copies(), mesh.n_nodes());
    EXPECT_EQ(mesh.cell_copies, mesh.cell_nodes.values);
  }
}

TEST(copies, one_at_a_tip_two_inside_three_at_a_t_four_at_a_crossing) {
  for (const char* shape : {"quads", "triangles"}) {
    const PolyMesh mesh =
        fractured(cube(shape, 8, 2), {line("long", {{-0.75, 0, 0}, {0.75, 0, 0}}), line("across", {{0, -0.5, 0}, {0, 0.5, 0}}),
                                      line("t", {{0.5, 0, 0}, {0.5, 0.5, 0}})});
    expect_sound_copies(mesh);
    EXPECT_EQ(copies_at(mesh, {-0.75, 0, 0}), 1);
    EXPECT_EQ(copies_at(mesh, {0, 0.5, 0}), 1);
    EXPECT_EQ(copies_at(mesh, {-0.5, 0, 0}), 2);
    EXPECT_EQ(copies_at(mesh, {0.5, 0, 0}), 3);
    EXPECT_EQ(copies_at(mesh, {0, 0, 0}), 4);
    EXPECT_EQ(copies_at(mesh, {-0.5, 0.5, 0}), 1);
    EXPECT_EQ(mesh.n_copies(), mesh.n_nodes() + 3 + 2 + 1 + 2 + 3);  // inside long, across and t; T; X
  }
}

TEST(copies, two_where_a_fracture_reaches_the_boundary) {
  const PolyMesh mesh = fractured(cube("polygons", 6, 2), {});
  EXPECT_EQ(mesh.n_copies(), mesh.n_nodes());
  const PolyMesh cut = fractured(cube("quads", 4, 2), {line("through", {{-1, 0, 0}, {1, 0, 0}})});
  expect_sound_copies(cut);
  EXPECT_EQ(copies_at(cut, {-1, 0, 0}), 2);
  EXPECT_EQ(cut.n_copies(), cut.n_nodes() + 5);
}

TEST(copies, eight_where_three_full_planes_meet) {
  for (const char* shape : {"hexahedra", "tets", "polyhedra", "warped", "cut"}) {
    BoxSpec spec = cube(shape, 4);
    spec.kept_planes = {{0, 0.0}, {1, 0.0}, {2, 0.0}};
    const PolyMesh mesh = fractured(spec, {square(0, 1.0), square(1, 1.0), square(2, 1.0)});
    expect_sound_copies(mesh);
    EXPECT_EQ(copies_at(mesh, Vec3::Zero()), 8) << shape;
    std::map<Index, Index> copies;
    for (const Index s : mesh.copy_node) ++copies[s];
    for (const auto& [s, n] : copies) {
      const Vec3& x = mesh.nodes[s];
      EXPECT_EQ(n, 1 << ((x.x() == 0.0) + (x.y() == 0.0) + (x.z() == 0.0))) << shape << ' ' << x.transpose();
    }
  }
}

TEST(copies, one_on_the_tip_line_of_a_square_and_two_inside) {
  const PolyMesh mesh = fractured(cube("hexahedra", 8), {square(2, 0.5)});
  expect_sound_copies(mesh);
  EXPECT_EQ(copies_at(mesh, {0.5, 0.25, 0}), 1);
  EXPECT_EQ(copies_at(mesh, {0.5, 0.5, 0}), 1);
  EXPECT_EQ(copies_at(mesh, {0.25, 0.25, 0}), 2);
  EXPECT_EQ(mesh.n_copies(), mesh.n_nodes() + 9);
}

TEST(copies, are_numbered_by_node_and_then_by_first_cell) {
  const PolyMesh mesh = fractured(cube("quads", 2, 2), {line("f", {{0, -1, 0}, {0, 1, 0}})});
  EXPECT_EQ(mesh.copy_node, (std::vector<Index>{0, 1, 1, 2, 3, 4, 4, 5, 6, 7, 7, 8}));
  const auto copy = [&](Index cell, Index node) {
    const auto nodes = mesh.cell_nodes[cell];
    return mesh.copies_of(cell)[std::find(nodes.begin(), nodes.end(), node) - nodes.begin()];
  };
  EXPECT_EQ(copy(0, 4), 5);
  EXPECT_EQ(copy(1, 4), 6);
  EXPECT_EQ(copy(2, 4), 5);
  EXPECT_EQ(copy(3, 4), 6);
}

}  // namespace
}  // namespace polyslip::mesh
