#include "polyslip/solver/pressure_multigrid.hpp"

#include "polyslip/la/field_split.hpp"
#include "polyslip/la/options.hpp"

namespace polyslip::solver {

/// On tets other coarsenings take few iterations less and twice the time for each, as their coarse levels fill. Passes over coarse and fine
/// rows apart cost more and save nothing. In 2D one pass on the way down and one back on the way up serve nearly as well as two each; in 3D
/// they cost a fifth more iterations.
void default_pressure_multigrid(const std::string& prefix, int dim) {
  const std::string p = prefix + "pc_hypre_boomeramg_";
  la::default_option(p, "strong_threshold", dim == 2 ? "0.25" : "0.7");
  la::default_option(p, "coarsen_type", "PMIS");
  la::default_option(p, "interp_type", "ext+i");
  la::default_option(p, "P_max", "4");
  la::default_option(p, "no_CF", "true");
  if (dim == 3) return;
  la::default_option(p, "relax_type_down", "l1-Gauss-Seidel");
  la::default_option(p, "relax_type_up", "backward-l1-Gauss-Seidel");
}

void default_condensed_multigrid(const std::string& prefix, int dim) {
  const std::string cells = prefix + "fieldsplit_cells_", faces = prefix + "fieldsplit_faces_";
  la::default_option(prefix, "pc_type", PCFIELDSPLIT);
  la::default_option(prefix, "pc_fieldsplit_type", "schur");
  la::default_option(prefix, "pc_fieldsplit_schur_fact_type", "full");
  la::default_option(prefix, "pc_fieldsplit_schur_precondition", "selfp");  // exact, as the block of the cells is diagonal
  la::default_option(cells, "ksp_type", "preonly");
  la::default_option(cells, "pc_type", "jacobi");
  la::default_option(faces, "ksp_type", "preonly");
  la::default_option(faces, "pc_type", "hypre");
  default_pressure_multigrid(faces, dim);
  default_pressure_multigrid(prefix, dim);  // for users who choose hypre for all pressures
}

void split_pressure(const assembly::FlowSystem& system, PC pc) {
  if (!la::is_field_split(pc)) return;
  const assembly::FlowLayout& layout = system.layout();
  const Index cells = system.mesh().cells.owned;
  const auto first = static_cast<PetscInt>(layout.numbering().first);
  la::Handle<IS> of_cells, of_faces;
  POLYSLIP_PETSC(ISCreateStride(system.mesh().comm, cells, first, 1, of_cells.put()));
  POLYSLIP_PETSC(ISCreateStride(system.mesh().comm, layout.size() - cells, first + cells, 1, of_faces.put()));
  la::define_field(pc, "cells", of_cells);
  la::define_field(pc, "faces", of_faces);
}

}  // namespace polyslip::solver
