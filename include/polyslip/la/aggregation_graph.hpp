// The graph by which GAMG aggregates nodes: G_IJ is the sum of |a_ij| over the block of nodes I and J, scaled to G_II = 1, without what is at most
// a threshold. PETSc's is the same, but found, symmetrised and filtered row by row, with a search for the place of each entry: a thirtieth of
// a contact problem's time, and on two ranks more than that.
#pragma once

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// From now on MatCreateGraph of this MATAIJ, which must be symmetric and consist of whole blocks, is that, if they are of 2, 3 or 6 rows.
void form_graphs_by_blocks(Mat matrix);

}  // namespace polyslip::la
