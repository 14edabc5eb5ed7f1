// The discrete problem of a scene and its state: rock, fluid, or both. The one place that knows which kind of step a scene takes.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "polyslip/scene/scene.hpp"
#include "polyslip/solver/coupled_step.hpp"
#include "polyslip/solver/darcy_step.hpp"
#include "polyslip/solver/mechanics_step.hpp"

namespace polyslip::scene {

/// The state of the last attempt that went well, and that of the last accepted step; both null where the scene has no such
/// unknowns.
struct States {
  Vec trial = nullptr, accepted = nullptr;
};

/// What one step has done to fluid and energy, from the accepted to the trial state.
struct Books {
  std::vector<double> values;   ///< In the order of Model::book_names.
  double mass_error = 0;        ///< |stored + outflow - injected| over the most that a step so far has stored or let in or out.
  double energy_violation = 0;  ///< Energy made from nothing, over all energies and works of the step; 0 where some is lost.
};

class Model {
 public:
  /// Throws InputError where scene and mesh make no problem that can be solved.
  Model(const mesh::DistributedMesh& mesh, const Scene& scene);

  [[nodiscard]] const mesh::DistributedMesh& mesh() const { return mesh_; }
  [[nodiscard]] solver::StepProblem& steps() { return *steps_; }
  [[nodiscard]] const solver::StepProblem& steps() const { return *steps_; }

  // --- rock; null where the scene has no mechanics ---
  [[nodiscard]] assembly::MechanicsSystem* mechanics() const { return mechanics_.get(); }
  [[nodiscard]] solver::ContactNewton* newton() const { return newton_.get(); }
  [[nodiscard]] States displacement() const { return displacement_; }  ///< In the order of assembly::Layout.
  /// Takes a coupled scene that asks for it to the equilibrium from which it starts; elsewhere there is nothing to do.
  [[nodiscard]] solver::StepOutcome find_equilibrium(const std::function<void(const solver::NewtonRecord&)>& monitor);
  [[nodiscard]] bool has_contact() const { return mechanics_ && mechanics_->fracture_faces() > 0; }

  // --- fluid; null where the scene has no flow ---
  [[nodiscard]] assembly::FlowSystem* flow() const { return flow_.get(); }
  [[nodiscard]] solver::CoupledStep* coupled_step() const { return coupled_step_; }  ///< Null but for rock and fluid together.
  [[nodiscard]] States pressure() const { return pressure_; }  ///< q = p - p_ref in the order of assembly::FlowLayout.
  /// d_f of the owned fracture faces at the trial state [m]; empty where fractures carry no fluid.
  [[nodiscard]] std::vector<double> apertures() const;

  /// Names of what Books::values holds; empty without flow.
  [[nodiscard]] static std::vector<std::string> book_names(const Scene& scene);
  /// Between a solved step and its acceptance; nothing without flow.
  [[nodiscard]] std::optional<Books> books(double size);

  // --- what has been assembled ---
  [[nodiscard]] std::vector<const la::KernelLog*> kernels() const;
  /// Of all fields, eliminated ones too, on this rank.
  [[nodiscard]] double owned_unknowns() const;

  // --- what the solvers have done in this process ---
  [[nodiscard]] std::vector<std::string> linear_choices() const;  ///< Sentences for the log.
  [[nodiscard]] solver::LinearCounts linear_counts() const;
  [[nodiscard]] long long cycles() const { return newton_ ? newton_->cycles() : 0; }
  [[nodiscard]] double seconds_condensing() const { return newton_ ? newton_->seconds().condense : 0; }
  [[nodiscard]] double seconds_solving() const;

  // --- restart ---
  /// Numbers beside the states that a continuation needs.
  struct Memory {
    double load_fraction = 0;  ///< See MechanicsStep.
    double flow_step = 1;      ///< Time step of the last flow matrix [s].
    double turnover = 0;       ///< Most fluid that a step has moved so far [m3; 2D: m2].
  };
  [[nodiscard]] Memory memory() const;
  /// The accepted states, and the jumps that friction is measured from, are what the caller has written into them.
  void resume(double time, const Memory& memory);

 private:
  void set_up(const Scene& scene);
  void set_up_mechanics();
  void set_up_flow(double start);
  void set_up_coupled(const Scene& scene);
  [[nodiscard]] Books coupled_books();
  /// Fluid that a step does not account for, relative to the most that a step has moved so far.
  [[nodiscard]] double mass_error(const assembly::FluidBalance& fluid);

  const mesh::DistributedMesh& mesh_;
  std::unique_ptr<assembly::MechanicsSystem> mechanics_;
  std::unique_ptr<solver::ContactNewton> newton_;
  std::unique_ptr<assembly::FlowSystem> flow_;
  std::unique_ptr<solver::FlowSolver> flow_solver_;
  std::unique_ptr<solver::StepProblem> steps_;
  States displacement_, pressure_;
  // The kind of steps_, null but for one of them.
  solver::MechanicsStep* mechanics_step_ = nullptr;
  solver::DarcyStep* darcy_step_ = nullptr;
  solver::CoupledStep* coupled_step_ = nullptr;
  double largest_turnover_ = 0;           ///< See Memory.
  std::optional<double> equilibrium_at_;  ///< Time of the equilibrium from which a coupled scene starts [s].
};

}  // namespace polyslip::scene
