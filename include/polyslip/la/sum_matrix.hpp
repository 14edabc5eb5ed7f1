// A distributed AIJ matrix made of a constant part and a part that is written often: A = A_0 + what was added since the last restart.
#pragma once

#include <functional>
#include <span>

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

class SumMatrix {
 public:
  /// Adds a dense row-major block at global rows and columns; rows of this rank only.
  using Add = std::function<void(std::span<const PetscInt> rows, std::span<const PetscInt> columns, const double* block)>;

  /// `visit` hands every block that will ever be added (values do not matter); it is called twice at most, collectively.
  SumMatrix(MPI_Comm comm, PetscInt owned_rows, PetscInt owned_columns, const std::function<void(const Add&)>& visit);

  void add(std::span<const PetscInt> rows, std::span<const PetscInt> columns, const double* block);
  /// Values from here on are added to zero.
  void clear() { POLYSLIP_PETSC(MatZeroEntries(matrix_)); }
  /// Ends a series of additions.
  void assemble();
  /// What the matrix holds now is A_0.
  void keep();
  /// Back to A_0.
  void restart() { POLYSLIP_PETSC(MatCopy(constant_, matrix_, SAME_NONZERO_PATTERN)); }

  [[nodiscard]] Mat get() const { return matrix_; }

 private:
  Handle<Mat> matrix_, constant_;
};

}  // namespace polyslip::la
