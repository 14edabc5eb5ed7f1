// The P1-bubble virtual element of one cell (scheme.md section 3): reconstructions G_K and Pi_K.
//
// Local unknowns of K, in this order:
//   j < n_nodes      v_{Ks}, nodes of K in the order of cell_nodes[K]
//   then n_normals   v_sigma n_sigma, bubbles along the normal of faces off Gamma, in the order of normal_faces(); one for both cells of
//                    a face, and only where bubbles are on all faces (then P1-bubble displacements and one pressure a cell are inf-sup stable)
//   to size()-1      v_{Ksigma}, bubbles of the fracture faces whose + side is K, in the order of bubble_faces()
// Gradient:  G_K v = sum_j v_j (x) c_j,   c_s = 1/|K| sum_sigma g_{sigma s},   c_sigma = 1/|K| sum_s g_{sigma s}
// (g: vector weights out of K, geometry/faces.hpp; |sigma| w_s n where sigma is planar). On simplices without bubbles c_s is the gradient of the
// barycentric coordinate of s.
// Function:  Pi_K v(x) = G_K v (x - xbar) + 1/n_nodes sum_s v_{Ks}.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "polyslip/geometry/quadrature.hpp"
#include "polyslip/mesh/poly_mesh.hpp"
#include "polyslip/spaces/face_weights.hpp"

namespace polyslip::spaces {

enum class Bubbles { fracture, all };  ///< Faces with a bubble: + sides of fractures (vectors), or also all others (along the normal).

/// Built for one cell after another; its buffers are reused, so a loop over cells does not allocate.
class VemCell {
 public:
  /// Where vector weights are given (they must outlive this object) they are not computed again.
  explicit VemCell(const mesh::PolyMesh& mesh, Bubbles bubbles = Bubbles::fracture, const FaceWeights* weights = nullptr)
      : mesh_(mesh), bubbles_(bubbles), weights_(weights) {}

  /// Computes everything for one cell.
  void build(Index cell);
  /// Floating-point operations of the last build.
  [[nodiscard]] double flops() const;

  [[nodiscard]] Index cell() const { return cell_; }
  [[nodiscard]] int n_nodes() const { return n_nodes_; }
  [[nodiscard]] int n_bubbles() const { return static_cast<int>(bubble_faces_.size()); }
  [[nodiscard]] int n_normals() const { return static_cast<int>(normal_faces_.size()); }
  [[nodiscard]] int size() const { return static_cast<int>(c_.size()); }
  /// Components of all local unknowns, and the first one of unknown j: dim each, but one for bubbles along the normal.
  [[nodiscard]] int components() const { return first_component(size()); }
  [[nodiscard]] int first_component(int j) const {
    const int before = std::min(std::max(j - n_nodes_, 0), n_normals());  // normals before j
    return mesh_.dim * (j - before) + before;
  }
  [[nodiscard]] bool is_normal(int j) const { return j >= n_nodes_ && j < n_nodes_ + n_normals(); }
  /// Mesh face of a bubble, along the normal or not.
  [[nodiscard]] Index face(int j) const {
    const auto k = static_cast<std::size_t>(j - n_nodes_);
    return is_normal(j) ? normal_faces_[k] : bubble_faces_[k - normal_faces_.size()];
  }
  [[nodiscard]] const Vec3& normal(int j) const { return normals_[static_cast<std::size_t>(j - n_nodes_)]; }  ///< n_sigma of such a j.
  [[nodiscard]] double volume() const { return volume_; }      ///< |K| [m^d]
  [[nodiscard]] double diameter() const { return diameter_; }  ///< h_K [m]
  [[nodiscard]] const Vec3& xbar() const { return xbar_; }     ///< Average of the nodes [m].
  [[nodiscard]] std::span<const Vec3> c() const { return c_; }            ///< Gradient weights [1/m], one a local unknown.
  /// h_K max |c_j|: about h_K over the smallest height of the cell.
  [[nodiscard]] double flatness() const {
    double largest = 0;
    for (const Vec3& c : c_) largest = std::max(largest, c.squaredNorm());
    return diameter_ * std::sqrt(largest);
  }
  [[nodiscard]] std::span<const Vec3> offsets() const { return offsets_; }  ///< x_s - xbar [m], one a node.
  [[nodiscard]] std::span<const Index> bubble_faces() const { return bubble_faces_; }  ///< Mesh faces.
  [[nodiscard]] std::span<const Index> normal_faces() const { return normal_faces_; }  ///< Mesh faces.

  /// G_K v for values v_j of dim components each, v[dim * j + i]; entry (i, k) = d v_i / d x_k.
  [[nodiscard]] Eigen::Matrix3d gradient(std::span<const double> v) const;
  /// Pi_K v(x) with the gradient of v given.
  [[nodiscard]] Vec3 value(const Eigen::Matrix3d& gradient_of_v, std::span<const double> v, const Vec3& x) const;

  /// Appends the degree 2 rule of the cell.
  void append_rule(std::vector<geometry::QuadraturePoint>& rule) const;

 private:
  [[nodiscard]] bool is_simplex_without_bubbles() const;
  void build_simplex();
  void add_face(Index face);
  [[nodiscard]] std::span<const Vec3> weights_of(Index face);

  const mesh::PolyMesh& mesh_;
  Bubbles bubbles_;
  const FaceWeights* weights_;
  Index cell_ = -1;
  bool is_simplex_ = false;  ///< And without bubbles.
  int n_nodes_ = 0, nodes_of_faces_ = 0;
  double volume_ = 0, diameter_ = 0;
  Vec3 xbar_ = Vec3::Zero();
  std::vector<Vec3> c_, offsets_, bubble_c_, normal_c_, normals_;
  std::vector<Index> bubble_faces_, normal_faces_;
  mutable std::vector<Vec3> points_, g_;
};

/// n_sigma along an area vector of a face: the same for both cells of the face, on every rank.
Vec3 bubble_normal(const Vec3& area_vector);

/// Points of a face in its own order, appended to an emptied buffer.
void face_points(const mesh::PolyMesh& mesh, Index face, std::vector<Vec3>& points);

}  // namespace polyslip::spaces
