// Galerkin products C = P^T A P of algebraic multigrid, by blocks of nodes: A has blocks of b x b entries (components of a node), P of b x c
// (c modes of an aggregate), C of c x c.
//
// PETSc forms them entry by entry, which is up to a fifth of a solve of contact in 3D. By blocks, patterns are found among nodes, and products
// of small dense blocks follow:
//
//   W_i = sum_j A_ij P_j          for one node i at a time
//   C_JK += P_iJ^T W_iK           for its aggregates J
//
// Neither P^T nor A P is kept. Rows of P of ghosts are fetched, rows of C of other ranks are sent to these. Of a symmetric A the blocks above the
// diagonal are not read: with L those below it and D those on it, P^T (L + D/2) P and its transposed add up to the product.
#pragma once

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// From now on MatPtAP of this MATAIJ, and MatMatMult with it on the left, are formed by blocks where it and P consist of whole ones, of sizes
/// that are known here (2 x 3, 3 x 3, 3 x 6, 6 x 6); else, or with -galerkin_by_blocks false, as PETSc does it. So it is for the coarser
/// matrices that come out. What is said to be symmetric has entries that are, whenever products are formed (and blocks not paired are zero).
void form_galerkin_products_by_blocks(Mat matrix, bool is_symmetric);

/// Whether that has been said of a matrix, and that it is symmetric.
bool forms_galerkin_products_by_blocks(Mat matrix);
bool forms_symmetric_products(Mat matrix);

}  // namespace polyslip::la
