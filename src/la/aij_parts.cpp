#include "polyslip/la/aij_parts.hpp"

#include <array>
#include <utility>

#include "polyslip/common/mpi.hpp"

namespace polyslip::la {

Handle<Mat> matrix_on(MPI_Comm comm, PetscInt columns, AijEntries& own, AijEntries& others) {
  Handle<Mat> matrix;
  const PetscInt rows = own.rows();
  if (mpi::size(comm) == 1)
    POLYSLIP_PETSC(MatCreateSeqAIJWithArrays(comm, rows, columns, own.offsets.data(), own.columns.data(), own.values.data(), matrix.put()));
  else
    POLYSLIP_PETSC(MatCreateMPIAIJWithSplitArrays(comm, rows, columns, PETSC_DETERMINE, PETSC_DETERMINE, own.offsets.data(), own.columns.data(),
                                                  own.values.data(), others.offsets.data(), others.columns.data(), others.values.data(),
                                                  matrix.put()));
  return matrix;
}

Handle<Mat> matrix_of(MPI_Comm comm, PetscInt columns, AijEntries own, AijEntries others) {
  using Kept = std::array<AijEntries, 2>;
  auto kept = std::make_unique<Kept>(Kept{std::move(own), std::move(others)});
  Handle<Mat> matrix = matrix_on(comm, columns, (*kept)[0], (*kept)[1]);
  compose(matrix.get(), "polyslip entries", kept.release(), [](void* entries) -> PetscErrorCode {
    delete static_cast<Kept*>(entries);
    return 0;
  });
  return matrix;
}

}  // namespace polyslip::la
