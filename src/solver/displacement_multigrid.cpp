#include "polyslip/solver/displacement_multigrid.hpp"

#include <algorithm>

#include "polyslip/common/mpi.hpp"
#include "polyslip/la/aggregation_graph.hpp"
#include "polyslip/la/field_split.hpp"
#include "polyslip/la/galerkin_product.hpp"
#include "polyslip/la/incomplete_cholesky.hpp"
#include "polyslip/la/options.hpp"
#include "polyslip/la/reuse.hpp"

namespace polyslip::solver {

namespace {

bool is_split(const assembly::MechanicsSystem& system) { return system.layout().bubbles() == spaces::Bubbles::all; }

/// Defaults of the split; returns the prefix of what is nodal.
std::string default_split(const std::string& prefix) {
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

/// Steps of Chebyshev's iteration.
void default_smoother(const std::string& prefix, int steps) {
  const auto is_chosen = [&](const char* name, const char* value) { return la::user_chooses(prefix.c_str(), name, value); };
  const std::string number = std::to_string(steps);
  // Jacobi's smoother takes two to three times the iterations, the more so beside fractures, where rows differ in size.
  la::default_option(prefix, "pc_type", la::block_icc);
  const bool iterates = is_chosen("-pc_type", la::block_icc);
  la::default_option(prefix, "ksp_type", iterates ? "richardson" : "chebyshev");
  if (iterates && is_chosen("-ksp_type", "richardson")) {
    la::default_option(prefix, "ksp_max_it", "1");
    la::default_option(prefix, "pc_block_icc_steps", number.c_str());
  } else {
    la::default_option(prefix, "ksp_max_it", number.c_str());
  }
}

}  // namespace

PCType displacement_multigrid(const assembly::MechanicsSystem& system) { return is_split(system) ? PCFIELDSPLIT : PCGAMG; }

bool suits_multigrid(const assembly::MechanicsSystem& system) {
  constexpr double largest_ratio = 49;  // nu = 0.49
  const auto is_stiff = [](const physics::Lame& lame) { return lame.lambda > largest_ratio * lame.mu; };
  const bool stiff = std::any_of(system.moduli().begin(), system.moduli().end(), is_stiff);
  return !is_split(system) && !mpi::any(system.mesh().comm, stiff);
}

void default_displacement_multigrid(const assembly::MechanicsSystem& system, const std::string& prefix, int smoothing_steps) {
  const std::string p = is_split(system) ? default_split(prefix) : prefix;
  // Where Galerkin products are PETSc's, two sparse products take half to two thirds of the time; on several ranks it knows no such choice.
  if (mpi::size(system.mesh().comm) == 1) la::default_option("", "matptap_via", "rap");
  // Some threshold is needed where layers differ in stiffness; a larger one keeps couplings that cost more on coarse levels than they save.
  la::default_option(p, "pc_gamg_threshold", "0.005");
  la::default_option(p, "pc_gamg_reuse_interpolation", "true");
  // Aggregates of twice the reach on the two finest levels take some per cent more iterations, and a tenth less time; in 2D a third more.
  if (system.layout().dim() == 3) la::default_option(p, "pc_gamg_aggressive_coarsening", "2");
  la::default_option(p, "pc_gamg_use_sa_esteig", "false");
  la::default_option(p, "pc_use_amat", "false");  // smoothers take the symmetric matrix, whatever the Krylov method applies
  default_smoother(p + "mg_levels_", smoothing_steps);
}

void hold_rows_for_multigrid(assembly::MechanicsSystem& system, const std::string& prefix) {
  const auto user_sets = [&](const std::string& name) { return la::user_sets(prefix.c_str(), ("-" + name).c_str()); };
  bool is_ours = true;
  constexpr int most_levels = 10;
  for (int level = 1; level < most_levels; ++level)  // where there is no option for one level PETSc takes that for all
    is_ours = is_ours && la::user_chooses(prefix.c_str(), ("-mg_levels_" + std::to_string(level) + "_pc_type").c_str(), la::block_icc);
  for (const char* name : {"pc_gamg_type", "pc_gamg_asm_use_agg", "pc_mg_levels", "pc_mg_adapt_interp"}) is_ours = is_ours && !user_sets(name);
  for (const char* name : {"-galerkin_by_blocks", "-elimination_pc_type"}) is_ours = is_ours && !la::user_sets(nullptr, name);
  constexpr GlobalIndex fewest = 1000;  // of fewer nodes the coarsest level might be the finest
  const bool factorises_windows = system.layout().dim() == 2;  // see NonlinearElimination
  if (!is_ours || factorises_windows || is_split(system) || system.mesh().copies.total < fewest) system.hold_all_rows();
}

void split_displacement(const assembly::MechanicsSystem& system, PC pc) {
  if (!la::is_field_split(pc) || !is_split(system)) return;
  la::define_field(pc, "normal", system.normal_field());
  la::define_field(pc, "nodal", system.nodal_field());
}

bool DisplacementHierarchy::has_one(PC pc) {
  PetscBool has = PETSC_FALSE;
  POLYSLIP_PETSC(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(pc), &has, PCGAMG, PCML, PCFIELDSPLIT, ""));
  return has == PETSC_TRUE;
}

void DisplacementHierarchy::set_up(KSP ksp) {
  PC pc = nullptr;
  POLYSLIP_PETSC(KSPGetPC(ksp, &pc));
  la::form_graphs_by_blocks(system_.matrix());
  constexpr bool is_symmetric = true;  // what multigrid is set up for always is: see MatrixContent
  la::form_galerkin_products_by_blocks(system_.matrix(), is_symmetric);
  changes_.reset();
  if (system_.fracture_faces() == 0 || !has_one(pc)) {
    follow(ksp);
    return;
  }
  system_.with_open_faces([&] {
    follow(ksp);
    if (!la::HierarchyUpdate::can_update(pc)) return;
    changes_.emplace(system_.matrix(), system_.changing_rows());
  });
  follow(ksp);
}

bool DisplacementHierarchy::follow(KSP ksp) {
  PC pc = nullptr;
  POLYSLIP_PETSC(KSPGetPC(ksp, &pc));
  if (changes_) {
    changes_->apply(pc);
    return false;
  }
  Mat applied = nullptr, matrix = nullptr;
  POLYSLIP_PETSC(KSPGetOperators(ksp, &applied, &matrix));
  POLYSLIP_PETSC(KSPSetOperators(ksp, applied, matrix));  // or a block of a split would be left as it was set up first
  la::reuse_preconditioner(ksp, false);
  la::begin_full_set_up(pc);
  la::set_up_with_fields(ksp);
  la::complete_hierarchy(pc);
  la::reuse_preconditioner(ksp, true);
  return true;
}

}  // namespace polyslip::solver
