#include "polyslip/la/memory.hpp"

#include <gtest/gtest.h>

#include <new>

#include "polyslip/common/error.hpp"
#include "polyslip/la/handle.hpp"

namespace polyslip::la {
namespace {

template <class Error>
PetscErrorCode callback_that_throws(const Error& error) {
  PetscFunctionBeginUser;
  PetscCallCXX(throw error);
  PetscFunctionReturn(0);
}

TEST(memory, that_runs_out_in_a_callback_is_a_resource_error_and_nothing_else_is) {
  return_lack_of_memory();
  EXPECT_THROW(POLYSLIP_PETSC(callback_that_throws(std::bad_alloc())), ResourceError);
  EXPECT_THROW(POLYSLIP_PETSC(callback_that_throws(ResourceError("out of memory: all of it"))), ResourceError);
  try {
    POLYSLIP_PETSC(callback_that_throws(std::runtime_error("another matter")));
    FAIL() << "no exception";
  } catch (const ResourceError&) {
    FAIL() << "no lack of memory";
  } catch (const std::runtime_error&) {
  }
  POLYSLIP_PETSC(PetscPopErrorHandler());
}

TEST(memory, is_not_what_a_singular_matrix_lacks) {
  Handle<Mat> matrix;
  Handle<Vec> x, b;
  Handle<KSP> ksp;
  POLYSLIP_PETSC(MatCreateAIJ(PETSC_COMM_SELF, 2, 2, 2, 2, 2, nullptr, 0, nullptr, matrix.put()));
  for (PetscInt i = 0; i < 2; ++i)
    for (PetscInt j = 0; j < 2; ++j) POLYSLIP_PETSC(MatSetValue(matrix, i, j, 1.0, INSERT_VALUES));
  POLYSLIP_PETSC(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatCreateVecs(matrix, x.put(), b.put()));
  PC pc = nullptr;
  KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
  POLYSLIP_PETSC(KSPCreate(PETSC_COMM_SELF, ksp.put()));
  POLYSLIP_PETSC(KSPSetOperators(ksp, matrix, matrix));
  POLYSLIP_PETSC(KSPGetPC(ksp, &pc));
  POLYSLIP_PETSC(PCSetType(pc, PCLU));
  POLYSLIP_PETSC(KSPSolve(ksp, b, x));
  POLYSLIP_PETSC(KSPGetConvergedReason(ksp, &reason));
  EXPECT_EQ(reason, KSP_DIVERGED_PC_FAILED);
  EXPECT_EQ(lack_of_memory(ksp, "nothing"), "");
}

}  // namespace
}  // namespace polyslip::la
