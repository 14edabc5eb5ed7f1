// How a fracture conducts fluid at a given aperture d_f (scheme.md sections 1, 4): along itself with C_f/eta, C_f = K_f d_f, and
// through each of its sides with T_f = 2 K_fn/(eta d_f); K_f and K_fn are d_f^2/12 (cubic law) unless given.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "polyslip/mesh/poly_mesh.hpp"
#include "polyslip/physics/flow_problem.hpp"

namespace polyslip::physics {

/// Flow properties of one fracture face.
struct FractureHydraulics {
  double contact_aperture = 0;                ///< d_f^c [m], > 0
  double dilation = 0;                        ///< tan(psi) [-]
  std::optional<double> permeability;         ///< K_f [m2]
  std::optional<double> normal_permeability;  ///< K_fn [m2]
  bool barrier = false;                       ///< Whether it interrupts the flow along the fractures that it meets.
};

/// Properties of each of the `faces` of the mesh, by the rules, at its centre; aligned with `faces`.
/// Throws InputError with rule, face centre and value where no rule applies, or an aperture or permeability is not positive.
std::vector<FractureHydraulics> fracture_hydraulics(const mesh::PolyMesh& mesh, std::span<const Index> faces,
                                                    const std::vector<FractureFlowRule>& rules);

/// Conductivities at one aperture and their derivatives to it.
struct FractureConductivity {
  double along = 0;      ///< C_f/eta [m3/(Pa s)]
  double d_along = 0;    ///< d(C_f/eta)/d d_f [m2/(Pa s)]
  double through = 0;    ///< T_f [m/(Pa s)]
  double d_through = 0;  ///< d T_f/d d_f [1/(Pa s)]
};

/// Wants an aperture > 0.
FractureConductivity fracture_conductivity(const FractureHydraulics& face, double aperture, double viscosity);

}  // namespace polyslip::physics
