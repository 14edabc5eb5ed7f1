// Boxes of every shape, small enough for unit tests, with fractures on planes of the lattice.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "polyslip/mesh/fractures.hpp"
#include "polyslip/mesh/generators.hpp"
#include "polyslip/spaces/vem_cell.hpp"

namespace polyslip::tests {

struct Shape {
  int dim;
  const char* name;
};
inline void PrintTo(const Shape& shape, std::ostream* out) { *out << shape.name << shape.dim << "d"; }

/// Every shape that make_box knows.
inline const std::vector<Shape>& all_shapes() {
  static const std::vector<Shape> shapes{{2, "quads"}, {2, "triangles"}, {2, "polygons"},  {2, "warped"}, {3, "hexahedra"},
                                         {3, "tets"},  {3, "prisms"},    {3, "polyhedra"}, {3, "warped"}, {3, "cut"}};
  return shapes;
}

/// Name of a parameterised test: shape, dimension, bubbles.
struct ShapeAndBubblesName {
  template <class Info>
  std::string operator()(const Info& info) const {
    const auto& [shape, bubbles] = info.param;
    return shape.name + std::to_string(shape.dim) + (bubbles == spaces::Bubbles::all ? "d_bubbles_on_all_faces" : "d");
  }
};

/// Name of a parameterised test: shape and dimension.
struct ShapeName {
  template <class Info>
  std::string operator()(const Info& info) const {
    return info.param.name + std::to_string(info.param.dim) + "d";
  }
};

/// The unit box of n cells along each axis.
inline mesh::BoxSpec unit_box(const Shape& shape, Index n) {
  mesh::BoxSpec spec;
  spec.dim = shape.dim;
  spec.shape = shape.name;
  spec.max = {1, 1, shape.dim == 3 ? 1.0 : 0.0};
  spec.cells = {n, n, shape.dim == 3 ? n : 0};
  return spec;
}

/// A fracture on the plane x = `at`, from `low` to `high` along y (and z); its normal n^+ is e_x, the + side lies at x < `at`.
inline mesh::FractureGeometry upright_fracture(int dim, double at, double low, double high) {
  if (dim == 2) return {"upright", "test", "", {{at, low, 0}, {at, high, 0}}};
  return {"upright", "test", "", {{at, low, low}, {at, low, high}, {at, high, high}, {at, high, low}}};
}

/// The unit box with a fracture on x = 1/2 from `low` to `high`, planes through its ends kept; copies are built. Wants cell counts
/// that put lattice planes there.
inline mesh::PolyMesh fractured_box(const Shape& shape, Index n, double low, double high) {
  mesh::BoxSpec spec = unit_box(shape, n);
  spec.kept_planes = {{0, 0.5}};
  for (int axis = 1; axis < shape.dim; ++axis)
    for (double end : {low, high})
      if (end > 0 && end < 1) spec.kept_planes.emplace_back(axis, end);
  mesh::PolyMesh mesh = mesh::make_box(spec);
  mesh::mark_fractures(mesh, {upright_fracture(shape.dim, 0.5, low, high)});
  mesh::build_copies(mesh);
  return mesh;
}

/// A smooth-looking affine field v(x) = v_0 + G x, the same in all tests.
struct AffineField {
  Vec3 constant;
  Eigen::Matrix3d gradient;

  explicit AffineField(int dim) : constant(0.3, -0.7, dim == 3 ? 0.2 : 0.0), gradient(Eigen::Matrix3d::Zero()) {
    for (int i = 0; i < dim; ++i)
      for (int j = 0; j < dim; ++j) gradient(i, j) = 0.5 + 0.3 * i - 0.7 * j + 0.4 * i * j;
  }
  Vec3 operator()(const Vec3& x) const { return constant + gradient * x; }
};

}  // namespace polyslip::tests
