#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>

#include "polyslip/geometry/faces.hpp"
#include "polyslip/spaces/vem_cell.hpp"
#include "support/boxes.hpp"

namespace polyslip::spaces {
namespace {

using tests::AffineField;
using tests::Shape;

/// Values of a field at the nodes of a cell and zero bubbles, as VemCell orders them.
std::vector<double> interpolate(const mesh::PolyMesh& mesh, const VemCell& vem, const AffineField& field) {
  std::vector<double> v;
  for (Index s : mesh.cell_nodes[vem.cell()])
    for (int a = 0; a < mesh.dim; ++a) v.push_back(field(mesh.nodes[s])[a]);
  v.resize(static_cast<std::size_t>(mesh.dim) * vem.size(), 0.0);
  return v;
}

class vem_cells : public testing::TestWithParam<Shape> {
 protected:
  mesh::PolyMesh mesh_ = tests::fractured_box(GetParam(), 4, 0.25, 0.75);
  VemCell vem_{mesh_};
};

TEST_P(vem_cells, gradient_reproduces_linear_fields) {
  const AffineField field(mesh_.dim);
  for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
    vem_.build(cell);
    EXPECT_LT((vem_.gradient(interpolate(mesh_, vem_, field)) - field.gradient).norm(), 1e-12) << cell;
  }
}

TEST_P(vem_cells, function_reproduces_linear_fields) {
  const AffineField field(mesh_.dim);
  for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
    vem_.build(cell);
    const auto v = interpolate(mesh_, vem_, field);
    const Eigen::Matrix3d gradient = vem_.gradient(v);
    for (const Vec3& x : {mesh_.nodes[mesh_.cell_nodes[cell][0]], vem_.xbar(), Vec3(0.2, 0.9, mesh_.dim == 3 ? 0.4 : 0.0)})
      EXPECT_LT((vem_.value(gradient, v, x) - field(x)).norm(), 1e-12) << cell;
  }
}

TEST_P(vem_cells, are_the_same_by_weights_of_all_faces) {
  const FaceWeights weights(mesh_);
  VemCell same(mesh_, Bubbles::fracture, &weights);
  for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
    vem_.build(cell);
    same.build(cell);
    EXPECT_EQ(same.volume(), vem_.volume());
    for (int j = 0; j < vem_.size(); ++j) EXPECT_EQ(same.c()[j], vem_.c()[j]) << cell << " " << j;
    const auto faces = mesh_.cell_faces[cell];
    const bool asks_no_face = vem_.n_nodes() == mesh_.dim + 1 &&
                              std::none_of(faces.begin(), faces.end(), [&](Index face) { return mesh_.on_fracture(face); });
    if (asks_no_face) {
      EXPECT_EQ(same.flops(), vem_.flops());
    } else {
      EXPECT_LT(same.flops(), vem_.flops());
    }
  }
}

TEST_P(vem_cells, sum_up_the_vector_weights_of_their_faces) {
  for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
    vem_.build(cell);
    const auto nodes = mesh_.cell_nodes[cell];
    std::vector<Vec3> points, g, sums(nodes.size(), Vec3::Zero());
    double size = 0;
    for (const Index face : mesh_.cell_faces[cell]) {
      face_points(mesh_, face, points);
      g.resize(points.size());
      geometry::vector_weights(mesh_.dim, points, g);
      for (std::size_t i = 0; i < g.size(); ++i) {
        sums[static_cast<std::size_t>(std::find(nodes.begin(), nodes.end(), mesh_.face_nodes[face][i]) - nodes.begin())] +=
            mesh_.orientation(cell, face) * g[i];
        size = std::max(size, g[i].norm());
      }
    }
    double volume = 0;
    for (std::size_t s = 0; s < nodes.size(); ++s) {
      EXPECT_LT((vem_.volume() * vem_.c()[s] - sums[s]).norm(), 1e-14 * size) << cell << " " << s;
      volume += sums[s].dot(mesh_.nodes[nodes[s]] - vem_.xbar()) / mesh_.dim;
    }
    EXPECT_NEAR(vem_.volume(), volume, 1e-14 * volume) << cell;
  }
}

TEST_P(vem_cells, tell_how_flat_they_are) {
  vem_.build(0);
  const double before = vem_.flatness();
  for (Vec3& x : mesh_.nodes) x[mesh_.dim - 1] *= 1e-3;
  vem_.build(0);
  EXPECT_LT(before, 10);
  EXPECT_GT(vem_.flatness(), 100);
}

TEST_P(vem_cells, bubbles_stand_on_the_plus_side_of_each_fracture_face_once) {
  Index bubbles = 0, fracture_faces = 0;
  for (Index face = 0; face < mesh_.n_faces(); ++face) fracture_faces += mesh_.on_fracture(face) ? 1 : 0;
  for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
    vem_.build(cell);
    bubbles += vem_.n_bubbles();
    for (Index face : vem_.bubble_faces()) {
      EXPECT_TRUE(mesh_.on_fracture(face));
      EXPECT_EQ(mesh_.face_cells[face][0], cell);
      EXPECT_LT(vem_.xbar().x(), 0.5) << "n^+ points along x, out of the + side";
    }
  }
  EXPECT_GT(fracture_faces, 0);
  EXPECT_EQ(bubbles, fracture_faces);
}

TEST_P(vem_cells, bubble_adds_its_value_times_area_and_normal_to_the_gradient) {
  // Areas over all bubbles sum to that of the fracture.
  double area = 0;
  for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
    vem_.build(cell);
    for (int b = 0; b < vem_.n_bubbles(); ++b) {
      std::vector<double> v(static_cast<std::size_t>(mesh_.dim) * vem_.size(), 0.0);
      const Vec3 bubble(0.5, -2, 0);
      for (int a = 0; a < mesh_.dim; ++a) v[mesh_.dim * (vem_.n_nodes() + b) + a] = bubble[a];
      const Eigen::Matrix3d gradient = vem_.gradient(v) * vem_.volume();
      const double this_area = gradient(0, 0) / bubble[0];
      EXPECT_GT(this_area, 0);
      EXPECT_LT((gradient - this_area * bubble * Vec3::UnitX().transpose()).norm(), 1e-14);
      EXPECT_LT((vem_.value(vem_.gradient(v), v, vem_.xbar())).norm(), 1e-15) << "bubbles have no part in the nodal mean";
      area += this_area;
    }
  }
  EXPECT_NEAR(area, mesh_.dim == 2 ? 0.5 : 0.25, 1e-13);
}

TEST_P(vem_cells, volumes_and_rules_sum_to_the_box) {
  double volume = 0, weights = 0;
  std::vector<geometry::QuadraturePoint> rule;
  for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
    vem_.build(cell);
    volume += vem_.volume();
    vem_.append_rule(rule);
  }
  for (const auto& q : rule) weights += q.weight;
  EXPECT_NEAR(volume, 1, 1e-13);
  EXPECT_NEAR(weights, 1, 1e-13);
}

TEST_P(vem_cells, bubbles_along_normals_add_what_they_let_through_to_the_divergences_of_both_cells) {
  VemCell with(mesh_, Bubbles::all);
  std::vector<double> through(static_cast<std::size_t>(mesh_.n_faces()), 0.0);  // sum over the cells of a face
  std::vector<int> cells(through.size(), 0);
  for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
    with.build(cell);
    vem_.build(cell);
    EXPECT_EQ(with.n_bubbles(), vem_.n_bubbles());
    EXPECT_EQ(with.size(), vem_.size() + with.n_normals());
    EXPECT_EQ(with.components(), mesh_.dim * vem_.size() + with.n_normals());
    for (int j = 0; j + 1 < with.size(); ++j)
      EXPECT_EQ(with.first_component(j + 1) - with.first_component(j), with.is_normal(j) ? 1 : mesh_.dim);
    for (int k = 0; k < with.n_normals(); ++k) {
      const int j = with.n_nodes() + k;
      const Index face = with.normal_faces()[k];
      EXPECT_FALSE(mesh_.on_fracture(face));
      EXPECT_NEAR(with.normal(j).norm(), 1, 1e-14);
      EXPECT_NEAR(with.c()[j].cross(with.normal(j)).norm(), 0, 1e-13 * with.c()[j].norm());
      through[face] += with.volume() * with.c()[j].dot(with.normal(j));
      ++cells[face];
    }
  }
  for (Index face = 0; face < mesh_.n_faces(); ++face) {
    EXPECT_EQ(cells[face], mesh_.on_fracture(face) ? 0 : mesh_.on_boundary(face) ? 1 : 2);
    if (cells[face] == 2) {
      EXPECT_LT(std::abs(through[face]), 1e-15) << "what leaves one cell enters the other";
    } else if (cells[face] == 1) {
      EXPECT_GT(std::abs(through[face]), 1e-5);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(every_shape, vem_cells, testing::ValuesIn(tests::all_shapes()), tests::ShapeName());

TEST(vem_cell, diameter_is_the_longest_distance_of_two_nodes) {
  mesh::BoxSpec spec = tests::unit_box({3, "hexahedra"}, 1);
  spec.max = {1, 2, 2};
  mesh::PolyMesh mesh = mesh::make_box(spec);
  mesh::build_copies(mesh);
  VemCell vem(mesh);
  vem.build(0);
  EXPECT_DOUBLE_EQ(vem.diameter(), 3);
  EXPECT_DOUBLE_EQ(vem.volume(), 4);
  EXPECT_LT((vem.xbar() - Vec3(0.5, 1, 1)).norm(), 1e-15);
}

}  // namespace
}  // namespace polyslip::spaces
