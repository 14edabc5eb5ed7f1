// Owning handles of PETSc objects: move-only, destroyed once, null after a move. A raw Mat or Vec parameter always means
// borrowed; ownership passes only as a Handle by value.
#pragma once

#include <petscdm.h>
#include <petscsf.h>
#include <petscsnes.h>
#include <petscviewer.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace polyslip::la {

/// Throws ResourceError for PETSC_ERR_MEM, std::runtime_error for other codes.
[[noreturn]] void fail(PetscErrorCode code, const char* where);

/// Turns a PETSc error code into an exception; for code outside PETSc callbacks.
inline void check(PetscErrorCode code, const char* where) {
  if (code != 0) fail(code, where);
}

/// False once PETSc has reported lack of memory: it may leave a solver with work vectors that are half made (FGMRES, 3.18), and to destroy
/// that is to jump to nowhere. The run ends then, and the system frees it.
[[nodiscard]] bool solvers_are_whole();

/// The communicator of a PETSc object.
template <class T>
MPI_Comm comm_of(T object) {
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(object), &comm), "PetscObjectGetComm");
  return comm;
}

template <class T>
struct Destroyer;

// clang-format off
template <> struct Destroyer<Mat> { static void apply(Mat* o) { (void)MatDestroy(o); } };
template <> struct Destroyer<Vec> { static void apply(Vec* o) { (void)VecDestroy(o); } };
template <> struct Destroyer<IS> { static void apply(IS* o) { (void)ISDestroy(o); } };
template <> struct Destroyer<KSP> { static void apply(KSP* o) { if (solvers_are_whole()) (void)KSPDestroy(o); } };
template <> struct Destroyer<PC> { static void apply(PC* o) { (void)PCDestroy(o); } };
template <> struct Destroyer<SNES> { static void apply(SNES* o) { if (solvers_are_whole()) (void)SNESDestroy(o); } };
template <> struct Destroyer<DM> { static void apply(DM* o) { (void)DMDestroy(o); } };
template <> struct Destroyer<PetscSF> { static void apply(PetscSF* o) { (void)PetscSFDestroy(o); } };
template <> struct Destroyer<MatNullSpace> { static void apply(MatNullSpace* o) { (void)MatNullSpaceDestroy(o); } };
template <> struct Destroyer<PetscViewer> { static void apply(PetscViewer* o) { (void)PetscViewerDestroy(o); } };
// clang-format on

/// Sole owner of one PETSc object.
template <class T>
class Handle {
 public:
  Handle() = default;
  explicit Handle(T object) : object_(object) {}
  Handle(Handle&& other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
  Handle& operator=(Handle&& other) noexcept {
    if (this != &other) {
      reset();
      object_ = std::exchange(other.object_, nullptr);
    }
    return *this;
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  ~Handle() { reset(); }

  /// The borrowed object; null when empty.
  [[nodiscard]] T get() const { return object_; }
  operator T() const { return object_; }  // NOLINT: borrowed on purpose
  /// Address for PETSc's create functions; destroys what was held.
  [[nodiscard]] T* put() {
    reset();
    return &object_;
  }
  /// Gives the object away, to PETSc.
  [[nodiscard]] T release() { return std::exchange(object_, nullptr); }
  void reset() {
    if (object_ != nullptr) Destroyer<T>::apply(&object_);
    object_ = nullptr;
  }

 private:
  T object_ = nullptr;
};

}  // namespace polyslip::la

/// Checks a PETSc call outside callbacks: throws as fail() does.
#define POLYSLIP_PETSC(call) ::polyslip::la::check((call), #call)
