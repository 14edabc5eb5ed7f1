#include "polyslip/la/memory.hpp"

#include <fmt/format.h>
#include <petscblaslapack.h>

#include <string_view>
#include <vector>

#include "polyslip/common/memory.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/la/handle.hpp"

namespace polyslip::la {

namespace {

/// OpenBLAS takes 32 to 128 MB of addresses, and Open MPI some 200 MB [bytes]; neither says when it gets less.
constexpr std::size_t needed_at_start = 400'000'000;

/// An error of our own code in a callback comes as PETSC_ERR_LIB with its text, as does one of MUMPS while it solves; PetscMallocAlign of 3.18
/// gives its caller's line as the code.
bool tells_lack_of_memory(PetscErrorCode code, std::string_view function, std::string_view text) {
  return code == PETSC_ERR_MEM || function == "PetscMallocAlign" || text.find("bad_alloc") != text.npos || text.find("out of memory") != text.npos ||
         text.find("MUMPS in solve phase: INFOG(1)=-13") != text.npos;
}

PetscErrorCode handle_error(MPI_Comm comm, int line, const char* function, const char* file, PetscErrorCode code, PetscErrorType kind,
                            const char* text, void* context) {
  const auto view = [](const char* words) { return std::string_view(words == nullptr ? "" : words); };
  if (tells_lack_of_memory(code, view(function), view(text))) return PETSC_ERR_MEM;
  return PetscTraceBackErrorHandler(comm, line, function, file, code, kind, text, context);
}

/// What INFOG(1) and (2) of MUMPS say (users' guide, section 8).
std::string words_of_mumps(PetscInt code, PetscInt amount) {
  const double entries = amount < 0 ? -1e6 * amount : amount;
  switch (code) {
    case -5:
    case -13: return fmt::format("MUMPS asks for {:.0f} MB more", entries * sizeof(PetscReal) / 1e6);
    case -7: return fmt::format("MUMPS asks for {:.0f} MB more", entries * sizeof(int) / 1e6);
    default: return fmt::format("MUMPS does not get enough (INFOG(1) = {}, INFOG(2) = {})", code, amount);
  }
}

/// Nothing unless this factorisation lacked memory.
std::string words_of_factor(Mat factor) {
  MatFactorError error = MAT_FACTOR_NOERROR;
  MatSolverType package = nullptr;
  PetscInt rows = 0, code = 0, amount = 0;
  POLYSLIP_PETSC(MatFactorGetError(factor, &error));
  if (error != MAT_FACTOR_OUTMEMORY) return {};
  POLYSLIP_PETSC(MatGetSize(factor, &rows, nullptr));
  POLYSLIP_PETSC(MatFactorGetSolverType(factor, &package));
  const bool is_mumps = std::string_view(package) == MATSOLVERMUMPS;
  if (is_mumps) POLYSLIP_PETSC(MatMumpsGetInfog(factor, 1, &code));
  if (is_mumps) POLYSLIP_PETSC(MatMumpsGetInfog(factor, 2, &amount));
  if (code == -8 || code == -9) return {};  // less room than pivoting wants, as in a singular matrix: there may be plenty of it
  return fmt::format("{} to factorise {} unknowns", is_mumps ? words_of_mumps(code, amount) : "there is not enough", rows);
}

std::string words_of(PC pc) {
  PetscBool factorises = PETSC_FALSE, splits = PETSC_FALSE;
  const auto object = reinterpret_cast<PetscObject>(pc);
  POLYSLIP_PETSC(PetscObjectTypeCompareAny(object, &factorises, PCLU, PCCHOLESKY, ""));
  POLYSLIP_PETSC(PetscObjectTypeCompare(object, PCFIELDSPLIT, &splits));
  std::string words;
  if (factorises) {
    Mat factor = nullptr;
    POLYSLIP_PETSC(PCFactorGetMatrix(pc, &factor));
    if (factor != nullptr) words = words_of_factor(factor);
  } else if (splits) {
    PetscInt n = 0;
    KSP* blocks = nullptr;
    POLYSLIP_PETSC(PCFieldSplitGetSubKSP(pc, &n, &blocks));
    for (PetscInt i = 0; i < n && words.empty(); ++i) {
      PC block = nullptr;
      POLYSLIP_PETSC(KSPGetPC(blocks[i], &block));
      words = words_of(block);
    }
    POLYSLIP_PETSC(PetscFree(blocks));
  }
  return words;
}

}  // namespace

void reserve_work_space() {
  require_memory(needed_at_start);
  constexpr PetscBLASInt n = 256;  // products of less than about 100 do without it
  const std::vector<PetscScalar> a(n * n), b(n * n);
  std::vector<PetscScalar> c(n * n);
  const PetscScalar one = 1, zero = 0;
  BLASgemm_("N", "N", &n, &n, &n, &one, a.data(), &n, b.data(), &n, &zero, c.data(), &n);
}

void return_lack_of_memory() { POLYSLIP_PETSC(PetscPushErrorHandler(handle_error, nullptr)); }

std::string lack_of_memory(KSP ksp, const std::string& remedy) {
  KSPConvergedReason reason = KSP_CONVERGED_ITERATING;
  PC pc = nullptr;
  POLYSLIP_PETSC(KSPGetConvergedReason(ksp, &reason));
  if (reason != KSP_DIVERGED_PC_FAILED) return {};
  POLYSLIP_PETSC(KSPGetPC(ksp, &pc));
  const std::string words = words_of(pc);
  return words.empty() ? words : fmt::format("out of memory: {}. {} needs less; or use more ranks on more machines, or fewer cells", words, remedy);
}

}  // namespace polyslip::la
