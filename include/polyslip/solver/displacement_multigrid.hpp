// Multigrid for displacements: smoothed aggregation with the rigid-body modes (GAMG). Where bubbles are on all faces it serves what is
// nodal, and before and after it a smoother serves the bubbles along normals (PCFIELDSPLIT, symmetric multiplicative, fields `normal` and
// `nodal`).
#pragma once

#include <optional>
#include <string>

#include "polyslip/assembly/mechanics_system.hpp"
#include "polyslip/la/hierarchy_update.hpp"

namespace polyslip::solver {

/// Type of the preconditioner: PCGAMG, or PCFIELDSPLIT.
PCType displacement_multigrid(const assembly::MechanicsSystem& system);

/// Whether few of its cycles do: with bubbles on fracture faces alone, and not near incompressibility (nu up to 0.49).
bool suits_multigrid(const assembly::MechanicsSystem& system);

/// Sets defaults of its options; `prefix` is that of the preconditioner. Two smoothing steps save conjugate gradients a sixth of their
/// iterations; GMRES for displacement and pressure takes as many with one, as other errors hold it up.
void default_displacement_multigrid(const assembly::MechanicsSystem& system, const std::string& prefix, int smoothing_steps);

/// Lets the matrix hold all of its rows unless such a preconditioner is to be set up whose options leave all that reads the finest matrix to this
/// program: then most rows need not be written. Only after its defaults are set. Collective.
void hold_rows_for_multigrid(assembly::MechanicsSystem& system, const std::string& prefix);

/// Hands the fields to a preconditioner that splits displacements with bubbles on all faces; others are left as they are.
void split_displacement(const assembly::MechanicsSystem& system, PC pc);

/// Sets up the multigrid of a solver for the displacements. Its aggregates are formed once, with all faces of the fractures open, and serve all
/// states of contact: those that glue what contact holds serve no face that slips or opens (a half more iterations and above). What is set
/// up for a matrix depends on that matrix alone, whatever came before.
class DisplacementHierarchy {
 public:
  explicit DisplacementHierarchy(assembly::MechanicsSystem& system) : system_(system) {}

  /// Whether a preconditioner has a hierarchy to form: GAMG or ML, or fields.
  [[nodiscard]] static bool has_one(PC pc);
  /// Sets `ksp` up for the matrix of the system.
  void set_up(KSP ksp);
  /// The same for one that is set up, after rows beside fractures have changed: by these rows alone where its preconditioner is a hierarchy.
  /// Returns whether all was set up.
  bool follow(KSP ksp);

 private:
  assembly::MechanicsSystem& system_;
  std::optional<la::HierarchyUpdate> changes_;  ///< Where fractures change the matrix of a hierarchy.
};

}  // namespace polyslip::solver
