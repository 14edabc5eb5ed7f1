// Shapes whose faces are planar, as flow wants them.
#pragma once

#include "support/boxes.hpp"

namespace polyslip::tests {

/// all_shapes() without shaken hexahedra.
inline std::vector<Shape> planar_shapes() {
  std::vector<Shape> shapes = all_shapes();
  std::erase_if(shapes, [](const Shape& shape) { return shape.dim == 3 && std::string(shape.name) == "warped"; });
  return shapes;
}

}  // namespace polyslip::tests
