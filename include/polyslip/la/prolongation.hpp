// Products of vectors with prolongations of multigrid, by blocks. A MATAIJ names the column of each entry, and PETSc's products look up the factor
// of each; a block of r x c entries (3 x 6 on the finest level) needs one column, and its factors at once: a product moves two thirds as much.
#pragma once

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// From now on MatMultAdd and MatMultTranspose of a MATAIJ go by blocks, of which it must consist: as its block sizes tell, 2 x 3, 3 x 3, 3 x 6 or
/// 6 x 6 entries (with others it is left as it is).
void multiply_by_blocks(Mat prolongation);

}  // namespace polyslip::la
