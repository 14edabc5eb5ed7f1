// Rock, contact and fluid in one backward Euler step (scheme.md sections 1, 3, 4, 6).
//
// Vectors end with the pressures q of the flow system: [ displacement | bubbles | multipliers | q ]. Rows beside those of MechanicsSystem and
// FlowSystem (volumes of fluid, times 1):
//   momentum       - sum_K b|K| q_K div_K v + sum_sigma |sigma| q_sigma^f n^+ . J_sigma v
//   cell           + b|K| (div_K u^n - div_K u^{n-1})
//   fracture face  + |sigma| (d_f^n - d_f^{n-1}),   d_f = d_f^c - J_n + tan(psi) |J_t - J_t^0|  as a value, never through a rate
// Condensed system over [ displacement | q/s ]:  [ P     A_up ]
//                                         [ A_pu  S'   ]   with S' = S + what open faces pass from pressures to pressures,
// pressures in units of s = (2 mu + lambda)/h and flow rows times s, so that all entries are alike in size (stopping tests, pivots).
#pragma once

#include <array>
#include <optional>

#include "polyslip/assembly/flow_system.hpp"
#include "polyslip/assembly/mechanics_system.hpp"
#include "polyslip/la/sum_matrix.hpp"

namespace polyslip::assembly {

class CoupledSystem final : public MechanicsSystem {
 public:
  /// The mesh must have been distributed with its flow entities. The flow system is driven by this one: its apertures, time step, loads.
  CoupledSystem(const mesh::DistributedMesh& mesh, const physics::MechanicsProblem& problem, FlowSystem& flow);

  [[nodiscard]] FlowSystem& flow() const { return flow_; }
  [[nodiscard]] la::Handle<Vec> create_vector() const override;
  [[nodiscard]] la::Handle<Vec> create_condensed_vector() const override;
  [[nodiscard]] Index size() const override { return layout().size() + flow_.layout().size(); }
  [[nodiscard]] bool is_linear_off_contact() const override { return is_linear_off_contact_; }

  /// Whole vector z from mechanics x and pressures q, and back.
  void join(Vec x, Vec q, Vec z) const;
  void split(Vec z, Vec x, Vec q) const;

  // --- the step ---
  /// The step starts from z: its pressures, pore volumes, apertures (also those that conduct, unless conductivities are current).
  /// False, on all ranks, where an aperture is not positive.
  [[nodiscard]] bool begin_step(Vec z, double dt);
  /// Mechanical loads; p_ref is added to them.
  void set_loads(Loads loads) override;
  void impose_dirichlet(Vec z) const override;
  /// Forces of the pore and fracture pressures q + p_ref, as loads of a problem without fluid.
  void add_pressures(Vec q, Loads& loads) const;

  // --- nonlinear rows ---
  void residual(Vec z, Vec f) const override;
  void momentum_action(Vec y, Vec r) const override;
  [[nodiscard]] ResidualNorms norms(Vec z, Vec f) const override;
  /// d_f of each local fracture face [m].
  [[nodiscard]] std::vector<double> apertures(Vec z) const;
  /// Volumes b|K| div_K u + |sigma| d_f that rock and fractures offer the fluid beyond their rest, and what they took up since
  /// the start of the step [m3; 2D: m2], over all ranks.
  [[nodiscard]] double volume_change(Vec z) const;
  /// The same as sum of the changes without signs.
  [[nodiscard]] double volume_turnover(Vec z) const;

  // --- linearisation ---
  void linearise(Vec z, MatrixContent content) override;
  [[nodiscard]] double pressure_scale() const { return scale_; }  ///< s [Pa/m]
  void hold_all_rows() override;
  /// [[P, A_up], [A_pu, S']] as a MATNEST.
  [[nodiscard]] Mat condensed_matrix() const { return nest_; }
  [[nodiscard]] Mat pressure_matrix() const { return pp_->get(); }
  void apply_condensed(Vec x, Vec y) const override;
  void condense_residual(Vec f, Vec condensed) const override;
  void recover(Vec f, Vec condensed, Vec direction) const override;
  /// Whether S' changed with the last linearisation beyond the fractures (time step, conductivities).
  [[nodiscard]] long long flow_matrix_version() const { return flow_matrix_version_; }

 protected:
  /// Also of a Vec without pressures; those of the state then stay.
  void gather(Vec z, MechanicalState& state) const override;
  void scatter(const MechanicalState& state, Vec z) const override;

 private:
  using Visit = la::SumMatrix::Add;
  void attach_fluid();
  void couple_bulk_cells();
  void create_matrices();
  void visit_bulk_up(const Visit& add) const;
  void visit_bulk_pu(const Visit& add) const;
  void visit_blocks(MatrixContent content, const std::array<const Visit*, 3>& add) const;
  void add_fluid_forces(const MechanicalState& state, std::span<double> displacement, std::span<double> bubble) const;
  /// Of p_ref in the rows of bubbles: what it is on their faces more than in the middle of the cell, as with the initial stress.
  void add_rest_on_faces(std::span<double> displacement, std::span<double> bubble) const;
  [[nodiscard]] double aperture(Index face, const Vec3& jump) const;
  /// b|K| div_K u of owned cells and |sigma| d_f of owned fracture faces.
  void volumes(const MechanicalState& state, std::vector<double>& cells, std::vector<double>& faces) const;
  /// What the digits of the displacements leave in the rows of the cells [m3; 2D: m2], over all ranks.
  [[nodiscard]] double displacement_round_off(Vec z) const;
  [[nodiscard]] double sum_of_changes(Vec z, bool without_signs) const;
  void linearise_apertures(Vec z);
  void write_matrices(MatrixContent content);

  FlowSystem& flow_;
  double scale_ = 1;
  bool is_linear_off_contact_;
  Csr bulk_cells_;                ///< One row a bulk cell with a Biot coefficient that matters here: [cell, displacements ...].
  std::vector<double> biot_;      ///< d(b|K| div_K)/d(each of them), one cell behind the other [m2; 2D: m].
  la::Handle<Vec> q_previous_;
  std::vector<double> pore_previous_, aperture_previous_;  ///< b|K| div_K u^{n-1} of owned cells; |sigma| d_f^{n-1} of owned faces.
  std::optional<la::SumMatrix> up_, pu_, pp_;
  la::Handle<Mat> nest_;
  long long flow_matrix_version_ = -1;
  mutable la::Handle<Vec> q_work_, f_work_;
  mutable double flow_scale_ = 0, flow_turnover_ = 0, pressure_force_ = 0;
  mutable MechanicalState state_, rows_;
};

}  // namespace polyslip::assembly
