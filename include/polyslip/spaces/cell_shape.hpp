// How far the shape of a cell is from what the schemes are accurate on.
#pragma once

#include <limits>
#include <vector>

#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::spaces {

/// All without unit.
struct CellShape {
  double flatness = 0;       ///< h_K |dK|/(d |K|): 2.8 for a square, 3.5 for a cube, about the aspect ratio for flat and for needle-shaped cells.
  double smallest_face = 1;  ///< Smallest length of an edge or root of the area of a face, over h_K.
  double warp = 0;           ///< Largest distance of a node from the mean plane of a face, over the root of the face's area; 3D.
};

/// Of the cells of a mesh. Each face is measured once, for the cells on both of its sides.
class ShapeMeter {
 public:
  explicit ShapeMeter(const mesh::PolyMesh& mesh);
  CellShape measure(Index cell);
  /// h_K of the cell measured last [m].
  [[nodiscard]] double diameter() const { return diameter_; }

 private:
  /// What the faces of a cell add up to.
  struct Sums {
    double surface = 0, volume = 0;  ///< |dK|, d |K|
    double smallest_square = std::numeric_limits<double>::infinity(), warp = 0;
  };
  void add_face(Index face);

  const mesh::PolyMesh& mesh_;
  double diameter_ = 0;
  std::vector<Sums> sums_;  ///< By cell.
  std::vector<Vec3> points_, g_;
  std::vector<double> w_;
};

}  // namespace polyslip::spaces
