#include "polyslip/spaces/vem_cell.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "polyslip/geometry/faces.hpp"

namespace polyslip::spaces {

void face_points(const mesh::PolyMesh& mesh, Index face, std::vector<Vec3>& points) {
  points.clear();
  for (Index s : mesh.face_nodes[face]) points.push_back(mesh.nodes[s]);
}

Vec3 bubble_normal(const Vec3& area_vector) {
  const Vec3 n = area_vector.normalized();
  return n.dot(Vec3(1, 0.7310585, 0.4323321)) < 0 ? Vec3(-n) : n;  // a plane that no face of a common mesh lies in
}

std::span<const Vec3> VemCell::weights_of(Index face) {
  if (weights_ != nullptr) return (*weights_)[face];
  face_points(mesh_, face, points_);
  g_.resize(points_.size());
  geometry::vector_weights(mesh_.dim, points_, g_);
  return g_;
}

void VemCell::add_face(Index face) {
  const auto face_nodes = mesh_.face_nodes[face];
  const auto cell_nodes = mesh_.cell_nodes[cell_];
  const std::span<const Vec3> g = weights_of(face);
  const double sign = mesh_.orientation(cell_, face);
  Vec3 area_vector = Vec3::Zero();
  const std::size_t step = g.size() == 1 ? 0 : 1;
  nodes_of_faces_ += static_cast<int>(face_nodes.size());
  for (std::size_t i = 0; i < face_nodes.size(); ++i) {
    const auto s = static_cast<std::size_t>(std::find(cell_nodes.begin(), cell_nodes.end(), face_nodes[i]) - cell_nodes.begin());
    const Vec3 outward = sign * g[step * i];
    c_[s] += outward;
    area_vector += outward;
    volume_ += outward.dot(offsets_[s]);
  }
  if (mesh_.on_fracture(face)) {
    if (mesh_.face_cells[face][0] != cell_) return;
    bubble_faces_.push_back(face);
    bubble_c_.push_back(area_vector);
  } else if (bubbles_ == Bubbles::all) {
    normal_faces_.push_back(face);
    normal_c_.push_back(area_vector);
    normals_.push_back(bubble_normal(area_vector));
  }
}

/// c_s are the gradients of linear finite elements there, and faces need not be asked.
bool VemCell::is_simplex_without_bubbles() const {
  const auto simplex = static_cast<Index>(mesh_.dim) + 1;
  if (bubbles_ == Bubbles::all || n_nodes_ != simplex || mesh_.cell_faces.row_size(cell_) != simplex) return false;
  const auto faces = mesh_.cell_faces[cell_];
  return std::none_of(faces.begin(), faces.end(), [&](Index face) { return mesh_.on_fracture(face); });
}

void VemCell::build_simplex() {
  const Vec3 a = offsets_[1] - offsets_[0], b = offsets_[2] - offsets_[0];
  c_.resize(offsets_.size());
  if (mesh_.dim == 2) {
    const double twice = a.x() * b.y() - a.y() * b.x();
    c_[1] = Vec3(b.y(), -b.x(), 0) / twice;
    c_[2] = Vec3(-a.y(), a.x(), 0) / twice;
    c_[0] = -(c_[1] + c_[2]);
    volume_ = std::abs(twice) / 2;
    return;
  }
  const Vec3 d = offsets_[3] - offsets_[0], towards_1 = b.cross(d);
  const double sixfold = towards_1.dot(a);
  c_[1] = towards_1 / sixfold;
  c_[2] = d.cross(a) / sixfold;
  c_[3] = a.cross(b) / sixfold;
  c_[0] = -(c_[1] + c_[2] + c_[3]);
  volume_ = std::abs(sixfold) / 6;
}

void VemCell::build(Index cell) {
  cell_ = cell;
  const auto nodes = mesh_.cell_nodes[cell];
  n_nodes_ = static_cast<int>(nodes.size());
  xbar_.setZero();
  for (Index s : nodes) xbar_ += mesh_.nodes[s];
  xbar_ /= n_nodes_;
  offsets_.clear();
  for (Index s : nodes) offsets_.push_back(mesh_.nodes[s] - xbar_);

  double longest = 0;
  for (int i = 0; i < n_nodes_; ++i)
    for (int j = 0; j < i; ++j) longest = std::max(longest, (offsets_[i] - offsets_[j]).squaredNorm());
  diameter_ = std::sqrt(longest);

  for (auto* vectors : {&bubble_c_, &normal_c_, &normals_}) vectors->clear();
  bubble_faces_.clear();
  normal_faces_.clear();
  is_simplex_ = is_simplex_without_bubbles();
  if (is_simplex_) return build_simplex();
  c_.assign(nodes.size(), Vec3::Zero());
  volume_ = 0;
  nodes_of_faces_ = 0;
  for (Index face : mesh_.cell_faces[cell]) add_face(face);
  volume_ /= mesh_.dim;
  c_.insert(c_.end(), normal_c_.begin(), normal_c_.end());
  c_.insert(c_.end(), bubble_c_.begin(), bubble_c_.end());
  const double scale = 1 / volume_;
  for (Vec3& c : c_) c *= scale;
}

double VemCell::flops() const {
  const double n = n_nodes_;
  double sum = 3 * n + 3 + 3 * n            // average of the nodes, offsets
               + 8 * n * (n - 1) / 2        // pairs of nodes: difference 3, square 5
               + 3.0 * size() + 2;          // gradient weights over |K|; root, |K|
  if (is_simplex_) return sum + (mesh_.dim == 2 ? 4 + 3 + 2 : 9 + 27 + 5 + 6);  // edges, products of them, |K|, the sum of weights
  sum += 15.0 * nodes_of_faces_;              // sign, c, area vector and volume: 3 + 3 + 3 + 6 a node of a face
  if (weights_ != nullptr) return sum;
  for (Index face : mesh_.cell_faces[cell_]) sum += geometry::vector_weights_flops(mesh_.dim, mesh_.face_nodes.row_size(face));
  return sum;
}

Eigen::Matrix3d VemCell::gradient(std::span<const double> v) const {
  Eigen::Matrix3d grad = Eigen::Matrix3d::Zero();
  const int dim = mesh_.dim;
  for (int j = 0; j < size(); ++j)
    for (int i = 0; i < dim; ++i) grad.row(i) += v[static_cast<std::size_t>(dim * j + i)] * c_[static_cast<std::size_t>(j)].transpose();
  return grad;
}

Vec3 VemCell::value(const Eigen::Matrix3d& gradient_of_v, std::span<const double> v, const Vec3& x) const {
  const int dim = mesh_.dim;
  Vec3 mean = Vec3::Zero();
  for (int s = 0; s < n_nodes_; ++s)
    for (int i = 0; i < dim; ++i) mean[i] += v[static_cast<std::size_t>(dim * s + i)];
  return mean / n_nodes_ + gradient_of_v * (x - xbar_);
}

void VemCell::append_rule(std::vector<geometry::QuadraturePoint>& rule) const {
  for (Index face : mesh_.cell_faces[cell_]) {
    face_points(mesh_, face, points_);
    geometry::append_cone_rule(mesh_.dim, xbar_, points_, mesh_.orientation(cell_, face), rule);
  }
}

}  // namespace polyslip::spaces
