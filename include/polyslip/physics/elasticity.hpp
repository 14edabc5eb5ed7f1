// Hooke's law and the stiffness of one cell: sum of |K| sigma_K(u):eps_K(v) and the stabilisation S_K(u, v) (scheme.md section 3).
//
// Block of the local unknowns j (test, component a) and k (trial, component b), j and k over nodes and bubbles:
//   |K| ( lambda c_j[a] c_k[b] + mu ( delta_ab c_j.c_k + c_k[a] c_j[b] ) )                          Hooke
//   + gamma h_K^{d-2} delta_ab ( [P^T P]_jk + delta_jk [j is a bubble] ),   P_sj = v_Ks - Pi_K v(x_s)      stabilisation
// contracted with n_sigma where j or k is a bubble along a normal.
// With y_s = x_s - xbar (sum_s y_s = 0) and Q = sum_s y_s y_s^T:
//   [P^T P]_jk = (delta_jk - 1/n)[j, k nodes] - (y_j . c_k)[j node] - (y_k . c_j)[k node] + c_j . Q c_k.
#pragma once

#include <span>

#include "polyslip/physics/problem.hpp"
#include "polyslip/spaces/vem_cell.hpp"

namespace polyslip::physics {

/// Lame moduli of one cell.
struct Lame {
  double mu = 0;      ///< [Pa]
  double lambda = 0;  ///< [Pa]
};

/// Lame moduli of each cell of the mesh (ghosts included), by the rules; shape (n_cells).
/// Throws InputError with rule, cell centre and value where no rule applies or moduli are not admissible (mu > 0, 2 mu + 3 lambda > 0).
std::vector<Lame> cell_moduli(const mesh::PolyMesh& mesh, const std::vector<ElasticRule>& rules);

/// sigma = 2 mu eps + lambda tr(eps) I [Pa]; plane strain in 2D (the zz component included).
Eigen::Matrix3d stress(const Lame& lame, const Eigen::Matrix3d& gradient);

/// sigma_0 at a point from its six entries [Pa]: xx yy zz xy yz xz.
Eigen::Matrix3d initial_stress(const std::array<Expression, 6>& entries, const EvalPoint& at);

/// Factor gamma of the stabilisation [Pa].
double stabilisation_factor(const Lame& lame, Stabilisation kind);

enum class Blocks { all, lower };  ///< Of a cell's matrix: every block (j, k), or those with k <= j.

/// Stiffness of one cell; `matrix` is row-major of shape (components(), components()), row first_component(j) + a. Other blocks are not touched.
void local_stiffness(int dim, const spaces::VemCell& cell, const Lame& lame, double gamma, std::span<double> matrix, Blocks blocks = Blocks::all);
/// Its floating-point operations, but for bubbles along normals (they take another 2 dim^2 - 1 or so a block).
double stiffness_flops(int dim, const spaces::VemCell& cell, Blocks blocks = Blocks::all);

}  // namespace polyslip::physics
