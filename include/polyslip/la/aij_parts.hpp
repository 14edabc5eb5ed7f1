// Access to the local matrices that a MATAIJ consists of.
#pragma once

#include <memory>
#include <vector>

#include "polyslip/la/composed.hpp"
#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// A MATSEQAIJ, or one of the two that a MATMPIAIJ has on each rank.
class AijRows {
 public:
  explicit AijRows(Mat matrix) : matrix_(matrix) {
    PetscBool done = PETSC_FALSE;
    POLYSLIP_PETSC(MatGetRowIJ(matrix_, 0, PETSC_FALSE, PETSC_FALSE, &rows_, &offsets_, &columns_, &done));
    POLYSLIP_PETSC(MatSeqAIJGetArrayRead(matrix_, &values_));
  }
  ~AijRows() {
    PetscBool done = PETSC_FALSE;
    (void)MatSeqAIJRestoreArrayRead(matrix_, &values_);
    (void)MatRestoreRowIJ(matrix_, 0, PETSC_FALSE, PETSC_FALSE, &rows_, &offsets_, &columns_, &done);
  }
  AijRows(const AijRows&) = delete;
  AijRows& operator=(const AijRows&) = delete;

  [[nodiscard]] PetscInt rows() const { return rows_; }
  /// Entries of row i are those from offsets()[i] to offsets()[i + 1].
  [[nodiscard]] const PetscInt* offsets() const { return offsets_; }
  [[nodiscard]] const PetscInt* columns() const { return columns_; }
  [[nodiscard]] const PetscScalar* values() const { return values_; }

  /// Calls visit(row, column, value) for the entries of some rows.
  template <class Visit>
  void visit(PetscInt first, PetscInt count, Visit&& visit) const {
    for (PetscInt row = first; row < first + count; ++row)
      for (PetscInt at = offsets_[row]; at < offsets_[row + 1]; ++at) visit(row, columns_[at], values_[at]);
  }

 private:
  Mat matrix_;
  PetscInt rows_ = 0;
  const PetscInt *offsets_ = nullptr, *columns_ = nullptr;
  const PetscScalar* values_ = nullptr;
};

/// Write access to the values of such a matrix, in the order in which AijRows gives them.
class AijValues {
 public:
  explicit AijValues(Mat matrix) : matrix_(matrix) { POLYSLIP_PETSC(MatSeqAIJGetArray(matrix_, &values_)); }
  ~AijValues() { (void)MatSeqAIJRestoreArray(matrix_, &values_); }
  AijValues(const AijValues&) = delete;
  AijValues& operator=(const AijValues&) = delete;

  [[nodiscard]] PetscScalar* data() const { return values_; }

 private:
  Mat matrix_;
  PetscScalar* values_ = nullptr;
};

class BlockOperator;
constexpr const char* lent_rows = "polyslip lent rows";

/// The local matrices of a MATAIJ: columns of this rank, and those of others (null on one rank) with their global numbers.
struct AijParts {
  Mat own, others = nullptr;
  const PetscInt* global = nullptr;
  const BlockOperator* lent = nullptr;  ///< Has the rows of `own` that are empty there, if any are lent (lend_rows).

  explicit AijParts(Mat matrix) : own(matrix), lent(composed<const BlockOperator>(matrix, lent_rows)) {
    PetscBool is_parallel = PETSC_FALSE;
    POLYSLIP_PETSC(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(matrix), MATMPIAIJ, &is_parallel));
    if (is_parallel) POLYSLIP_PETSC(MatMPIAIJGetSeqAIJ(matrix, &own, &others, &global));
  }
};

/// Leaves the numbers of a vector unset that is made longer: what is written at once need not be touched before.
template <class Number>
struct LeaveUnset : std::allocator<Number> {
  template <class Other>
  struct rebind {
    using other = LeaveUnset<Other>;
  };
  void construct(Number*) noexcept {}
  void construct(Number* at, Number value) noexcept { *at = value; }
};
template <class Number>
using UnsetVector = std::vector<Number, LeaveUnset<Number>>;

/// A local matrix by compressed rows, of ascending columns.
struct AijEntries {
  std::vector<PetscInt> offsets{0};
  UnsetVector<PetscInt> columns;
  UnsetVector<PetscScalar> values;

  [[nodiscard]] PetscInt rows() const { return static_cast<PetscInt>(offsets.size()) - 1; }
};

/// A MATAIJ of all its entries: those in columns of this rank by local numbers, and the others by numbers over all ranks (not read on one rank;
/// PETSc numbers them anew). Nothing is copied: the entries must outlive the matrix. Collective.
Handle<Mat> matrix_on(MPI_Comm comm, PetscInt columns, AijEntries& own, AijEntries& others);
/// The same, and the matrix keeps them.
Handle<Mat> matrix_of(MPI_Comm comm, PetscInt columns, AijEntries own, AijEntries others);

}  // namespace polyslip::la
