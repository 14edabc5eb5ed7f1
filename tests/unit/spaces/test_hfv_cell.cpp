#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "polyslip/common/error.hpp"
#include "polyslip/spaces/hfv_cell.hpp"
#include "support/flow_shapes.hpp"

namespace polyslip::spaces {
namespace {

using tests::Shape;

/// sum_sigma |sigma| n (x) (x_sigma - x_K)
Eigen::Matrix3d face_moments(const HfvCell& element) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const HfvFace& face : element.faces()) sum += face.area * face.normal * (face.centre - element.centre()).transpose();
  return sum;
}

/// Gradient of an affine function from its values at the centres.
Vec3 gradient_of(const HfvCell& element, const Vec3& g) {
  std::vector<double> p;
  for (const HfvFace& face : element.faces()) p.push_back(3 + g.dot(face.centre));
  return element.gradient(3 + g.dot(element.centre()), p);
}

double sum_of_cones(const HfvCell& element) {
  double sum = 0;
  for (const HfvFace& face : element.faces()) sum += face.area * face.distance / element.dim();
  return sum;
}

class hfv_cells : public testing::TestWithParam<Shape> {
 protected:
  mesh::PolyMesh mesh_ = tests::fractured_box(GetParam(), 4, 0.25, 0.75);
  HfvCell hfv_{mesh_};

  template <class Body>
  void for_each_cell(Body&& body) {
    for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
      SCOPED_TRACE(cell);
      hfv_.build(cell);
      body(cell);
    }
  }
  template <class Body>
  void for_each_fracture_face(Body&& body) {
    Index count = 0;
    for (Index face = 0; face < mesh_.n_faces(); ++face) {
      if (!mesh_.on_fracture(face)) continue;
      SCOPED_TRACE(face);
      hfv_.build_fracture_face(face);
      body(face);
      ++count;
    }
    EXPECT_GT(count, 0);
  }
};

TEST_P(hfv_cells, face_moments_are_the_measure_times_the_identity) {
  for_each_cell([&](Index) {
    Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
    if (mesh_.dim == 2) identity(2, 2) = 0;
    EXPECT_LT((face_moments(hfv_) - hfv_.measure() * identity).norm(), 1e-13 * hfv_.measure());
  });
}

TEST_P(hfv_cells, gradient_reproduces_linear_pressures) {
  const Vec3 g(0.4, -1.3, mesh_.dim == 3 ? 0.7 : 0.0);
  for_each_cell([&](Index) { EXPECT_LT((gradient_of(hfv_, g) - g).norm(), 1e-12); });
}

TEST_P(hfv_cells, volumes_cones_and_rules_sum_to_the_box) {
  double volume = 0, cones = 0, weights = 0;
  std::vector<geometry::QuadraturePoint> rule;
  for_each_cell([&](Index) {
    volume += hfv_.measure();
    cones += sum_of_cones(hfv_);
    hfv_.append_rule(rule);
  });
  for (const auto& q : rule) weights += q.weight;
  EXPECT_NEAR(volume, 1, 1e-13);
  EXPECT_NEAR(cones, 1, 1e-13);
  EXPECT_NEAR(weights, 1, 1e-13);
}

TEST_P(hfv_cells, centre_is_the_centre_of_mass) {
  std::vector<geometry::QuadraturePoint> rule;
  for_each_cell([&](Index) {
    rule.clear();
    hfv_.append_rule(rule);
    Vec3 centre = Vec3::Zero();
    for (const auto& q : rule) centre += q.weight * q.x / hfv_.measure();
    EXPECT_LT((centre - hfv_.centre()).norm(), 1e-13);
  });
}

TEST_P(hfv_cells, fracture_faces_reproduce_linear_pressures_in_their_plane) {
  const Vec3 g(0.4, -1.3, mesh_.dim == 3 ? 0.7 : 0.0);
  double area = 0;
  for_each_fracture_face([&](Index face) {
    EXPECT_EQ(hfv_.size(), mesh_.face_nodes.row_size(face));
    EXPECT_EQ(hfv_.dim(), mesh_.dim - 1);
    EXPECT_LT((gradient_of(hfv_, g) - Vec3(0, g.y(), g.z())).norm(), 1e-12) << "the fracture is upright to x";
    EXPECT_NEAR(sum_of_cones(hfv_), hfv_.measure(), 1e-14);
    area += hfv_.measure();
  });
  EXPECT_NEAR(area, mesh_.dim == 2 ? 0.5 : 0.25, 1e-13);
}

TEST_P(hfv_cells, ridges_of_fracture_faces_stand_in_the_order_of_the_nodes) {
  for_each_fracture_face([&](Index face) {
    const auto nodes = mesh_.face_nodes[face];
    for (int i = 0; i < hfv_.size(); ++i) {
      const Vec3& x = mesh_.nodes[nodes[i]];
      const Vec3& y = mesh_.nodes[nodes[(i + 1) % hfv_.size()]];
      EXPECT_LT((hfv_.faces()[i].centre - (mesh_.dim == 2 ? x : Vec3((x + y) / 2))).norm(), 1e-15);
      EXPECT_NEAR(hfv_.faces()[i].area, mesh_.dim == 2 ? 1 : (x - y).norm(), 1e-15);
      EXPECT_NEAR(hfv_.faces()[i].normal.x(), 0, 1e-14) << "tangential";
      EXPECT_GT(hfv_.faces()[i].distance, 0);
    }
  });
}

INSTANTIATE_TEST_SUITE_P(every_planar_shape, hfv_cells, testing::ValuesIn(tests::planar_shapes()), tests::ShapeName());

/// A cell of the plane with the given corners, counter-clockwise.
mesh::PolyMesh polygon(const std::vector<Vec3>& corners) {
  mesh::PolyMesh mesh;
  mesh.dim = 2;
  mesh.nodes = corners;
  const auto n = static_cast<Index>(corners.size());
  std::vector<Index> faces;
  for (Index i = 0; i < n; ++i) {
    mesh.face_nodes.push_row(std::vector<Index>{i, (i + 1) % n});
    mesh.face_cells.push_back({0, -1});
    faces.push_back(i);
  }
  mesh.cell_faces.push_row(faces);
  mesh::build_copies(mesh);
  return mesh;
}

TEST(hfv_cell, fractures_may_lie_in_any_plane) {
  mesh::PolyMesh mesh = tests::fractured_box({3, "polyhedra"}, 4, 0.25, 0.75);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.9, Vec3(1, -2, 0.5).normalized()).toRotationMatrix();
  for (Vec3& x : mesh.nodes) x = turn * x;
  const Vec3 normal = turn.col(0), g(0.4, -1.3, 0.7);
  HfvCell hfv(mesh);
  for (Index face = 0; face < mesh.n_faces(); ++face) {
    if (!mesh.on_fracture(face)) continue;
    hfv.build_fracture_face(face);
    EXPECT_LT((gradient_of(hfv, g) - (g - g.dot(normal) * normal)).norm(), 1e-12);
  }
}

// An L with arms of length 4 and 2: seen whole from its corner [0, 1]^2 only, which does not hold its centre of mass.
TEST(hfv_cell, centre_moves_to_the_average_of_nodes_where_the_centre_of_mass_does_not_see_all_faces) {
  const mesh::PolyMesh mesh = polygon({{0, 0, 0},
                                       {.1, 0, 0},
                                       {.2, 0, 0},
                                       {.3, 0, 0},
                                       {.4, 0, 0},
                                       {4, 0, 0},
                                       {4, 1, 0},
                                       {1, 1, 0},
                                       {1, 2, 0},
                                       {0, 2, 0},
                                       {0, .8, 0},
                                       {0, .6, 0},
                                       {0, .4, 0},
                                       {0, .2, 0}});
  HfvCell hfv(mesh);
  hfv.build(0);
  EXPECT_NEAR(hfv.measure(), 5, 1e-14);
  EXPECT_LT((hfv.centre() - cell_node_average(mesh, 0)).norm(), 1e-15);
  for (const HfvFace& face : hfv.faces()) EXPECT_GT(face.distance, 0);
  EXPECT_NEAR(sum_of_cones(hfv), 5, 1e-14);
  EXPECT_LT((gradient_of(hfv, {0.4, -1.3, 0}) - Vec3(0.4, -1.3, 0)).norm(), 1e-13);
}

TEST(hfv_cell, cells_that_no_centre_sees_whole_are_refused) {
  const mesh::PolyMesh mesh = polygon({{0, 0, 0}, {4, 0, 0}, {4, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}});
  HfvCell hfv(mesh);
  EXPECT_THROW(hfv.build(0), InputError);
}

TEST(hfv_cell, warped_faces_are_refused_with_place_and_remedy) {
  mesh::PolyMesh mesh = mesh::make_box(tests::unit_box({3, "warped"}, 3));
  mesh::build_copies(mesh);
  HfvCell hfv(mesh);
  try {
    for (Index cell = 0; cell < mesh.n_cells(); ++cell) hfv.build(cell);
    FAIL() << "faces of shaken hexahedra are warped";
  } catch (const InputError& e) {
    const std::string what = e.what();
    EXPECT_NE(what.find("cell 0 at (0."), std::string::npos) << what;
    EXPECT_NE(what.find("mesh.box.shape: cut"), std::string::npos) << what;
  }
}

}  // namespace
}  // namespace polyslip::spaces
