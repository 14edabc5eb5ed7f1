#include "polyslip/physics/elasticity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "polyslip/common/error.hpp"
#include "polyslip/common/processor.hpp"

namespace polyslip::physics {

namespace {

Lame moduli_at(const ElasticRule& rule, const EvalPoint& at) {
  const double a = rule.first(at), b = rule.second(at);
  if (rule.pair == ElasticRule::Pair::lame) return {a, b};
  return {a / (2 * (1 + b)), a * b / ((1 + b) * (1 - 2 * b))};
}

void check_admissible(const Lame& lame, const ElasticRule& rule, const Vec3& x) {
  if (lame.mu > 0 && 2 * lame.mu + 3 * lame.lambda > 0 && std::isfinite(lame.lambda)) return;
  throw InputError(fmt::format("elastic moduli mu = {:g} Pa, lambda = {:g} Pa at ({:g}, {:g}, {:g}) are not those of a stable solid", lame.mu,
                               lame.lambda, x.x(), x.y(), x.z()),
                   rule.place, "Give E > 0 and -1 < nu < 0.5 (or mu > 0 and lambda > -2 mu/3)");
}

/// Writes block (j, k) into the matrix of a cell, contracted with the normals of bubbles that have one component.
template <int dim>
void write_block(const spaces::VemCell& cell, int j, int k, const Eigen::Matrix<double, dim, dim>& block, std::span<double> matrix) {
  const auto width = static_cast<std::size_t>(cell.components());
  double* at = &matrix[static_cast<std::size_t>(cell.first_component(j)) * width + static_cast<std::size_t>(cell.first_component(k))];
  if (cell.is_normal(j) && cell.is_normal(k)) {
    *at = cell.normal(j).template head<dim>().dot(block * cell.normal(k).template head<dim>());
    return;
  }
  for (int a = 0; a < dim; ++a) {
    if (cell.is_normal(j))
      at[a] = cell.normal(j).template head<dim>().dot(block.col(a));
    else if (cell.is_normal(k))
      at[static_cast<std::size_t>(a) * width] = cell.normal(k).template head<dim>().dot(block.row(a).transpose());
    else
      for (int b = 0; b < dim; ++b) at[static_cast<std::size_t>(a) * width + static_cast<std::size_t>(b)] = block(a, b);
  }
}

template <int dim>
POLYSLIP_BY_PROCESSOR void stiffness(const spaces::VemCell& cell, const Lame& lame, double gamma, std::span<double> matrix, Blocks blocks) {
  using VecD = Eigen::Matrix<double, dim, 1>;
  using Block = Eigen::Matrix<double, dim, dim>;
  const int n = cell.n_nodes(), m = cell.size(), width = cell.components();
  const double volume = cell.volume(), scale = gamma * std::pow(cell.diameter(), dim - 2);
  const auto c = cell.c();
  const auto y = cell.offsets();
  Block inertia = Block::Zero();
  for (const Vec3& v : y) inertia += v.head<dim>() * v.head<dim>().transpose();
  for (int j = 0; j < m; ++j) {
    const VecD cj = c[j].template head<dim>();
    const VecD inertia_cj = inertia * cj, lambda_cj = volume * lame.lambda * cj, mu_cj = volume * lame.mu * cj;
    // All of a row from the same products: mirrored halves lose half the digits of linear fields on slivers, where the assembly takes all blocks.
    for (int k = 0, end = blocks == Blocks::all ? m : j + 1; k < end; ++k) {
      const VecD ck = c[k].template head<dim>();
      double p = inertia_cj.dot(ck);
      if (j < n) p -= y[j].template head<dim>().dot(ck);
      if (k < n) p -= y[k].template head<dim>().dot(cj);
      if (j < n && k < n) p -= 1.0 / n;
      if (j == k) p += 1;
      const double diagonal = mu_cj.dot(ck) + scale * p;
      const auto entry = [&](int a, int b) { return lambda_cj[a] * ck[b] + mu_cj[b] * ck[a] + (a == b ? diagonal : 0); };
      if (cell.n_normals() > 0) {
        write_block<dim>(cell, j, k, Block::NullaryExpr(entry), matrix);
        continue;
      }
      double* at = &matrix[static_cast<std::size_t>(dim * (j * width + k))];
      for (int a = 0; a < dim; ++a, at += width)
        for (int b = 0; b < dim; ++b) at[b] = entry(a, b);
    }
  }
}

}  // namespace

std::vector<Lame> cell_moduli(const mesh::PolyMesh& mesh, const std::vector<ElasticRule>& rules) {
  std::vector<Lame> moduli(static_cast<std::size_t>(mesh.n_cells()));
  const bool vary = std::any_of(rules.begin(), rules.end(), [](const ElasticRule& rule) {
    return rule.where || !rule.first.is_constant() || !rule.second.is_constant();
  });
  for (Index cell = 0; cell < mesh.n_cells(); ++cell) {
    if (!vary && cell > 0 && mesh.cell_region[cell] == mesh.cell_region[cell - 1]) {
      moduli[cell] = moduli[cell - 1];
      continue;
    }
    const EvalPoint at{.x = mesh::cell_node_average(mesh, cell)};
    const std::string& region = mesh.region_names[static_cast<std::size_t>(mesh.cell_region[cell])];
    const ElasticRule* chosen = nullptr;
    for (const ElasticRule& rule : rules)
      if ((rule.region.empty() || rule.region == region) && (!rule.where || (*rule.where)(at) != 0)) chosen = &rule;
    if (chosen == nullptr)
      throw InputError(fmt::format("no material covers the point ({:g}, {:g}, {:g}) of region '{}'", at.x.x(), at.x.y(), at.x.z(), region),
                       "materials", "Add a material without region and where as the first entry");
    moduli[static_cast<std::size_t>(cell)] = moduli_at(*chosen, at);
    check_admissible(moduli[static_cast<std::size_t>(cell)], *chosen, at.x);
  }
  return moduli;
}

Eigen::Matrix3d stress(const Lame& lame, const Eigen::Matrix3d& gradient) {
  return lame.mu * (gradient + gradient.transpose()) + lame.lambda * gradient.trace() * Eigen::Matrix3d::Identity();
}

Eigen::Matrix3d initial_stress(const std::array<Expression, 6>& entries, const EvalPoint& at) {
  const double xy = entries[3](at), yz = entries[4](at), xz = entries[5](at);
  Eigen::Matrix3d s;
  s << entries[0](at), xy, xz, xy, entries[1](at), yz, xz, yz, entries[2](at);
  return s;
}

double stabilisation_factor(const Lame& lame, Stabilisation kind) {
  return kind == Stabilisation::mu ? lame.mu : 2 * lame.mu + (kind == Stabilisation::two_mu_lambda ? lame.lambda : 0);
}

void local_stiffness(int dim, const spaces::VemCell& cell, const Lame& lame, double gamma, std::span<double> matrix, Blocks blocks) {
  if (dim == 2)
    stiffness<2>(cell, lame, gamma, matrix, blocks);
  else
    stiffness<3>(cell, lame, gamma, matrix, blocks);
}

double stiffness_flops(int dim, const spaces::VemCell& cell, Blocks blocks) {
  const double d = dim, n = cell.n_nodes(), m = cell.size(), dot = 2 * d - 1;
  const auto triangle = [](double k) { return k * (k + 1) / 2; };
  const bool all = blocks == Blocks::all;
  const double pairs = all ? m * m : triangle(m), pairs_of_nodes = all ? n * n : triangle(n);
  const double j_is_node = all ? n * m : pairs_of_nodes, k_is_node = all ? n * m : pairs_of_nodes + n * (m - n);
  return n * 2 * d * d                       // inertia
         + m * (d * dot + 2 * d)             // inertia c_j, |K| lambda c_j, |K| mu c_j
         // blocks: p; lambda c_j (x) c_k + mu c_k (x) c_j; mu c_j.c_k and the diagonal
         + pairs * (dot + 3 * d * d + dot + 2 + d)
         // p: y_j.c_k and y_k.c_j, 1/n, 1
         + (j_is_node + k_is_node) * (dot + 1) + pairs_of_nodes + m;
}

}  // namespace polyslip::physics
