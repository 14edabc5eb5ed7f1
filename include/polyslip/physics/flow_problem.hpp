// What is to be solved in the fluid, free of any file format (scheme.md sections 1, 4, 7): rock and fracture properties, boundary
// conditions, sources, initial state. The scene module fills these structs; assembly and solver read them.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "polyslip/common/expression.hpp"

namespace polyslip::physics {

/// Hydraulic properties of the cells of one region (empty: all) where `where` is not zero; later rules win property by property,
/// so that a rule may give just what differs. Evaluated at the cell centre.
struct HydraulicRule {
  std::string region;
  std::optional<Expression> where;
  /// K_m [m2], symmetric positive definite: xx yy zz xy yz xz (2D: xx yy xy are used). Some rule must give it in every cell.
  std::optional<std::array<Expression, 6>> permeability;
  std::optional<Expression> biot;             ///< b [-], 0 .. 1; 1 where no rule gives it.
  std::optional<Expression> inverse_modulus;  ///< 1/M [1/Pa], 0 for an infinite Biot modulus; 0 where no rule gives it.
  std::string place;
};

/// The fluid in one fracture (or in all: fracture empty); later rules win as a whole. Evaluated at face centres at the start of the run,
/// with the tip distance and the fracture's length at hand.
struct FractureFlowRule {
  std::string fracture;
  Expression contact_aperture;                     ///< d_f^c [m]: hydraulic aperture of the closed fracture.
  std::optional<Expression> permeability;          ///< Tangential K_f [m2], C_f = K_f d_f; d_f^2/12 (cubic law) where not given.
  std::optional<Expression> normal_permeability;   ///< K_fn [m2], T_f = 2 K_fn/(eta d_f); d_f^2/12 where not given.
  Expression dilation;                             ///< tan(psi) [-]: d_f = d_f^c - [u]_n + tan(psi) |[u]_t - [u]_t^0|
  bool barrier = false;                            ///< It interrupts the flow along the fractures that it meets or crosses.
  std::string place;
};

/// Conditions on boundary faces of one tag, or "all", where `where` at their centre is not zero; a later rule wins. Faces that no rule speaks of let no fluid through.
struct FlowBoundaryRule {
  std::string tag;
  std::string name;                   ///< What goes through its faces is recorded under this name; empty: it is not.
  std::optional<Expression> where;
  std::optional<Expression> pressure;  ///< p [Pa]; fractures that reach the boundary there take it too.
  std::optional<Expression> flux;      ///< V.n [m/s], outward (injection is negative); into the rock only.
  std::string place;
};

/// Fluid put in (positive) or taken out.
struct FlowSource {
  enum class Kind { matrix, fracture, well };
  Kind kind = Kind::matrix;
  std::string name;                   ///< matrix: region, fracture: fracture; empty for all. well: its name.
  Expression rate;                    ///< h [1/s] (matrix), h [m/s] (fracture), or volume rate of the whole well [m3/s], 2D [m2/s].
  Vec3 at = Vec3::Zero();             ///< well: the cell that holds this point, or
  std::string on_fracture;            ///< well: where not empty, the face of this fracture nearest to it.
  std::string place;
};

enum class ConductivityTime { previous, current };  ///< C_f and T_f at d_f^{n-1} (energy-stable) or d_f^n.

struct FlowProblem {
  double viscosity = 1e-3;               ///< eta [Pa s]
  double fluid_compressibility = 0;      ///< c_f [1/Pa]: fractures store d_f c_f d/dt p_f besides d/dt d_f.
  bool stationary = false;               ///< No storage: each step is a stationary state.
  ConductivityTime conductivities = ConductivityTime::previous;
  std::vector<HydraulicRule> materials;
  std::vector<FractureFlowRule> fractures;  ///< Empty: fractures carry no fluid and are walls to the flow in the rock.
  std::vector<FlowBoundaryRule> boundary;
  std::vector<FlowSource> sources;
  Expression initial_pressure;                    ///< p(x, t_0) [Pa], rock and fractures.
  std::optional<Expression> reference_pressure;   ///< p_ref(x) [Pa] at which the fluid rests (hydrostatic); the unknown is p - p_ref and
                                                  ///< the flux -(K/eta) grad(p - p_ref). Where not given: a constant.
};

/// Exact solution of the flow, for error norms.
struct ExactFlow {
  std::optional<Expression> pressure;              ///< p [Pa] in the rock
  std::optional<std::array<Expression, 3>> flux;   ///< V_m [m/s]
};

}  // namespace polyslip::physics
