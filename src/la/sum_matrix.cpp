#include "polyslip/la/sum_matrix.hpp"

namespace polyslip::la {

SumMatrix::SumMatrix(MPI_Comm comm, PetscInt owned_rows, PetscInt owned_columns, const std::function<void(const Add&)>& visit) {
  const auto create = [&](Handle<Mat>& matrix, MatType type) {
    POLYSLIP_PETSC(MatCreate(comm, matrix.put()));
    POLYSLIP_PETSC(MatSetSizes(matrix, owned_rows, owned_columns, PETSC_DETERMINE, PETSC_DETERMINE));
    POLYSLIP_PETSC(MatSetType(matrix, type));
  };
  Handle<Mat> pattern;
  create(pattern, MATPREALLOCATOR);
  POLYSLIP_PETSC(MatSetUp(pattern));
  visit([&](std::span<const PetscInt> rows, std::span<const PetscInt> columns, const double* block) {
    POLYSLIP_PETSC(MatSetValues(pattern, static_cast<PetscInt>(rows.size()), rows.data(), static_cast<PetscInt>(columns.size()),
                                columns.data(), block, INSERT_VALUES));
  });
  POLYSLIP_PETSC(MatAssemblyBegin(pattern, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(pattern, MAT_FINAL_ASSEMBLY));
  create(matrix_, MATAIJ);
  POLYSLIP_PETSC(MatPreallocatorPreallocate(pattern, PETSC_TRUE, matrix_));
  POLYSLIP_PETSC(MatSetOption(matrix_, MAT_NEW_NONZERO_LOCATION_ERR, PETSC_TRUE));
  assemble();
  clear();
}

void SumMatrix::add(std::span<const PetscInt> rows, std::span<const PetscInt> columns, const double* block) {
  POLYSLIP_PETSC(MatSetValues(matrix_, static_cast<PetscInt>(rows.size()), rows.data(), static_cast<PetscInt>(columns.size()),
                              columns.data(), block, ADD_VALUES));
}

void SumMatrix::assemble() {
  POLYSLIP_PETSC(MatAssemblyBegin(matrix_, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(matrix_, MAT_FINAL_ASSEMBLY));
}

void SumMatrix::keep() {
  if (constant_.get() == nullptr)
    POLYSLIP_PETSC(MatDuplicate(matrix_, MAT_COPY_VALUES, constant_.put()));
  else
    POLYSLIP_PETSC(MatCopy(matrix_, constant_, SAME_NONZERO_PATTERN));
}

}  // namespace polyslip::la
