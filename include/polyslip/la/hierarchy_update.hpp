// Keeps a multigrid hierarchy in step with a fine matrix of which only a few rows change (scheme.md section 6: only cells that touch
// Gamma change between Newton iterations).
//
// With dA the change of those rows since the hierarchy was last in step, P_l the prolongations:
//   dA_{l-1} = P_l^T dA_l P_l,   A_{l-1} += dA_{l-1}   from the finest level down,
// the same coarse operators as a full set-up with the old aggregates, at the cost of the rows that changed. Smoothers and the coarsest
// factorisation notice that their matrices changed and follow by themselves.
#pragma once

#include <vector>

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

class HierarchyUpdate {
 public:
  /// Rows of `fine` (of this rank, global numbers, ascending) that may change; columns and pattern stay.
  HierarchyUpdate(Mat fine, std::vector<PetscInt> rows);

  /// Whether a preconditioner is a hierarchy that this can bring up to date: GAMG or ML, set up, with more than one level.
  [[nodiscard]] static bool can_update(PC pc);

  /// Remembers the rows as they are: a full set-up has just used them.
  void is_in_step();
  /// Brings all coarse operators of `pc` up to date with the rows as they are now.
  void apply(PC pc);

 private:
  void write_change();

  Mat fine_;
  std::vector<PetscInt> rows_;
  std::vector<PetscScalar> values_;  ///< Of the rows, one behind the other, when the hierarchy was last in step.
  Handle<Mat> change_;               ///< dA of the finest level: rows_ only.
  std::vector<Handle<Mat>> coarse_changes_;  ///< dA of the others, finest first; empty until the first update of a hierarchy.
};

}  // namespace polyslip::la
