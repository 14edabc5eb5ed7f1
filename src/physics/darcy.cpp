#include "polyslip/physics/darcy.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "polyslip/common/error.hpp"

namespace polyslip::physics {

namespace {

std::string text(const Vec3& x) { return fmt::format("({:g}, {:g}, {:g})", x.x(), x.y(), x.z()); }

/// The rules that speak last of each property at one point; null where none does.
struct ChosenRules {
  const HydraulicRule* permeability = nullptr;
  const HydraulicRule* biot = nullptr;
  const HydraulicRule* inverse_modulus = nullptr;
};

ChosenRules choose(const std::vector<HydraulicRule>& rules, const std::string& region, const EvalPoint& at) {
  ChosenRules chosen;
  for (const HydraulicRule& rule : rules) {
    if ((!rule.region.empty() && rule.region != region) || (rule.where && (*rule.where)(at) == 0)) continue;
    if (rule.permeability) chosen.permeability = &rule;
    if (rule.biot) chosen.biot = &rule;
    if (rule.inverse_modulus) chosen.inverse_modulus = &rule;
  }
  return chosen;
}

Eigen::Matrix3d permeability_at(int dim, const std::array<Expression, 6>& k, const EvalPoint& at) {
  Eigen::Matrix3d K = Eigen::Matrix3d::Zero();
  K(0, 0) = k[0](at);  // xx yy zz xy yz xz
  K(1, 1) = k[1](at);
  K(0, 1) = K(1, 0) = k[3](at);
  if (dim == 2) return K;
  K(2, 2) = k[2](at);
  K(1, 2) = K(2, 1) = k[4](at);
  K(0, 2) = K(2, 0) = k[5](at);
  return K;
}

void check_permeability(int dim, const Eigen::Matrix3d& K, const HydraulicRule& rule, const Vec3& x) {
  if (K.topLeftCorner(dim, dim).llt().info() == Eigen::Success) return;
  throw InputError(
      fmt::format("permeability xx {:g}, yy {:g}, zz {:g}, xy {:g}, yz {:g}, xz {:g} m2 at {} is not positive definite", K(0, 0),
                  K(1, 1), K(2, 2), K(0, 1), K(1, 2), K(0, 2), text(x)),
      rule.place, "Give a number > 0, or a symmetric tensor with positive eigenvalues (1e-25 where the rock is tight)");
}

void check_biot(double b, const HydraulicRule& rule, const Vec3& x) {
  if (b >= 0 && b <= 1) return;
  throw InputError(fmt::format("Biot coefficient {:g} at {} is not in [0, 1]", b, text(x)), rule.place, "Give 0 <= b <= 1");
}

void check_inverse_modulus(double m, const HydraulicRule& rule, const Vec3& x) {
  if (m >= 0) return;
  throw InputError(fmt::format("inverse Biot modulus {:g} 1/Pa at {} is negative", m, text(x)), rule.place,
                   "Give 1/M >= 0 (0: neither fluid nor grains can be compressed)");
}

}  // namespace

std::vector<HydraulicProperties> cell_hydraulics(const mesh::PolyMesh& mesh, const std::vector<HydraulicRule>& rules) {
  std::vector<HydraulicProperties> cells(static_cast<std::size_t>(mesh.n_cells()));
  for (Index c = 0; c < mesh.n_cells(); ++c) {
    HydraulicProperties& cell = cells[static_cast<std::size_t>(c)];
    const EvalPoint at{.x = mesh::cell_node_average(mesh, c)};
    const std::string& region = mesh.region_names[static_cast<std::size_t>(mesh.cell_region[c])];
    const ChosenRules chosen = choose(rules, region, at);
    if (chosen.permeability == nullptr)
      throw InputError(fmt::format("no permeability is given for the point {} of region '{}'", text(at.x), region), "materials",
                       "Give one in the first entry, without region and where");
    cell.permeability = permeability_at(mesh.dim, *chosen.permeability->permeability, at);
    check_permeability(mesh.dim, cell.permeability, *chosen.permeability, at.x);
    if (chosen.biot != nullptr) check_biot(cell.biot = (*chosen.biot->biot)(at), *chosen.biot, at.x);
    if (chosen.inverse_modulus != nullptr)
      check_inverse_modulus(cell.inverse_modulus = (*chosen.inverse_modulus->inverse_modulus)(at), *chosen.inverse_modulus, at.x);
  }
  return cells;
}

void local_transmissibilities(const spaces::HfvCell& element, const Eigen::Matrix3d& mobility, std::span<double> T) {
  const auto faces = element.faces();
  const int n = element.size();
  const double volume = element.measure();
  const auto g = [&](const spaces::HfvFace& face) { return Vec3(face.area / volume * face.normal); };
  for (int i = 0; i < n; ++i) {
    const Vec3 flux = volume * (mobility * g(faces[i]));
    for (int j = 0; j <= i; ++j) T[static_cast<std::size_t>(i * n + j)] = flux.dot(g(faces[j]));
  }
  std::vector<double> s(static_cast<std::size_t>(n));  // s_k(p) = sum_j s_j v_j
  for (int k = 0; k < n; ++k) {
    const Vec3 y = faces[k].centre - element.centre();
    for (int j = 0; j < n; ++j) s[static_cast<std::size_t>(j)] = (j == k ? 1 : 0) - g(faces[j]).dot(y);
    const double weight = faces[k].area / faces[k].distance * faces[k].normal.dot(mobility * faces[k].normal);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= i; ++j) T[static_cast<std::size_t>(i * n + j)] += weight * s[static_cast<std::size_t>(i)] * s[static_cast<std::size_t>(j)];
  }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < i; ++j) T[static_cast<std::size_t>(j * n + i)] = T[static_cast<std::size_t>(i * n + j)];
}

double transmissibility_flops(int n) {
  const double lower = 0.5 * n * (n + 1);
  return n * (4 + 15 + 3) + lower * (4 + 5)            // volume L g_i, its products with g_j
         + n * (3 + n * (4 + 5 + 1) + 22 + lower * 3)  // each cone: offset, s, weight, the products of s
         + n * (n + 1.0);                              // element: sums of rows and of all
}

void seal_face(std::span<double> T, std::size_t n, std::size_t i) {
  const double diagonal = T[i * n + i];
  for (std::size_t row = 0; row < n; ++row) {
    if (row == i) continue;
    const double ratio = T[row * n + i] / diagonal;
    for (std::size_t column = 0; column < n; ++column) T[row * n + column] -= ratio * T[i * n + column];
    T[row * n + i] = 0;  // and not what round-off leaves
  }
  std::fill_n(T.begin() + static_cast<std::ptrdiff_t>(i * n), n, 0.0);
}

void element_matrix(std::span<const double> T, int n, std::span<double> matrix) {
  const int m = n + 1;
  matrix[0] = 0;
  for (int i = 0; i < n; ++i) {
    double row = 0;
    for (int j = 0; j < n; ++j) {
      matrix[static_cast<std::size_t>((i + 1) * m + j + 1)] = T[static_cast<std::size_t>(i * n + j)];
      row += T[static_cast<std::size_t>(i * n + j)];
    }
    matrix[static_cast<std::size_t>(i + 1)] = matrix[static_cast<std::size_t>((i + 1) * m)] = -row;
    matrix[0] += row;
  }
}

}  // namespace polyslip::physics
