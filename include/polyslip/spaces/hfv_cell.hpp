// The Hybrid Finite Volume of one cell, or of one fracture face in its own plane (scheme.md section 4): a polytope K of dimension d
// (cell) or d - 1 (fracture face) with its planar faces sigma (ridges of a fracture face), and the cones D_{K sigma} that join them
// to a centre x_K.
//
// Local unknowns: p_K, and one p_sigma a face in the order of faces(). The identity sum_sigma |sigma| n_{K sigma} (x) (x_sigma -
// x_K) = |K| I makes the construction exact for linear pressures; it needs planar faces.
#pragma once

#include <span>
#include <vector>

#include "polyslip/geometry/faces.hpp"
#include "polyslip/geometry/quadrature.hpp"
#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::spaces {

/// A face sigma (cell), or a ridge (fracture face), as its element K sees it.
struct HfvFace {
  double area;      ///< |sigma| [m^{dim - 1}]; 1 for the ends of a segment.
  Vec3 normal;      ///< Unit, out of K; tangential to the plane of a fracture face.
  Vec3 centre;      ///< x_sigma, the centre of mass [m].
  double distance;  ///< d_{K sigma} = (x_sigma - x_K) . n > 0 [m]; the cone has the measure |sigma| d_{K sigma}/dim.
};

/// Built for one element after another; its buffers are reused, so a loop over elements does not allocate.
class HfvCell {
 public:
  explicit HfvCell(const mesh::PolyMesh& mesh) : mesh_(mesh) {}

  /// A cell; faces() in the order of cell_faces[cell]. Throws InputError with the cell's centre for warped faces, and for a cell
  /// that is star-shaped neither about its centre of mass nor about the average of its nodes.
  void build(Index cell);
  /// A fracture face; faces() are its ridges: 2D ridge i is node i, 3D ridge i joins nodes i and i + 1 (cyclic). Throws likewise.
  void build_fracture_face(Index face);
  /// Floating-point operations of the last build of a cell.
  [[nodiscard]] double flops() const;

  [[nodiscard]] int dim() const { return dim_; }             ///< Of the element: d for a cell, d - 1 for a fracture face.
  [[nodiscard]] double measure() const { return measure_; }  ///< |K| [m^dim]
  [[nodiscard]] const Vec3& centre() const {
    return centre_;
  }  ///< x_K: centre of mass, or the average of the nodes where K is not
     ///< star-shaped about that [m].
  [[nodiscard]] std::span<const HfvFace> faces() const { return faces_; }
  [[nodiscard]] int size() const { return static_cast<int>(faces_.size()); }

  /// G_K p = 1/|K| sum_sigma |sigma| (p_sigma - p_K) n_{K sigma}; p_faces in the order of faces().
  [[nodiscard]] Vec3 gradient(double p_K, std::span<const double> p_faces) const;
  /// Appends the degree 2 rule of the cell that was built last.
  void append_rule(std::vector<geometry::QuadraturePoint>& rule) const;

 private:
  void add_face(Index face);
  void add_ridges(Index face);
  void place_centre(const Vec3& node_average);
  [[nodiscard]] bool put_centre(const Vec3& x);  ///< Whether the element is star-shaped about x.

  const mesh::PolyMesh& mesh_;
  Index cell_ = -1;
  int dim_ = 0;
  double measure_ = 0;
  Vec3 centre_ = Vec3::Zero();
  std::vector<HfvFace> faces_;
  mutable std::vector<Vec3> points_;
  std::vector<Vec3> g_;
  std::vector<double> w_;
};

/// Area, normal and centre of a face of the mesh. Allocates: for places that see each face once.
geometry::FaceGeometry face_geometry(const mesh::PolyMesh& mesh, Index face);

}  // namespace polyslip::spaces
