// What a user wants to see of a flow state, and its errors against an exact solution.
#pragma once

#include <optional>
#include <vector>

#include "polyslip/assembly/flow_system.hpp"

namespace polyslip::assembly {

/// p_K of each owned cell [Pa].
std::vector<double> cell_pressures(const FlowSystem& system, Vec q);

/// V_K = -(K_m/eta) G_K q of each owned cell [m/s], three components each.
std::vector<double> cell_fluxes(const FlowSystem& system, Vec q);

/// p_sigma^f of each local fracture face, ghosts included [Pa]; empty where fractures carry no fluid.
std::vector<double> fracture_pressures(const FlowSystem& system, Vec q);

/// V_f = -(C_f/eta) G_sigma q of each owned fracture face [m2/s], Cartesian, three components each; empty where fractures carry no
/// fluid.
std::vector<double> fracture_fluxes(const FlowSystem& system, Vec q);

/// Relative L2 errors over the rock by rules of degree 2: of p_K + G_K q.(x - x_K) (and p_ref where it is given), and of V_K. Each
/// is |error|/|exact|, or |error| where the exact field vanishes. Only what `exact` gives is compared.
struct FlowErrorNorms {
  std::optional<double> pressure, flux;
};
FlowErrorNorms flow_error_norms(const FlowSystem& system, const physics::ExactFlow& exact, double time, Vec q);

}  // namespace polyslip::assembly
