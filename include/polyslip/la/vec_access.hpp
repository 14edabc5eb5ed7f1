// Scope guards of the entries of a Vec.
#pragma once

#include "polyslip/common/types.hpp"
#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// Read and write access to a Vec's owned entries, given back at the end of the scope.
class VecRead {
 public:
  explicit VecRead(Vec v) : v_(v) { POLYSLIP_PETSC(VecGetArrayRead(v_, &a_)); }
  ~VecRead() { (void)VecRestoreArrayRead(v_, &a_); }
  VecRead(const VecRead&) = delete;
  VecRead& operator=(const VecRead&) = delete;
  const double& operator[](Index i) const { return a_[i]; }
  [[nodiscard]] const double* data() const { return a_; }

 private:
  Vec v_;
  const double* a_ = nullptr;
};

class VecWrite {
 public:
  explicit VecWrite(Vec v) : v_(v) { POLYSLIP_PETSC(VecGetArray(v_, &a_)); }
  ~VecWrite() { (void)VecRestoreArray(v_, &a_); }
  VecWrite(const VecWrite&) = delete;
  VecWrite& operator=(const VecWrite&) = delete;
  double& operator[](Index i) const { return a_[i]; }
  [[nodiscard]] double* data() const { return a_; }

 private:
  Vec v_;
  double* a_ = nullptr;
};

}  // namespace polyslip::la
