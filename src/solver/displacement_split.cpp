#include "polyslip/solver/displacement_split.hpp"

#include "polyslip/la/options.hpp"

namespace polyslip::solver {

std::string default_displacement_split(const assembly::MechanicsSystem& system, const std::string& prefix) {
  if (system.layout().bubbles() == spaces::Bubbles::fracture) return prefix;
  la::default_option(prefix, "pc_fieldsplit_type", "symmetric_multiplicative");
  // Jacobi alone need not converge on the bubbles: those of one cell share its divergence.
  const std::string normal = prefix + "fieldsplit_normal_", nodal = prefix + "fieldsplit_nodal_";
  la::default_option(normal, "ksp_type", "chebyshev");
  la::default_option(normal, "ksp_max_it", "2");
  la::default_option(normal, "ksp_norm_type", "none");
  la::default_option(normal, "pc_type", "jacobi");
  la::default_option(nodal, "ksp_type", "preonly");
  la::default_option(nodal, "pc_type", "gamg");
  return nodal;
}

void split_displacement(const assembly::MechanicsSystem& system, PC pc) {
  PetscBool splits = PETSC_FALSE;
  POLYSLIP_PETSC(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(pc), PCFIELDSPLIT, &splits));
  if (!splits || system.layout().bubbles() == spaces::Bubbles::fracture) return;
  POLYSLIP_PETSC(PCFieldSplitSetIS(pc, "normal", system.normal_field()));
  POLYSLIP_PETSC(PCFieldSplitSetIS(pc, "nodal", system.nodal_field()));
}

}  // namespace polyslip::solver
