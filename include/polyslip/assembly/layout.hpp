// How the mechanical unknowns lie in a distributed Vec and in local arrays with ghosts.
//
// Vec of one rank: [ nodal v_{Ks}: dim a copy | bubbles v_{Ksigma}: dim a fracture face | multipliers lam_sigma: dim a fracture face ],
// owned entities only. Bubbles are Cartesian, multipliers in the frame (n, t_1, t_2) of their face.
#pragma once

#include <span>
#include <vector>

#include "polyslip/la/handle.hpp"
#include "polyslip/mesh/distributed_mesh.hpp"
#include "polyslip/mesh/halo.hpp"

namespace polyslip::assembly {

/// Values on owned and ghost entities.
struct MechanicalState {
  std::vector<double> nodal;       ///< dim * copies.local() [m]
  std::vector<double> bubble;      ///< dim * fractures.local() [m]
  std::vector<double> multiplier;  ///< dim * fractures.local() [Pa]
  std::vector<double> pressure;    ///< q of the local flow unknowns [Pa]; empty where there is no fluid.
};

class Layout {
 public:
  explicit Layout(const mesh::DistributedMesh& mesh);

  [[nodiscard]] int dim() const { return dim_; }
  [[nodiscard]] Index nodal_size() const { return dim_ * copies_; }
  [[nodiscard]] Index fracture_size() const { return dim_ * fractures_; }
  [[nodiscard]] Index bubble_start() const { return nodal_size(); }
  [[nodiscard]] Index multiplier_start() const { return nodal_size() + fracture_size(); }
  [[nodiscard]] Index size() const { return nodal_size() + 2 * fracture_size(); }

  [[nodiscard]] la::Handle<Vec> create_vector() const;        ///< All unknowns.
  [[nodiscard]] la::Handle<Vec> create_nodal_vector() const;  ///< Nodal ones alone: what remains after condensation.
  [[nodiscard]] MechanicalState create_state() const;         ///< Zeros.

  /// Vec to local arrays, ghosts included.
  void gather(Vec x, MechanicalState& state) const;
  /// Owned part of local arrays to the Vec.
  void scatter(const MechanicalState& state, Vec x) const;
  [[nodiscard]] const mesh::Halo& copy_halo() const { return copy_halo_; }
  [[nodiscard]] const mesh::Halo& fracture_halo() const { return fracture_halo_; }

 private:
  MPI_Comm comm_;
  int dim_;
  Index copies_, local_copies_, fractures_, local_fractures_;
  mesh::Halo copy_halo_, fracture_halo_;
};

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

}  // namespace polyslip::assembly
