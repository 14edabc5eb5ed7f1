// Darcy's law in one cell or fracture face by Hybrid Finite Volumes (scheme.md section 4).
//
// With v_i = p_i - p_K on the faces, y_i = x_i - x_K, g_i = |sigma_i| n_i/|K| (so that G_K p = sum_i v_i g_i) and the mobility
// L = K_m/eta, the bilinear form over the cones is, L being constant in K,
//   int_K L Grad p . Grad q = |K| G_K p . L G_K q + sum_i w_i s_i(p) s_i(q),
//   s_i(p) = v_i - G_K p . y_i,   w_i = |D_i| d/d_i^2 n_i . L n_i = |sigma_i|/d_i n_i . L n_i
// (R_{K sigma} = sqrt(d)/d_i s_i; the products of G_K and R vanish as sum_i |sigma_i| n_i s_i = 0). Hence the fluxes out of K
//   F_i = sum_j T_ij (p_K - p_j),   T_ij = |K| g_i . L g_j + sum_k w_k s_ki s_kj,   s_ki = delta_ki - g_i . y_k.
// The squares are added as they are: multiplied out, terms of a sliver of height e h cancel from 1/e^3 to 1/e.
// T is symmetric and positive definite. As a matrix over [p_K, p_1 .. p_n] the element is [[1'T1, -1'T], [-T1, T]].
// On a fracture face everything lies in its plane, d is d - 1 and L the scalar C_f/eta.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "polyslip/physics/flow_problem.hpp"
#include "polyslip/spaces/hfv_cell.hpp"

namespace polyslip::physics {

/// What the fluid meets in one cell.
struct HydraulicProperties {
  Eigen::Matrix3d permeability = Eigen::Matrix3d::Zero();  ///< K_m [m2]; 2D: only the leading 2 x 2 block.
  double biot = 1;                                         ///< b [-]
  double inverse_modulus = 0;                              ///< 1/M [1/Pa]
};

/// Properties of each cell of the mesh (ghosts included), by the rules, at the average of its nodes; shape (n_cells).
/// Throws InputError with rule, cell centre and value where no rule applies, K_m is not positive definite, b not in [0, 1] or 1/M <
/// 0.
std::vector<HydraulicProperties> cell_hydraulics(const mesh::PolyMesh& mesh, const std::vector<HydraulicRule>& rules);

/// T of one element for the mobility L [m2/(Pa s)] (fracture faces: any L = C_f/eta I, [m3/(Pa s)]); row-major, shape (size(),
/// size()).
void local_transmissibilities(const spaces::HfvCell& element, const Eigen::Matrix3d& mobility, std::span<double> T);

/// Floating-point operations of T and then of the element's matrix, for n faces.
double transmissibility_flops(int n);

/// Lets nothing through face i: its p_i becomes that for which F_i = 0, and is eliminated from the other fluxes. Row and column i of
/// T, shape (n, n), are 0 then. Faces may be sealed one after another, each once.
void seal_face(std::span<double> T, std::size_t n, std::size_t i);

/// The element over [p_K, p_1 .. p_n] from its T; row-major, shape (n + 1, n + 1).
void element_matrix(std::span<const double> T, int n, std::span<double> matrix);

}  // namespace polyslip::physics
