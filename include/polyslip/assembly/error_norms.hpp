// Relative L2 errors against an exact solution, by rules of degree 2: Pi_K u and G_K u in cells, lam_sigma and J_sigma u as constants of
// fracture faces against the exact traces.
#pragma once

#include <optional>

#include "polyslip/assembly/mechanics_fields.hpp"

namespace polyslip::assembly {

struct ErrorNorms {
  std::optional<double> displacement, gradient, multiplier_normal, multiplier_tangential, jump_normal, jump_tangential;
};

/// Each is |error|/|exact|, or |error| where the exact field vanishes. Only what `exact` gives is compared.
ErrorNorms error_norms(const MechanicsSystem& system, const physics::ExactSolution& exact, double time, Vec x);

/// Exact normal jump, tangential jump (3 components) and normal traction at the centres of the owned fracture faces, for plots; empty
/// where `exact` does not give them.
struct ExactFaceFields {
  std::vector<double> jump_normal, jump_tangential, traction_normal;
};
ExactFaceFields exact_face_fields(const MechanicsSystem& system, const physics::ExactSolution& exact, double time);

}  // namespace polyslip::assembly
