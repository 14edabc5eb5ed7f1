// Products with small dense matrices that are read once: blocks of + cells.
#pragma once

namespace polyslip::la {

/// y = A x for A of rows x columns entries, row by row, the rows `step` apart.
void multiply(int rows, int columns, const double* a, int step, const double* x, double* y);

/// y += factor A^T x
void add_transposed(int rows, int columns, double factor, const double* a, int step, const double* x, double* y);

}  // namespace polyslip::la
