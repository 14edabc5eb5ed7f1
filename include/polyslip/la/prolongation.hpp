// Products of vectors with prolongations of multigrid, by blocks and in single precision. A MATAIJ names the column of each entry, and PETSc's
// products look up the factor of each; a block of r x c entries (3 x 6 on the finest level) needs one column, and its factors at once. That and half
// as many bits are a third of what a product moved; a correction from a coarser level is no better than the first few of them.
#pragma once

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// From now on MatMultAdd and MatMultTranspose of a MATAIJ go by blocks, of which it must consist: as its block sizes tell, 2 x 3, 3 x 3, 3 x 6 or
/// 6 x 6 entries (with others it is left as it is). They take the entries that it has at the time, rounded to single precision.
void multiply_by_blocks(Mat prolongation);

}  // namespace polyslip::la
