// The discrete flow of one time step (scheme.md section 4) in the unknowns q = p - p_ref over cells, traces, fracture faces and
// ridges:
//   D (q^n - q^{n-1}) + dt (H q^n - Q) = 0,   matrix S = D + dt H,
// with the storage D (|K|/M on cells, |sigma| d_f c_f on fracture faces, 0 elsewhere), the fluxes H (flow_operator.hpp) and the
// sources Q. Rows are volumes of fluid [m3; 2D: m2], so that S is symmetric. Rows and columns of prescribed unknowns keep their
// diagonal entry alone. What moves pore and fracture volumes (b div u, d_f) is left to a coupled system, which finds here all that
// it needs.
#pragma once

#include "polyslip/assembly/flow_loads.hpp"
#include "polyslip/assembly/flow_operator.hpp"

namespace polyslip::assembly {

/// What goes through the books of one step [m3; 2D: m2], over all ranks.
struct FluidBalance {
  double stored = 0;    ///< sum D (q^n - q^{n-1})
  double injected = 0;  ///< dt times sources and wells.
  double outflow = 0;   ///< dt times what leaves through the boundary, prescribed fluxes included.
  double turnover = 0;  ///< Sum of what flows and is stored anywhere, without signs: the scale of an error.
  [[nodiscard]] double error() const { return stored + outflow - injected; }
};

class FlowSystem {
 public:
  /// Starts with the contact apertures and a time step of 1. Throws InputError, on all ranks alike.
  FlowSystem(const mesh::DistributedMesh& mesh, const physics::FlowProblem& problem);

  [[nodiscard]] const mesh::DistributedMesh& mesh() const { return mesh_; }
  [[nodiscard]] const physics::FlowProblem& problem() const { return problem_; }
  [[nodiscard]] const FlowLayout& layout() const { return layout_; }
  [[nodiscard]] const FlowOperator& fluxes() const { return operator_; }
  [[nodiscard]] const FlowLoadAssembler& load_assembler() const { return load_assembler_; }
  /// Biot coefficient, 1/M and permeability of each local cell.
  [[nodiscard]] std::span<const physics::HydraulicProperties> rock() const { return rock_; }
  /// Contact aperture, dilation and permeabilities of each local fracture face; empty where fractures carry no fluid.
  [[nodiscard]] std::span<const physics::FractureHydraulics> fractures() const { return fractures_; }
  /// p_ref at a point and of each local unknown (0 for drops) [Pa].
  [[nodiscard]] double reference_at(const Vec3& x) const;
  [[nodiscard]] std::span<const double> reference() const { return reference_; }
  /// 1 on local unknowns with a prescribed pressure.
  [[nodiscard]] const std::vector<char>& fixed() const { return load_assembler_.fixed(); }

  /// q of the initial pressure at a time, prescribed values not yet imposed.
  void set_initial(double time, Vec q) const;

  // --- the step ---
  /// d_f [m] of each local fracture face, for conductivities and storage. Where one is not positive on any rank, nothing changes
  /// and the result is false on all ranks. Collective.
  [[nodiscard]] bool set_apertures(std::span<const double> apertures);
  /// The same for the conductivities alone, where these are taken at the end of the step.
  [[nodiscard]] bool set_conducting_apertures(std::span<const double> apertures);
  /// dt [s]; a stationary problem drops the storage and takes 1.
  void set_time_step(double dt);
  [[nodiscard]] double time_step() const { return dt_; }
  void set_loads(FlowLoads loads) { loads_ = std::move(loads); }
  [[nodiscard]] const FlowLoads& loads() const { return loads_; }
  /// Writes the prescribed values into q.
  void impose(Vec q) const;

  // --- equations ---
  /// S, brought up to date; its pattern never changes, and its values only with apertures and time step.
  Mat matrix();
  /// Grows whenever matrix() has new values.
  [[nodiscard]] long long matrix_version() const { return matrix_version_; }
  /// f = D (q - q_previous) + dt (H q - Q) on free unknowns, 0 on prescribed ones (q must have its values).
  void residual(Vec q, Vec q_previous, Vec f) const;
  /// What the digits of q leave of the residual in a norm, whatever is solved [m3]: that of eps |S_ii q_i|. No solver gets much below.
  [[nodiscard]] double round_off(Vec q, NormType norm = NORM_1);
  /// Diagonal of D [m3/Pa].
  [[nodiscard]] Vec storage() const { return storage_; }
  /// C_f/eta and T_f of each local fracture face at the conducting aperture, and their derivatives to it.
  [[nodiscard]] std::span<const physics::FractureConductivity> conductivities() const { return conductivities_; }

  // --- books ---
  [[nodiscard]] FluidBalance balance(Vec q, Vec q_previous) const;
  /// q.Dq/2 [J; 2D: J/m]: |p - p_ref|^2/(2M) over the rock, and its like in the fractures.
  [[nodiscard]] double stored_energy(Vec q) const;
  /// Power that the flow takes from prescribed pressures, sources and boundary fluxes: q.Q + sum over prescribed q (H q - Q) [W].
  [[nodiscard]] double power_input(Vec q) const;

 private:
  [[nodiscard]] std::vector<physics::FractureHydraulics> fracture_properties() const;
  [[nodiscard]] std::vector<char> barriers() const;
  [[nodiscard]] std::vector<double> contact_apertures() const;
  [[nodiscard]] std::vector<physics::FractureConductivity> conductivities_at(std::span<const double> apertures) const;
  [[nodiscard]] double mean_initial_pressure() const;
  [[nodiscard]] std::vector<double> reference_values() const;
  void write_storage();
  /// Whether values differ from those known, on any rank.
  [[nodiscard]] bool differ(std::span<const double> apertures, std::span<const double> known) const;
  [[nodiscard]] bool all_positive(std::span<const double> apertures) const;
  /// y = H q
  void apply_fluxes(Vec q, Vec y) const { POLYSLIP_PETSC(MatMult(operator_.matrix(), q, y)); }

  const mesh::DistributedMesh& mesh_;
  const physics::FlowProblem& problem_;
  std::vector<physics::HydraulicProperties> rock_;
  std::vector<physics::FractureHydraulics> fractures_;
  std::vector<double> conducting_apertures_, storing_apertures_;
  std::vector<physics::FractureConductivity> conductivities_;
  FlowLayout layout_;
  FlowOperator operator_;
  double constant_reference_;  ///< p_ref where the problem gives none: the mean initial pressure.
  std::vector<double> reference_;
  FlowLoadAssembler load_assembler_;
  FlowLoads loads_;
  double dt_ = 1;
  la::Handle<Vec> storage_;
  la::Handle<Mat> matrix_;
  bool matrix_is_stale_ = true;
  long long matrix_version_ = 0;
  la::Handle<Vec> work_;
};

}  // namespace polyslip::assembly
