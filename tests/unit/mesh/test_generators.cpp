#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "mesh_checks.hpp"
#include "polyslip/common/error.hpp"
#include "polyslip/mesh/builder.hpp"
#include "polyslip/mesh/face_tools.hpp"
#include "polyslip/mesh/generators.hpp"

namespace polyslip::mesh {
namespace {

using namespace checks;

struct Shape {
  int dim;
  const char* name;
};
void PrintTo(const Shape& shape, std::ostream* out) { *out << shape.name << shape.dim << "d"; }

class box_shapes : public testing::TestWithParam<Shape> {
 protected:
  /// A box with unequal sides and counts and a kept plane.
  static BoxSpec spec() {
    BoxSpec spec;
    spec.dim = GetParam().dim;
    spec.shape = GetParam().name;
    spec.min = {-1.0, 2.0, spec.dim == 3 ? 0.5 : 0.0};
    spec.max = {2.0, 4.0, spec.dim == 3 ? 1.75 : 0.0};
    spec.cells = {6, 5, spec.dim == 3 ? 4 : 0};
    spec.kept_planes = {{0, 0.5}, {1, 2.8}};
    return spec;
  }
  static double volume(const BoxSpec& spec) { return 3.0 * 2.0 * (spec.dim == 3 ? 1.25 : 1.0); }
};

TEST_P(box_shapes, volumes_sum_to_the_box) {
  const PolyMesh mesh = make_box(spec());
  double sum = 0.0;
  for (Index c = 0; c < mesh.n_cells(); ++c) {
    const double volume = cell_moments(mesh, c).volume;
    EXPECT_GT(volume, 0.0) << c;
    sum += volume;
  }
  EXPECT_NEAR(sum, volume(spec()), 1e-12 * volume(spec()));
}

TEST_P(box_shapes, cells_are_closed) {
  const PolyMesh mesh = make_box(spec());
  for (Index c = 0; c < mesh.n_cells(); ++c) {
    const CellMoments cell = cell_moments(mesh, c);
    EXPECT_LT(cell.area_sum.norm(), 1e-13 * cell.area) << c;
  }
}

TEST_P(box_shapes, cells_and_faces_name_each_other) {
  const PolyMesh mesh = make_box(spec());
  std::vector<int> seen(mesh.n_faces(), 0);
  for (Index c = 0; c < mesh.n_cells(); ++c) {
    for (const Index f : mesh.cell_faces[c]) {
      EXPECT_TRUE(mesh.face_cells[f][0] == c || mesh.face_cells[f][1] == c);
      ++seen[f];
    }
  }
  for (Index f = 0; f < mesh.n_faces(); ++f) EXPECT_EQ(seen[f], mesh.on_boundary(f) ? 1 : 2) << f;
}

TEST_P(box_shapes, are_balls) { EXPECT_EQ(euler_characteristic(make_box(spec())), 1); }

TEST_P(box_shapes, faces_already_point_out_of_their_first_cell) {
  PolyMesh mesh = make_box(spec());
  const auto before = mesh.face_nodes.values;
  orient_faces(mesh);
  EXPECT_EQ(mesh.face_nodes.values, before);
}

TEST_P(box_shapes, sides_are_tagged_and_nothing_else) {
  const BoxSpec box = spec();
  const PolyMesh mesh = make_box(box);
  std::map<std::string, double> area;
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    EXPECT_EQ(mesh.face_tag[f] >= 0, mesh.on_boundary(f)) << f;
    if (mesh.face_tag[f] >= 0) area[mesh.tag_names[mesh.face_tag[f]]] += face_moments(mesh, f, Vec3::Zero()).area.norm();
  }
  const double height = box.dim == 3 ? 1.25 : 1.0;
  EXPECT_NEAR(area["left"], 2.0 * height, 1e-12);
  EXPECT_NEAR(area["right"], 2.0 * height, 1e-12);
  EXPECT_NEAR(area[box.dim == 3 ? "front" : "bottom"], 3.0 * height, 1e-12);
  EXPECT_NEAR(area[box.dim == 3 ? "back" : "top"], 3.0 * height, 1e-12);
  if (box.dim == 3) {
    EXPECT_NEAR(area["bottom"], 6.0, 1e-12);
    EXPECT_NEAR(area["top"], 6.0, 1e-12);
  }
  EXPECT_EQ(area.size(), box.dim == 3 ? 6U : 4U);
  EXPECT_EQ(mesh.region_names, std::vector<std::string>{"rock"});
  EXPECT_EQ(mesh.cell_region, std::vector<Index>(mesh.n_cells(), 0));
}

TEST_P(box_shapes, kept_planes_are_unions_of_faces) {
  const BoxSpec box = spec();
  const PolyMesh mesh = make_box(box);
  for (const auto& [axis, coordinate] : box.kept_planes) {
    double area = 0.0;
    for (Index f = 0; f < mesh.n_faces(); ++f) {
      bool on_plane = true;
      for (const Index s : mesh.face_nodes[f]) on_plane = on_plane && std::abs(mesh.nodes[s][axis] - coordinate) < 1e-12;
      if (on_plane) area += face_moments(mesh, f, Vec3::Zero()).area.norm();
    }
    EXPECT_NEAR(area, volume(box) / (axis == 0 ? 3.0 : 2.0), 1e-12);
  }
}

TEST_P(box_shapes, the_same_seed_gives_the_same_mesh) {
  BoxSpec box = spec();
  const PolyMesh first = make_box(box), second = make_box(box);
  EXPECT_EQ(first.nodes, second.nodes);
  EXPECT_EQ(first.face_nodes.values, second.face_nodes.values);
  box.seed = 2;
  const bool random = std::set<std::string>{"warped", "cut", "polygons", "polyhedra"}.count(box.shape) > 0;
  EXPECT_EQ(make_box(box).nodes != first.nodes, random);
}

INSTANTIATE_TEST_SUITE_P(, box_shapes,
                         testing::Values(Shape{2, "quads"}, Shape{2, "triangles"}, Shape{2, "polygons"}, Shape{2, "warped"},
                                         Shape{3, "hexahedra"}, Shape{3, "tets"}, Shape{3, "prisms"}, Shape{3, "polyhedra"},
                                         Shape{3, "warped"}, Shape{3, "cut"}),
                         [](const auto& shape) { return std::string(shape.param.name) + std::to_string(shape.param.dim) + "d"; });

TEST(boxes, structured_shapes_have_the_counts_of_their_lattice) {
  const std::map<std::string, std::array<Index, 3>> expected{// nodes, faces, cells of 3^3 boxes
                                                             {"hexahedra", {64, 108, 27}},
                                                             {"tets", {64, 378, 162}},
                                                             {"prisms", {64, 171, 54}},
                                                             {"warped", {64, 108, 27}}};
  for (const auto& [shape, counts] : expected) {
    const PolyMesh mesh = make_box(cube(shape, 3));
    EXPECT_EQ((std::array{mesh.n_nodes(), mesh.n_faces(), mesh.n_cells()}), counts) << shape;
  }
}

TEST(boxes, graded_box_of_the_inclined_crack_has_the_published_cells) {
  BoxSpec spec = cube("quads", 0, 2);
  spec.min = {-160.0, -160.0, 0.0};
  spec.max = {160.0, 160.0, 0.0};
  for (const auto& [size, cells] : {std::pair{0.1, 9504}, std::pair{0.05, 15984}, std::pair{0.025, 30084}}) {
    spec.grading[0] = AxisGrading{-1.5, 1.5, size, 1.15};
    spec.grading[1] = AxisGrading{-0.5, 0.5, size, 1.15};
    EXPECT_EQ(make_box(spec).n_cells(), cells);
  }
}

/// The planes along x of a box from -1 to 1, graded along x.
std::vector<double> planes_graded_by(const AxisGrading& grading) {
  BoxSpec spec = cube("quads", 1, 2);
  spec.grading[0] = grading;
  std::set<double> x;
  for (const Vec3& node : make_box(spec).nodes) x.insert(node.x());
  return {x.begin(), x.end()};
}

std::vector<double> sizes_between(const std::vector<double>& planes) {
  std::vector<double> sizes;
  for (std::size_t i = 1; i < planes.size(); ++i) sizes.push_back(planes[i] - planes[i - 1]);
  return sizes;
}

TEST(boxes, graded_axis_ends_on_the_box_and_grows_by_the_factor) {
  const std::vector<double> planes = planes_graded_by({-0.2, 0.3, 0.05, 1.3});
  EXPECT_EQ(planes.front(), -1.0);
  EXPECT_EQ(planes.back(), 1.0);
  const std::vector<double> sizes = sizes_between(planes);
  EXPECT_NEAR(sizes[1] * 1.3, sizes[0], 1e-12);
  EXPECT_NEAR(sizes[sizes.size() - 2] * 1.3, sizes.back(), 1e-12);
  EXPECT_EQ(std::count_if(sizes.begin(), sizes.end(), [](double h) { return std::abs(h - 0.05) < 1e-12; }), 10);
}

TEST(boxes, graded_core_grows_from_its_ends_to_its_middle) {
  for (const auto& [size, cells] : {std::pair{0.00505, 50}, std::pair{0.0105, 36}, std::pair{0.25, 4}, std::pair{1.0, 2}}) {
    const std::vector<double> planes = planes_graded_by({-0.5, 0.5, size, 1.2, 1.1});
    const auto from = std::find(planes.begin(), planes.end(), -0.5), to = std::find(planes.begin(), planes.end(), 0.5);
    ASSERT_NE(to, planes.end());
    const std::vector<double> core(from, to + 1), sizes = sizes_between(core);
    ASSERT_EQ(static_cast<int>(sizes.size()), cells) << size;
    for (std::size_t i = 0; i < core.size(); ++i) EXPECT_EQ(core[i], -core[core.size() - 1 - i]) << "the halves mirror each other";
    for (std::size_t i = 1; i < sizes.size() / 2; ++i) EXPECT_NEAR(sizes[i], 1.1 * sizes[i - 1], 1e-12);
    if (cells > 2) {
      EXPECT_NEAR(sizes.front(), size, 0.06 * size) << "off by the rounding of the count alone";
      EXPECT_NEAR(*from - *(from - 1), 1.05 * size, 0.15 * size) << "outside the cells grow from the core's size, scaled to fit";
    }
  }
}

TEST(boxes, warped_hexahedra_have_warped_faces_inside_and_cut_ones_only_planar_faces) {
  for (const char* shape : {"warped", "cut"}) {
    const PolyMesh mesh = make_box(cube(shape, 4));
    Index warped = 0;
    for (Index f = 0; f < mesh.n_faces(); ++f) {
      const auto s = mesh.face_nodes[f];
      if (s.size() < 4) continue;
      const Vec3 a = mesh.nodes[s[2]] - mesh.nodes[s[0]], b = mesh.nodes[s[3]] - mesh.nodes[s[1]];
      if (std::abs(a.cross(b).dot(mesh.nodes[s[1]] - mesh.nodes[s[0]])) > 1e-10) ++warped;
    }
    EXPECT_EQ(warped > 0, std::string(shape) == "warped");
  }
}

TEST(boxes, voronoi_cells_survive_an_unshaken_lattice_and_many_seeds) {
  // seed 12 with shake 1e-4 has an edge shorter than the merge distance
  for (const std::uint64_t seed : {1U, 7U, 12U}) {
    for (const double shake : {0.0, 1e-4, 0.2, 0.45}) {
      BoxSpec spec = cube("polyhedra", 6);
      spec.shake = shake;
      spec.seed = seed;
      if (shake == 0.0 || shake == 0.2) spec.kept_planes = {{0, 0.0}, {1, 0.0}, {2, 0.0}};
      EXPECT_EQ(euler_characteristic(make_box(spec)), 1) << seed << ' ' << shake;
    }
  }
}

void expect_refusal(const BoxSpec& spec, const std::string& fragment) {
  try {
    make_box(spec);
    ADD_FAILURE() << "accepted; expected a message with " << fragment;
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find(fragment), std::string::npos) << error.what();
  }
}

TEST(boxes, bad_boxes_are_refused_with_key_and_remedy) {
  const auto changed = [](auto&& change) {
    BoxSpec spec = cube("polyhedra", 4);
    change(spec);
    return spec;
  };
  expect_refusal(changed([](BoxSpec& s) { s.shape = "quads"; }),
                 "mesh.box.shape: 'quads' is no shape of a 3D box. Choose one of hexahedra");
  expect_refusal(changed([](BoxSpec& s) { s.cells[1] = 0; }), "mesh.box.cells: 0 cells along y");
  expect_refusal(changed([](BoxSpec& s) { s.max[2] = -1.0; }), "from -1 to -1 along z");
  expect_refusal(changed([](BoxSpec& s) { s.shake = 0.6; }), "mesh.box.shake");
  expect_refusal(changed([](BoxSpec& s) { s.shake = 0.4, s.kept_planes = {{0, 0.0}}; }), "Choose at most 0.23");
  expect_refusal(changed([](BoxSpec& s) { s.shake = 1e-9; }), "Choose 0 or at least 0.0001");
  expect_refusal(changed([](BoxSpec& s) {
                   s.cells[0] = 5, s.kept_planes = {{0, 0.0}};
                 }),
                 "Change the number of cells along x (now 5)");
  expect_refusal(changed([](BoxSpec& s) { s.grading[0] = AxisGrading{-0.5, 0.5, 0.1, 1.2}; }), "cannot be graded");
  expect_refusal(changed([](BoxSpec& s) {
                   s.shape = "hexahedra", s.grading[2] = AxisGrading{-2.0, 0.5, 0.1, 1.2};
                 }),
                 "mesh.box.grading.z");
  expect_refusal(changed([](BoxSpec& s) {
                   s.shape = "hexahedra", s.grading[2] = AxisGrading{-0.5, 0.5, 0.1, 1.0};
                 }),
                 "growth 1 is not");
  expect_refusal(changed([](BoxSpec& s) {
                   s.shape = "hexahedra", s.grading[2] = AxisGrading{-0.5, 0.5, 0.1, 1.2, 0.9};
                 }),
                 "inner_growth 0.9 is not");
  expect_refusal(changed([](BoxSpec& s) { s.cells = {4000, 4000, 4000}; }), "mesh.box.cells: 6.4e+10 cells");
}

/// Two unit cubes side by side, every face listed backwards or forwards as the bits of `turns` say.
PolyMesh two_cubes(unsigned turns) {
  std::vector<Vec3> nodes;
  for (int k = 0; k < 2; ++k) {
    for (int j = 0; j < 2; ++j) {
      for (int i = 0; i < 3; ++i) nodes.emplace_back(i, j, k);
    }
  }
  nodes.emplace_back(9.0, 9.0, 9.0);  // used by no cell
  MeshBuilder builder(3, nodes, "test");
  for (const Index o : {0, 1}) {
    builder.add_cell();
    for (std::array<Index, 4> face :
         {std::array{0, 1, 4, 3}, {6, 7, 10, 9}, {0, 1, 7, 6}, {3, 4, 10, 9}, {0, 3, 9, 6}, {1, 4, 10, 7}}) {
      for (Index& s : face) s += o;
      if ((turns & 1U) != 0) std::reverse(face.begin(), face.end());
      turns >>= 1U;
      builder.add_face(face);
    }
  }
  builder.tag_face(builder.tag("middle"), std::array{10, 4, 7, 1});
  return builder.build();
}

TEST(builder, orients_whatever_order_and_drops_unused_nodes) {
  for (const unsigned turns : {0U, 0xfffU, 0x2d3U, 0x5a6U}) {
    const PolyMesh mesh = two_cubes(turns);
    EXPECT_EQ(mesh.n_nodes(), 12);
    EXPECT_EQ(mesh.n_faces(), 11);
    for (Index c = 0; c < 2; ++c) {
      EXPECT_NEAR(cell_moments(mesh, c).volume, 1.0, 1e-14);
      EXPECT_LT(cell_moments(mesh, c).area_sum.norm(), 1e-14);
    }
    EXPECT_EQ(std::count(mesh.face_tag.begin(), mesh.face_tag.end(), 0), 1);
    EXPECT_EQ(mesh.face_cells[std::find(mesh.face_tag.begin(), mesh.face_tag.end(), 0) - mesh.face_tag.begin()],
              (std::array{0, 1}));
  }
}

TEST(builder, refuses_open_cells_faces_of_three_cells_and_stray_tags) {
  const std::vector<Vec3> nodes{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 0}};
  const auto message = [&](auto&& fill) -> std::string {
    MeshBuilder builder(2, nodes, "test.msh");
    try {
      fill(builder);
      builder.build();
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  const std::vector<Index> square{0, 1, 2, 3}, half{0, 1, 2};
  EXPECT_EQ(message([&](MeshBuilder& b) { b.add_polygon(square); }), "accepted");
  const auto open = message([&](MeshBuilder& b) {
    b.add_cell();
    for (const auto& face : {std::array{0, 1}, {1, 2}, {2, 3}}) b.add_face(face);
  });
  EXPECT_NE(open.find("test.msh: cell 0 at (0, 0, 0): its faces do not close: 1 of them at the node about (0, 0, 0)"),
            std::string::npos)
      << open;
  const auto crowded = message([&](MeshBuilder& b) {
    for (int i = 0; i < 3; ++i) b.add_polygon(half);
  });
  EXPECT_NE(crowded.find("of cell 2 with nodes 2 0 is already a face of cells 0 and 1"), std::string::npos) << crowded;
  const auto stray = message([&](MeshBuilder& b) {
    b.add_polygon(square);
    b.tag_face(b.tag("fault"), std::array{0, 2});
  });
  EXPECT_NE(stray.find("in group 'fault' is not a face of any cell"), std::string::npos) << stray;
  const auto flat = message([&](MeshBuilder& b) { b.add_polygon(std::array{0, 4, 2}); });
  EXPECT_NE(flat.find("cell 0 at (1, 1, 0): its volume is 0"), std::string::npos) << flat;
  const auto flipped = message([&](MeshBuilder& b) {
    b.add_polygon(half);
    b.add_polygon(std::array{1, 2, 4});
  });
  EXPECT_NE(flipped.find("cells 0 and 1"), std::string::npos) << flipped;
  EXPECT_NE(flipped.find("overlap"), std::string::npos) << flipped;
}

TEST(builder, tags_boundary_faces_without_tag_only) {
  PolyMesh mesh = make_box(cube("quads", 2, 2));
  mesh.face_tag.assign(mesh.n_faces(), -1);
  tag_boundary(mesh, "left", [](const Vec3& x) { return x.x() == -1.0; });
  tag_boundary(mesh, "rest", [](const Vec3&) { return true; });
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    const std::string tag = mesh.face_tag[f] < 0 ? "" : mesh.tag_names[mesh.face_tag[f]];
    EXPECT_EQ(tag, !mesh.on_boundary(f) ? "" : node_average(mesh, f).x() == -1.0 ? "left" : "rest");
  }
}

}  // namespace
}  // namespace polyslip::mesh
