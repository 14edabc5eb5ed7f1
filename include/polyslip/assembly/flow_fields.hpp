// What a user wants to see of a flow state, and its errors against an exact solution.
#pragma once

#include <optional>
#include <vector>

#include "polyslip/assembly/flow_system.hpp"
#include "polyslip/assembly/point_location.hpp"

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

/// Of p_K over all ranks; the mean is weighted by volume [Pa].
struct PressureExtremes {
  double min = 0, max = 0, mean = 0;
};
PressureExtremes pressure_extremes(const FlowSystem& system, Vec q);

/// Of the boundary faces whose rules share a name.
struct BoundaryFigures {
  double outflow = 0;   ///< Through the rock and the fractures that end there [m3/s; 2D: m2/s].
  double pressure = 0;  ///< Mean p_sigma of the rock [Pa].
};
/// The names of boundary rules, each once, in their order.
std::vector<std::string> boundary_names(const physics::FlowProblem& problem);
/// Of each of these names, over all ranks. Collective.
std::vector<BoundaryFigures> boundary_figures(const FlowSystem& system, Vec q);

/// p_K + G_K q.(x - x_K) at points, on all ranks [Pa]: of the cell that holds the point, or comes closest to it. Collective.
class PressureProbes {
 public:
  PressureProbes(const mesh::DistributedMesh& mesh, std::vector<Vec3> points)
      : points_(std::move(points)), cells_(locate_in_cells(mesh, points_)) {}
  [[nodiscard]] std::vector<double> pressures(const FlowSystem& system, Vec q) const;

 private:
  std::vector<Vec3> points_;
  std::vector<Located> cells_;
};

/// Relative L2 errors over the rock: of p_K against the exact pressure at x_K, the usual one of finite volumes, and of V_K by rules of
/// degree 2. Each is |error|/|exact|, or |error| where the exact field vanishes. Only what `exact` gives is compared.
struct FlowErrorNorms {
  std::optional<double> pressure, flux;
};
FlowErrorNorms flow_error_norms(const FlowSystem& system, const physics::ExactFlow& exact, double time, Vec q);

}  // namespace polyslip::assembly
