// Keeps a multigrid hierarchy in step with a fine matrix of which only a few rows change (scheme.md section 6: only cells that touch
// Gamma change between Newton iterations).
//
// With A^0 the matrices at the set-up, dA the change of those rows since, P_l the prolongations:
//   dA_{l-1} = P_l^T dA_l P_l,   A_{l-1} = A^0_{l-1} + dA_{l-1}   from the finest level down,
// the same coarse operators as a full set-up with the old aggregates, at the cost of the rows that changed. They depend on the matrix of the
// set-up and on the one at hand, to the bit, and on none between. Smoothers and the coarsest factorisation are set up for them, and the
// smoothers' eigenvalues estimated again: where faces stick, incomplete Cholesky leaves twice as large ones as where they are open.
#pragma once

#include <vector>

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// What is to be done before each full set-up of a hierarchy, or of those of the fields of a PCFIELDSPLIT: its smoothers forget which rows
/// have changed since the last one.
void begin_full_set_up(PC pc);
/// What is left to do after each full set-up of a hierarchy; in a PCFIELDSPLIT of those of its fields, others are left as they are.
/// Gives the empty rows of coarse operators a diagonal: an aggregate with too few nodes for its modes leaves columns of the prolongation
/// empty, and PETSc's incomplete Cholesky would shift the diagonal of all rows until that one is positive. Nothing is ever restricted to
/// these rows. Smoothers are set up for the operators as they are then, and those of block_icc make the residuals of their levels.
void complete_hierarchy(PC pc);

class HierarchyUpdate {
 public:
  /// Rows of `fine` (of this rank, local numbers, ascending) that may change; columns and pattern stay. Remembers them as they are: a full
  /// set-up has just used them.
  HierarchyUpdate(Mat fine, const std::vector<PetscInt>& rows);

  /// Whether a preconditioner is a hierarchy that this can bring up to date: GAMG or ML, set up, with more than one level.
  [[nodiscard]] static bool can_update(PC pc);

  /// Brings all coarse operators of `pc` up to date with the rows as they are now, and all smoothers.
  void apply(PC pc);

 private:
  /// Some rows of a MATAIJ (of this rank, local numbers) as they were at some time.
  class Rows {
   public:
    Rows(Mat matrix, std::vector<PetscInt> rows);
    [[nodiscard]] const std::vector<PetscInt>& rows() const { return rows_; }
    /// difference = matrix - these, for a difference with the pattern of these rows.
    void subtract_from(Mat matrix, Mat difference) const;
    /// matrix = these + change, in these rows; the pattern of the change is part of that of the matrix.
    void set_sum(Mat matrix, Mat change) const;

   private:
    std::vector<PetscInt> rows_;
    std::vector<PetscScalar> own_, others_;  ///< Values row by row, by columns of this rank and of others.
  };

  Mat fine_;
  Handle<Mat> change_;  ///< dA of the finest level.
  Rows fine_rows_;      ///< Of A^0.
  // Of the other levels, finest first; empty until the first update of a hierarchy.
  std::vector<Handle<Mat>> coarse_changes_;  ///< dA
  std::vector<Rows> coarse_rows_;            ///< Rows of A^0 that dA has.
};

}  // namespace polyslip::la
