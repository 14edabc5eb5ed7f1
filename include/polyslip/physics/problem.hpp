// What is to be solved, free of any file format: materials, loads, boundary conditions, contact laws, exact solution.
// The scene module fills these structs; assembly and solver read them.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "polyslip/common/expression.hpp"
#include "polyslip/spaces/vem_cell.hpp"

namespace polyslip::physics {

/// Elastic moduli of the cells of one region (empty: all) where `where` is not zero; later rules win.
struct ElasticRule {
  enum class Pair { young_poisson, lame };  ///< (E [Pa], nu [-]) or (mu [Pa], lambda [Pa])
  std::string region;
  std::optional<Expression> where;
  Pair pair = Pair::young_poisson;
  Expression first, second;  ///< E and nu, or mu and lambda; evaluated at the cell centre.
  std::string place;         ///< For messages.
};

/// Conditions on the boundary faces of one tag; a later rule for the same component wins.
struct BoundaryRule {
  std::string tag;                                          ///< Side or physical group; "all" for the whole boundary.
  std::array<std::optional<Expression>, 3> displacement{};  ///< [m], by component; components not given are free.
  std::array<std::optional<Expression>, 3> traction{};      ///< [Pa], by component.
  std::optional<Expression> pressure;                       ///< [Pa], traction -pressure n.
  std::string place;
};

/// Factor of S_K (scheme.md section 3): mu, 2mu or 2mu + lambda. S_K resists the bending of cells that are no simplices; a square would
/// bend like a beam with 4/3 mu (lambda + mu)/(lambda + 2mu), which lies between 2/3 mu and 4/3 mu.
enum class Stabilisation { mu, two_mu, two_mu_lambda };

enum class FrictionLaw { frictionless, tresca, coulomb };

/// Contact on one fracture (or on all: fracture empty); later rules win.
struct ContactRule {
  std::string fracture;
  FrictionLaw law = FrictionLaw::coulomb;
  Expression friction;           ///< F [-] (Coulomb) or the friction bound [Pa] (Tresca); evaluated at the face centre.
  Expression fracture_pressure;  ///< Given fluid pressure p_f [Pa] inside the fracture; 0 where not given.
  std::string place;
};

enum class Formulation { condensed, saddle };

struct MechanicsProblem {
  std::vector<ElasticRule> materials;
  std::vector<BoundaryRule> boundary;
  std::array<Expression, 3> body_force;  ///< f [N/m3]
  Stabilisation stabilisation = Stabilisation::two_mu;
  spaces::Bubbles bubbles = spaces::Bubbles::fracture;
  /// sigma_0 [Pa], tension positive: xx yy zz xy yz xz at the cell centre (2D: yz = xz = 0); the effective stress is
  /// sigma_0 + C:eps(u).
  std::optional<std::array<Expression, 6>> initial_stress;
  std::vector<ContactRule> contact;
  Formulation formulation = Formulation::condensed;
  double beta_scale = 0.02;  ///< beta_n = beta_t = beta_scale (2 mu + lambda)/h_K
};

/// Exact solution for error norms; only what is given is compared.
struct ExactSolution {
  std::optional<std::array<Expression, 3>> displacement;                ///< [m]
  std::optional<std::array<std::array<Expression, 3>, 3>> gradient;     ///< gradient[i][j] = d u_i / d x_j
  std::optional<Expression> multiplier_normal;                          ///< lam_n [Pa], compression positive
  std::optional<std::array<Expression, 3>> multiplier_tangential;       ///< lam_t [Pa], Cartesian
  std::optional<Expression> jump_normal;                                ///< [u]_n = [u].n^+ [m], opening negative
  std::optional<std::array<Expression, 3>> jump_tangential;             ///< [u]_t [m], Cartesian
  std::optional<Expression> faces;  ///< Fracture faces whose centre gives a non-zero value enter the fracture norms; all if absent.
};

/// Load steps from `start` to `end`; a static scene has one.
struct TimeSpan {
  double start = 0, end = 1, step = 1;   ///< [s]
  double smallest_step = 0;              ///< A step that fails is cut down to this [s]; 0: step/1024.
  double largest_step = 0;               ///< Steps that go well may grow to this [s], at least `step`; 0: step.
  std::vector<double> outputs = {};      ///< Times at which a step ends exactly [s]: increasing, after `start`, not after `end`.
};

/// Where a run starts.
struct InitialState {
  /// True: from the equilibrium under the loads at time.start with the initial pressures, fractures stuck or open as they come;
  /// slip and storage are measured from it. False: from zero displacement, so that loads at time.start act within the first step.
  bool equilibrium = false;
};

}  // namespace polyslip::physics
