// The energy that a step of the coupled system takes up, gives off and is given (scheme.md section 5).
//
// Testing the momentum rows with u^n - u^{n-1} and the flow rows with q^n gives, for backward Euler,
//   E^n - E^{n-1} + contact + dilation + darcy  =  work - numerical dissipation  <=  work,
//   E = 1/2 u.Ku (stabilisation included) + 1/2 q.Dq,   contact = sum |sigma| lam.(J^n - J^{n-1}),   darcy = dt q.Hq,
//   dilation = sum |sigma| q_f tan(psi) (|J_t - J_t^0|^n - |J_t - J_t^0|^{n-1}),
//   work = loads and prescribed displacements on u^n - u^{n-1}, sources and prescribed pressures on dt q^n.
#pragma once

#include "polyslip/assembly/coupled_system.hpp"

namespace polyslip::assembly {

/// All in J (2D: J/m).
struct EnergyStep {
  double elastic = 0, fluid = 0;  ///< At the end of the step.
  double change = 0;              ///< E^n - E^{n-1}
  double contact = 0, dilation = 0, darcy = 0, work = 0;
  /// How far energy appeared from nowhere; not above round-off and solver tolerances.
  [[nodiscard]] double excess() const { return change + contact + dilation + darcy - work; }
  /// Size of what was exchanged.
  [[nodiscard]] double turnover() const;
};

/// Of the step from `before` to `after`, both vectors of the system, whose loads, apertures and time step are still those of the step.
/// `elastic_before` is EnergyStep::elastic of the state before (elastic_energy at the start).
EnergyStep energy_of_step(const CoupledSystem& system, Vec before, Vec after, double elastic_before);

/// 1/2 u.Ku [J; 2D: J/m].
double elastic_energy(const CoupledSystem& system, Vec z);

}  // namespace polyslip::assembly
