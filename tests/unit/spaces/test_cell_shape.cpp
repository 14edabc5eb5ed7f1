// Measures of a cell's shape against values by hand.
#include "polyslip/spaces/cell_shape.hpp"

#include <gtest/gtest.h>

#include "support/boxes.hpp"

namespace polyslip::spaces {
namespace {

/// One box of the given sides.
mesh::PolyMesh brick(int dim, const Vec3& sides) {
  mesh::BoxSpec spec = tests::unit_box({dim, dim == 2 ? "quads" : "hexahedra"}, 1);
  spec.max = {sides.x(), sides.y(), sides.z()};
  mesh::PolyMesh mesh = mesh::make_box(spec);
  mesh::build_copies(mesh);
  return mesh;
}

TEST(cell_shape, of_square_and_cube) {
  const mesh::PolyMesh square = brick(2, {2, 2, 0}), cube = brick(3, {3, 3, 3});
  const CellShape flat = ShapeMeter(square).measure(0), solid = ShapeMeter(cube).measure(0);
  EXPECT_NEAR(flat.flatness, 2 * std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(flat.smallest_face, 1 / std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(solid.flatness, 2 * std::sqrt(3.0), 1e-12);
  EXPECT_NEAR(solid.smallest_face, 1 / std::sqrt(3.0), 1e-12);
  EXPECT_EQ(solid.warp, 0);
}

TEST(cell_shape, plates_and_needles_have_about_their_aspect_ratio) {
  const mesh::PolyMesh strip = brick(2, {1, 1e-3, 0}), plate = brick(3, {1, 1, 1e-3}), needle = brick(3, {1, 1e-3, 1e-3});
  EXPECT_NEAR(ShapeMeter(strip).measure(0).flatness, 1e3, 2);
  EXPECT_NEAR(ShapeMeter(plate).measure(0).flatness, 1e3 * 2 * std::sqrt(2.0) / 3, 4);
  EXPECT_NEAR(ShapeMeter(needle).measure(0).flatness, 1e3 * 4 / 3, 4);
  EXPECT_NEAR(ShapeMeter(needle).measure(0).smallest_face, 1e-3, 1e-8);
}

TEST(cell_shape, a_lifted_corner_is_warp) {
  mesh::PolyMesh cube = brick(3, {1, 1, 1});
  for (Vec3& x : cube.nodes)
    if (x == Vec3(1, 1, 1)) x.z() += 0.4;
  // Of the lid: its nodes lie 0.1 off the plane through their average, along the normal of the mean plane (0.2, 0.2, -1)/sqrt(1.08).
  EXPECT_NEAR(ShapeMeter(cube).measure(0).warp, 0.1 / std::sqrt(1.08) / std::sqrt(std::sqrt(1.08)), 0.01);
}

}  // namespace
}  // namespace polyslip::spaces
