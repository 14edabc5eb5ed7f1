// main of test programs that need MPI and PETSc: every rank runs every test; a failure on any rank fails the program.
#include <gtest/gtest.h>
#include <petscsys.h>

#include "polyslip/common/mpi.hpp"

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  polyslip::mpi::choose_file_layer();
  if (PetscInitialize(&argc, &argv, nullptr, nullptr) != 0) return 1;
  int rank = 0;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  if (rank != 0) {
    auto& listeners = ::testing::UnitTest::GetInstance()->listeners();
    delete listeners.Release(listeners.default_result_printer());
  }
  int failed = RUN_ALL_TESTS();
  MPI_Allreduce(MPI_IN_PLACE, &failed, 1, MPI_INT, MPI_MAX, PETSC_COMM_WORLD);
  if (rank == 0 && failed != 0) printf("failed on at least one rank\n");
  PetscFinalize();
  return failed;
}
