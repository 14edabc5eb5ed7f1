#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "mesh_checks.hpp"
#include "polyslip/common/error.hpp"
#include "polyslip/mesh/builder.hpp"
#include "polyslip/mesh/face_tools.hpp"
#include "polyslip/mesh/fractures.hpp"
#include "polyslip/mesh/generators.hpp"

namespace polyslip::mesh {
namespace {

using namespace checks;
constexpr double kInfinite = std::numeric_limits<double>::infinity();

FractureGeometry by_points(const std::string& name, const std::vector<Vec3>& points) { return {name, "scene.yaml:7", "", points}; }
FractureGeometry by_group(const std::string& name, const std::string& group) { return {name, "scene.yaml:7", group, {}}; }

std::vector<Index> faces_of(const PolyMesh& mesh, Index fracture) {
  std::vector<Index> faces;
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    if (mesh.on_fracture(f) && mesh.face_fracture[f] == fracture) faces.push_back(f);
  }
  return faces;
}

/// n^+ by face_nodes; and face_nodes must indeed point out of face_cells[f][0].
Vec3 n_plus(const PolyMesh& mesh, Index face) {
  PolyMesh again = mesh;
  orient_faces(again);
  EXPECT_EQ(std::vector<Index>(again.face_nodes[face].begin(), again.face_nodes[face].end()),
            std::vector<Index>(mesh.face_nodes[face].begin(), mesh.face_nodes[face].end()));
  return area_vector(mesh, face).normalized();
}

/// Tags the inner faces whose node average satisfies `inside` as a physical group.
template <class Inside>
void add_group(PolyMesh& mesh, const std::string& name, Inside&& inside) {
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    if (!mesh.on_boundary(f) && inside(node_average(mesh, f), area_vector(mesh, f).normalized())) {
      mesh.face_tag[f] = static_cast<Index>(mesh.tag_names.size());
    }
  }
  mesh.tag_names.push_back(name);
}

TEST(fractures, polyline_has_its_plus_side_to_the_left_over_kinks) {
  PolyMesh mesh = make_box(cube("triangles", 8, 2));
  mark_fractures(mesh, {by_points("bent", {{-0.5, -0.5, 0}, {0, -0.5, 0}, {0, 0.25, 0}, {0.5, 0.75, 0}, {-0.25, 0.75, 0}})});
  const auto faces = faces_of(mesh, 0);
  EXPECT_EQ(faces.size(), 2U + 3U + 2U + 3U);
  for (const Index f : faces) {
    const Vec3 x = node_average(mesh, f);
    const Vec3 along = x.y() == -0.5   ? Vec3(1, 0, 0)
                       : x.y() == 0.75 ? Vec3(-1, 0, 0)
                       : x.x() == 0.0  ? Vec3(0, 1, 0)
                                       : Vec3(1, 1, 0).normalized();
    EXPECT_LT((n_plus(mesh, f) - Vec3(along.y(), -along.x(), 0)).norm(), 1e-12) << x.transpose();
  }
  EXPECT_NEAR(mesh.fracture_length[0], 0.5 + 0.75 + std::sqrt(0.5) + 0.75, 1e-12);
}

TEST(fractures, polygon_has_its_plus_side_where_its_normal_points) {
  for (const char* shape : {"hexahedra", "tets", "prisms", "polyhedra", "warped", "cut"}) {
    BoxSpec spec = cube(shape, 4);
    spec.kept_planes = {{0, 0.0}};
    PolyMesh mesh = make_box(spec);
    const std::vector<Vec3> corners{{0, -1, -1}, {0, 1, -1}, {0, 1, 1}, {0, -1, 1}};  // right-hand normal +x
    mark_fractures(mesh, {by_points("plane", corners)});
    for (const Index f : faces_of(mesh, 0)) EXPECT_LT((n_plus(mesh, f) - Vec3(-1, 0, 0)).norm(), 1e-9) << shape;
    EXPECT_NEAR(mesh.fracture_length[0], 2.0, 1e-12) << shape;
    mark_fractures(mesh, {by_points("plane", {corners.rbegin(), corners.rend()})});
    for (const Index f : faces_of(mesh, 0)) EXPECT_LT((n_plus(mesh, f) - Vec3(1, 0, 0)).norm(), 1e-9) << shape;
  }
}

TEST(fractures, faces_match_oblique_and_non_convex_polygons) {
  PolyMesh mesh = make_box(cube("tets", 4));
  mark_fractures(
      mesh, {by_points("oblique", {{-0.5, -0.5, -1}, {0.5, 0.5, -1}, {0.5, 0.5, 1}, {-0.5, -0.5, 1}}),
             by_points("angle", {{-1, -1, 0.5}, {-0.5, -1, 0.5}, {-0.5, 0.5, 0.5}, {0, 0.5, 0.5}, {0, 1, 0.5}, {-1, 1, 0.5}})});
  EXPECT_EQ(faces_of(mesh, 0).size(), 2U * 4U * 2U);
  EXPECT_NEAR(mesh.fracture_length[0], std::sqrt(2.0 * std::sqrt(2.0)), 1e-12);
  EXPECT_EQ(faces_of(mesh, 1).size(), 2U * (4U + 1U));
  EXPECT_NEAR(mesh.fracture_length[1], std::sqrt(1.25), 1e-12);
}

TEST(fractures, that_end_inside_are_covered_where_the_planes_of_their_edges_are_kept) {
  for (const char* shape : {"hexahedra", "tets", "prisms", "polyhedra", "warped", "cut"}) {
    BoxSpec spec = cube(shape, 8);
    spec.kept_planes = {{0, 0.0}, {1, -0.5}, {1, 0.5}, {2, -0.5}, {2, 0.5}};
    PolyMesh mesh = make_box(spec);
    mark_fractures(mesh, {by_points("F", {{0, -0.5, -0.5}, {0, 0.5, -0.5}, {0, 0.5, 0.5}, {0, -0.5, 0.5}})});
    EXPECT_NEAR(mesh.fracture_length[0], 1.0, 1e-12) << shape;
  }
}

TEST(fractures, tip_distance_is_to_the_ends_inside_the_domain_only) {
  PolyMesh mesh = make_box(cube("quads", 8, 2));
  mark_fractures(
      mesh, {by_points("inside", {{-0.5, 0, 0}, {0, 0, 0}, {0, 0.5, 0}}), by_points("to the side", {{0.25, -0.5, 0}, {1, -0.5, 0}}),
             by_points("through", {{-1, 0.75, 0}, {1, 0.75, 0}}),
             by_points("ring", {{-0.75, -0.75, 0}, {-0.5, -0.75, 0}, {-0.5, -0.5, 0}, {-0.75, -0.5, 0}, {-0.75, -0.75, 0}})});
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    const Vec3 x = node_average(mesh, f);
    const auto expected = [&]() -> double {
      switch (mesh.face_fracture[f]) {
        case 0:
          return std::min((x - Vec3(-0.5, 0, 0)).norm(), (x - Vec3(0, 0.5, 0)).norm());
        case 1:
          return x.x() - 0.25;
        case -1:
          return 0.0;
        default:
          return kInfinite;
      }
    }();
    if (std::isinf(expected)) {
      EXPECT_EQ(mesh.face_tip_distance[f], kInfinite);
    } else {
      EXPECT_NEAR(mesh.face_tip_distance[f], expected, 1e-12) << x.transpose();
    }
  }
}

TEST(fractures, tip_distance_in_3d_is_to_the_nearest_tip_edge) {
  PolyMesh mesh = make_box(cube("hexahedra", 8));
  mark_fractures(mesh, {by_points("half", {{-1, -0.5, 0}, {0.5, -0.5, 0}, {0.5, 0.5, 0}, {-1, 0.5, 0}})});
  const auto faces = faces_of(mesh, 0);
  EXPECT_EQ(faces.size(), 6U * 4U);
  for (const Index f : faces) {
    const Vec3 x = node_average(mesh, f);
    EXPECT_NEAR(mesh.face_tip_distance[f], std::min(0.5 - std::abs(x.y()), 0.5 - x.x()), 1e-12) << x.transpose();
  }
}

TEST(fractures, group_carries_its_side_over_kinks_and_starts_downwards) {
  PolyMesh mesh = make_box(cube("hexahedra", 4));
  add_group(mesh, "bent",
            [](const Vec3& x, const Vec3&) { return (x.z() == 0.0 && x.x() < 0.0) || (x.x() == 0.0 && x.z() > 0.0); });
  mark_fractures(mesh, {by_group("bent", "bent")});
  const auto faces = faces_of(mesh, 0);
  ASSERT_EQ(faces.size(), 16U);
  const Vec3 first = n_plus(mesh, faces[0]);
  EXPECT_LT(first.x() + first.y() + first.z(), 0.0);  // one component only
  // the + side is the inside of the corner (x < 0, z > 0) or the outside on all faces alike
  const auto inside = [&](Index f) {
    return node_average(mesh, f).z() == 0.0 ? n_plus(mesh, f).z() < 0.0 : n_plus(mesh, f).x() > 0.0;
  };
  for (const Index f : faces) EXPECT_EQ(inside(f), inside(faces[0]));
  EXPECT_TRUE(inside(faces[0]));  // the first face lies in z = 0
}

TEST(fractures, group_carries_its_side_straight_through_a_crossing) {
  PolyMesh mesh = make_box(cube("triangles", 4, 2));
  add_group(mesh, "cross", [](const Vec3& x, const Vec3&) { return x.x() == 0.0 || x.y() == 0.0; });
  mark_fractures(mesh, {by_group("cross", "cross")});
  const auto faces = faces_of(mesh, 0);
  ASSERT_EQ(faces.size(), 8U);
  for (const Index f : faces) {
    const Vec3 expected = node_average(mesh, f).x() == 0.0 ? Vec3(-1, 0, 0) : Vec3(0, -1, 0);
    EXPECT_LT((n_plus(mesh, f) - expected).norm(), 1e-12);
  }
}

TEST(fractures, group_carries_its_side_through_a_crossing_after_a_kink) {
  // Upwards at x = -0.5, then to the right along y = 0 through x = 0: left of the path all along, though a face alone would turn to
  // -y.
  PolyMesh mesh = make_box(cube("quads", 4, 2));
  add_group(mesh, "g", [](const Vec3& x, const Vec3&) {
    return (x.x() == -0.5 && x.y() == -0.25) || (x.y() == 0.0 && std::abs(x.x()) < 0.5) || (x.x() == 0.0 && std::abs(x.y()) < 0.5);
  });
  mark_fractures(mesh, {by_group("g", "g")});
  const auto faces = faces_of(mesh, 0);
  ASSERT_EQ(faces.size(), 5U);
  for (const Index f : faces) {
    EXPECT_LT((n_plus(mesh, f) - (node_average(mesh, f).y() == 0.0 ? Vec3(0, 1, 0) : Vec3(-1, 0, 0))).norm(), 1e-12);
  }
}

TEST(fractures, group_sides_start_anew_where_three_branches_meet_at_sharp_turns) {
  PolyMesh mesh = make_box(cube("triangles", 4, 2));
  add_group(mesh, "y", [](const Vec3& x, const Vec3&) {  // from the origin upwards, to the left and down to the left
    return (x - Vec3(0, 0.25, 0)).norm() < 1e-9 || (x - Vec3(-0.25, 0, 0)).norm() < 1e-9 ||
           (x - Vec3(-0.25, -0.25, 0)).norm() < 1e-9;
  });
  mark_fractures(mesh, {by_group("y", "y")});
  const auto faces = faces_of(mesh, 0);
  ASSERT_EQ(faces.size(), 3U);
  for (const Index f : faces) {
    const Vec3 x = node_average(mesh, f);
    const Vec3 expected = x.x() == 0.0 ? Vec3(-1, 0, 0) : x.y() == 0.0 ? Vec3(0, -1, 0) : Vec3(1, -1, 0).normalized();
    EXPECT_LT((n_plus(mesh, f) - expected).norm(), 1e-12) << x.transpose();
  }
}

void expect_refusal(const BoxSpec& spec, const std::vector<FractureGeometry>& fractures,
                    const std::vector<std::string>& fragments) {
  PolyMesh mesh = make_box(spec);
  try {
    mark_fractures(mesh, fractures);
    ADD_FAILURE() << "accepted; expected a message with " << fragments[0];
  } catch (const InputError& error) {
    for (const auto& fragment : fragments) EXPECT_NE(std::string(error.what()).find(fragment), std::string::npos) << error.what();
  }
}

TEST(fractures, uncovered_parts_are_named) {
  const BoxSpec quads = cube("quads", 4, 2);
  expect_refusal(quads, {by_points("F", {{-0.5, 0, 0}, {0.3, 0, 0}})},
                 {"scene.yaml:7: fracture 'F'", "from (0, 0) to (0.3, 0)", "Make the mesh follow the fracture"});
  expect_refusal(quads, {by_points("F", {{-0.4, 0, 0}, {0.5, 0, 0}})}, {"from (-0.4, 0) to (0, 0)"});
  expect_refusal(quads, {by_points("F", {{-0.5, 0, 0}, {0.5, 0, 0}, {0.5, 0.7, 0}})},
                 {"from (0.5, 0.5) to (0.5, 0.7)", "point 2 to point 3"});
  expect_refusal(quads, {by_points("F", {{-0.5, -0.5, 0}, {0.5, 0.5, 0}})}, {"from (-0.5, -0.5) to (0.5, 0.5)"});
  expect_refusal(quads, {by_points("F", {{-0.5, 0, 0}, {1.5, 0, 0}})}, {"from (1, 0) to (1.5, 0)"});
  expect_refusal(quads, {by_points("F", {{5, 0, 0}, {6, 0, 0}})}, {"from (5, 0) to (6, 0)"});
  expect_refusal(quads, {by_points("F", {{-0.75, 0.5, 0}, {0.25, 0.5, 0}, {0.5, 0.5, 0}})},
                 {"and 1 more part on the piece from point 1"});
  expect_refusal(cube("hexahedra", 4), {by_points("F", {{-1, -1, 0}, {0.7, -1, 0}, {0.7, 1, 0}, {-1, 1, 0}})},
                 {"within (0.5, -1, 0) to (0.7, 1, 0)"});
  expect_refusal(cube("hexahedra", 4), {by_points("F", {{-1, -1, 0.1}, {1, -1, 0.1}, {1, 1, 0.1}, {-1, 1, 0.1}})},
                 {"within (-1, -1, 0.1) to (1, 1, 0.1)"});
}

TEST(fractures, a_hole_in_the_cover_is_found_without_areas) {
  // A big cell face with a missing neighbour: hexahedra whose middle plane is broken by moving one node off it.
  PolyMesh mesh = make_box(cube("hexahedra", 4));
  for (Vec3& x : mesh.nodes) {
    if (x.norm() < 1e-9) x.z() = 0.1;
  }
  try {
    mark_fractures(mesh, {by_points("F", {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}})});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("within (-0.5, -0.5, 0) to (0.5, 0.5, 0)"), std::string::npos) << error.what();
  }
}

TEST(fractures, overlaps_boundaries_and_bad_geometry_are_refused) {
  const BoxSpec quads = cube("quads", 4, 2), cubes = cube("hexahedra", 4);
  expect_refusal(quads, {by_points("A", {{-0.5, 0, 0}, {0.5, 0, 0}}), by_points("B", {{0, 0, 0}, {1, 0, 0}})},
                 {"fracture 'B'", "belongs to fracture 'A' too", "at (0.25, 0)"});
  expect_refusal(quads, {by_points("A", {{-1, -1, 0}, {1, -1, 0}})},
                 {"lies on the boundary of the domain", "merge its doubled nodes"});
  expect_refusal(quads, {by_group("A", "top")}, {"lies on the boundary of the domain"});
  expect_refusal(quads, {by_group("A", "faults")}, {"no physical group 'faults'", "left, right, bottom, top"});
  expect_refusal(quads, {by_points("A", {{0, 0, 0}})}, {"1 points are too few"});
  expect_refusal(quads, {by_points("A", {{0, 0, 0}, {0, 0, 0}})}, {"points 1 and 2 are both (0, 0)"});
  expect_refusal(cubes, {by_points("A", {{0, 0, 0}, {1, 0, 0}, {0.5, 0, 0}})}, {"lie on one line"});
  expect_refusal(cubes, {by_points("A", {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0.1}, {-1, 1, 0}})},
                 {"off the plane", "split the fracture"});
}

TEST(fractures, none_leave_the_mesh_unmarked) {
  PolyMesh mesh = make_box(cube("quads", 2, 2));
  mark_fractures(mesh, {});
  EXPECT_TRUE(mesh.face_fracture.empty());
  EXPECT_TRUE(mesh.face_tip_distance.empty());
}

}  // namespace
}  // namespace polyslip::mesh
