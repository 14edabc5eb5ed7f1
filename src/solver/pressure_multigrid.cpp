#include "polyslip/solver/pressure_multigrid.hpp"

#include "polyslip/la/options.hpp"

namespace polyslip::solver {

void default_pressure_multigrid(const std::string& prefix, int dim) {
  const std::string p = prefix + "pc_hypre_boomeramg_";
  // On tets other coarsenings take few iterations less and twice the time for each, as their coarse levels fill.
  la::default_option(p, "strong_threshold", dim == 2 ? "0.25" : "0.7");
  la::default_option(p, "coarsen_type", "PMIS");
  la::default_option(p, "interp_type", "ext+i");
  la::default_option(p, "P_max", "4");
}

}  // namespace polyslip::solver
