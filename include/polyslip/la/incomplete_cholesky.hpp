// Incomplete Cholesky factorisation by blocks of one node, in single precision, across the borders of ranks: the preconditioner of type
// `block_icc` in options.
//
//   A ~ M = (I + L) D (I + L)^T      D block diagonal, L strictly lower; blocks of b x b for b components a node
//   W_ij = A_ij - sum_{k<j} W_ik L_jk^T,   L_ij = W_ij D_j^{-1}   where A has a block ij, j < i, and nowhere else
//   D_i  = A_ii - omega_i sum_{k<i} W_ik L_ik^T                   omega_i <= 1 the largest for which D_i >= a A_ii,
//                                                                 a = 0.05, at borders of ranks 0.3
//
// the factorisation without fill of Meijerink and van der Vorst (Math. Comp. 31, 1977). It differs from PETSc's on each rank (PCBJACOBI with
// PCICC) in three things. Blocks in single precision take half the memory, and less than half the time to apply and to factorise; what they
// lose is a millionth of what the pattern leaves out anyway. The factorisation does not end where a rank's rows do: the nodes at borders are
// eliminated first, on one rank after the other by colours (ranks side by side have different ones, two ranks two), then all ranks those
// within at once. So it takes nearly the same iterations on any number of ranks; the price is that a rank waits at each application for the
// borders of those of lower colours, and back. And omega keeps M positive definite without a shift of all rows.
//
// Takes MATAIJ and reads the blocks of the lower rows, as if it were symmetric; b is the block size of the matrix if 2, 3 or 6, else 1.
#pragma once

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// -pc_type block_icc
inline constexpr const char* block_icc = "block_icc";

/// Makes the type known to PETSc; to be called after PetscInitialize.
PetscErrorCode register_block_icc();

}  // namespace polyslip::la
