#include <gtest/gtest.h>

#include <functional>
#include <utility>

#include "polyslip/la/handle.hpp"

namespace polyslip::la {
namespace {

PetscErrorCode count_destruction(void* counter) {
  ++*static_cast<int*>(counter);
  return 0;
}

/// Makes PETSc add 1 to the counter when it destroys the object.
template <class T>
void watch(T object, int& destroyed) {
  PetscContainer witness = nullptr;
  POLYSLIP_PETSC(PetscContainerCreate(PETSC_COMM_SELF, &witness));
  POLYSLIP_PETSC(PetscContainerSetPointer(witness, &destroyed));
  POLYSLIP_PETSC(PetscContainerSetUserDestroy(witness, count_destruction));
  POLYSLIP_PETSC(PetscObjectCompose(reinterpret_cast<PetscObject>(object), "witness", reinterpret_cast<PetscObject>(witness)));
  POLYSLIP_PETSC(PetscContainerDestroy(&witness));
}

Handle<Vec> watched_vector(int& destroyed) {
  Handle<Vec> v;
  POLYSLIP_PETSC(VecCreateSeq(PETSC_COMM_SELF, 3, v.put()));
  watch(v.get(), destroyed);
  return v;
}

/// Destructions of an object of type T whose handle goes out of scope.
template <class T, class Create>
int destructions(Create&& create) {
  int destroyed = 0;
  {
    Handle<T> handle;
    POLYSLIP_PETSC(create(PETSC_COMM_SELF, handle.put()));
    watch(handle.get(), destroyed);
    EXPECT_EQ(destroyed, 0);
  }
  return destroyed;
}

TEST(handle, destroys_an_object_of_each_kind_once) {
  EXPECT_EQ(destructions<Mat>(MatCreate), 1);
  EXPECT_EQ(destructions<Vec>(VecCreate), 1);
  EXPECT_EQ(destructions<IS>(ISCreate), 1);
  EXPECT_EQ(destructions<KSP>(KSPCreate), 1);
  EXPECT_EQ(destructions<PC>(PCCreate), 1);
  EXPECT_EQ(destructions<SNES>(SNESCreate), 1);
  EXPECT_EQ(destructions<DM>(DMCreate), 1);
  EXPECT_EQ(destructions<PetscSF>(PetscSFCreate), 1);
  EXPECT_EQ(destructions<PetscViewer>(PetscViewerCreate), 1);
  EXPECT_EQ(destructions<MatNullSpace>(
                [](MPI_Comm comm, MatNullSpace* o) { return MatNullSpaceCreate(comm, PETSC_TRUE, 0, nullptr, o); }),
            1);
}

TEST(handle, is_null_after_a_move_and_the_object_lives_on) {
  int destroyed = 0;
  {
    Handle<Vec> a = watched_vector(destroyed);
    const Vec object = a.get();
    Handle<Vec> b(std::move(a));
    EXPECT_EQ(a.get(), nullptr);  // NOLINT: that is what is tested
    EXPECT_EQ(b.get(), object);
    Handle<Vec> c;
    c = std::move(b);
    EXPECT_EQ(b.get(), nullptr);  // NOLINT
    EXPECT_EQ(c.get(), object);
    EXPECT_EQ(destroyed, 0);
  }
  EXPECT_EQ(destroyed, 1);
}

TEST(handle, destroys_what_it_held_when_another_object_comes) {
  int first = 0, second = 0;
  Handle<Vec> v = watched_vector(first);
  v = watched_vector(second);
  EXPECT_EQ(first, 1);
  POLYSLIP_PETSC(VecCreateSeq(PETSC_COMM_SELF, 2, v.put()));
  EXPECT_EQ(second, 1);
}

TEST(handle, survives_a_move_onto_itself) {
  int destroyed = 0;
  Handle<Vec> v = watched_vector(destroyed);
  Handle<Vec>& same = v;
  v = std::move(same);
  EXPECT_EQ(destroyed, 0);
  EXPECT_NE(v.get(), nullptr);
  v.reset();
  v.reset();
  EXPECT_EQ(destroyed, 1);
}

TEST(check, names_the_call_that_failed) {
  try {
    POLYSLIP_PETSC(PETSC_ERR_USER);
    FAIL() << "no exception";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("PETSC_ERR_USER"), std::string::npos);
  }
}

}  // namespace
}  // namespace polyslip::la
