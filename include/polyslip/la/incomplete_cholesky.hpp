// Incomplete Cholesky factorisation by blocks of one node, in half and single precision, across the borders of ranks (block_factors.hpp):
// the preconditioner of type `block_icc` in options.
//
//   -pc_block_icc_steps 0              0: M^{-1}; n: n steps of Chebyshev's iteration for A x = b with M^{-1}
//   -pc_block_icc_interval 0.3,1.1     on which that works, relative to the largest eigenvalue of M^{-1} A
//   -pc_block_icc_estimate_its 5       of conjugate gradients, that estimate this; they find a sixth less than there is. Where it is known
//                                      which rows have changed, from noise on these, and three if they are few
//
// Under KSPRICHARDSON the steps start from what x is. They take half the time that KSPCHEBYSHEV takes with PETSc's products, as nothing
// leaves the order of elimination and single precision between them: a smoother is there to take the worst out of an error, and what it loses
// by rounding is less than a hundred-thousandth of that.
#pragma once

#include <vector>

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// -pc_type block_icc
inline constexpr const char* block_icc = "block_icc";

/// Sets a solver up for a matrix that differs from that of its last full set-up in these rows (of this rank, local numbers) and the same
/// columns alone: block_icc then factorises no more than what is near them, and so whenever the matrix changes from then on.
void set_up_for_changed_rows(KSP ksp, Mat matrix, const std::vector<PetscInt>& rows);
/// Makes the next set-up a full one.
void forget_changed_rows(KSP ksp);

/// Lets smoothers that iterate with block_icc make the residuals for the coarser level of a PCMG, too: in single precision.
void take_residuals_from_smoothers(PC hierarchy);

/// Of M^{-1} A, as estimated at the set-up; 0 where the preconditioner does not iterate.
double largest_eigenvalue(PC pc);

/// Makes the type known to PETSc; to be called after PetscInitialize.
PetscErrorCode register_block_icc();

}  // namespace polyslip::la
