// How the mechanical unknowns lie in a distributed Vec and in local arrays with ghosts.
//
// Vec of one rank: [ displacement: v_{Ks}, dim a copy, then v_sigma, one a face off Gamma where bubbles are on all faces
//                  | bubbles v_{Ksigma}: dim a fracture face | multipliers lam_sigma: dim a fracture face ],
// owned entities only. Bubbles of fracture faces are Cartesian, multipliers in the frame (n, t_1, t_2) of their face.
//
// Local displacements: the owned ones as in the Vec, then those of ghost copies, then those of ghost faces.
#pragma once

#include <span>
#include <vector>

#include "polyslip/la/block_matrix.hpp"
#include "polyslip/la/handle.hpp"
#include "polyslip/mesh/distributed_mesh.hpp"
#include "polyslip/mesh/halo.hpp"
#include "polyslip/spaces/vem_cell.hpp"

namespace polyslip::assembly {

/// Values on owned and ghost entities.
struct MechanicalState {
  std::vector<double> displacement;  ///< local_displacements() [m]
  std::vector<double> bubble;        ///< dim * fractures.local() [m]
  std::vector<double> multiplier;    ///< dim * fractures.local() [Pa]
  std::vector<double> pressure;      ///< q of the local flow unknowns [Pa]; empty where there is no fluid.
};

class Layout {
 public:
  /// Bubbles on all faces need the mesh distributed with its faces numbered (mesh::PartitionOptions::flow).
  explicit Layout(const mesh::DistributedMesh& mesh, spaces::Bubbles bubbles = spaces::Bubbles::fracture);

  [[nodiscard]] int dim() const { return dim_; }
  [[nodiscard]] spaces::Bubbles bubbles() const { return bubbles_; }
  [[nodiscard]] Index nodal_size() const { return dim_ * copies_; }
  [[nodiscard]] Index displacement_size() const { return nodal_size() + normals_; }  ///< What remains after condensation.
  [[nodiscard]] Index fracture_size() const { return dim_ * fractures_; }
  [[nodiscard]] Index bubble_start() const { return displacement_size(); }
  [[nodiscard]] Index multiplier_start() const { return bubble_start() + fracture_size(); }
  [[nodiscard]] Index size() const { return multiplier_start() + fracture_size(); }

  // --- displacements, by local and global number ---
  [[nodiscard]] Index local_displacements() const { return dim_ * local_copies_ + local_normals_; }
  /// First component of a local copy.
  [[nodiscard]] Index of_copy(Index copy) const { return dim_ * copy + (copy < copies_ ? 0 : normals_); }
  /// Bubble of a local face along its normal; -1 where it has none.
  [[nodiscard]] Index of_normal(Index face) const {
    const Index k = normal_of_face_.empty() ? -1 : normal_of_face_[static_cast<std::size_t>(face)];
    return k < 0 ? -1 : k < normals_ ? nodal_size() + k : dim_ * local_copies_ + k;
  }
  [[nodiscard]] GlobalIndex global(Index displacement) const {
    return displacement < displacement_size() ? first_ + displacement : ghosts_[static_cast<std::size_t>(displacement - displacement_size())];
  }
  [[nodiscard]] GlobalIndex first() const { return first_; }  ///< Of the owned displacements.
  [[nodiscard]] GlobalIndex total_normals() const { return total_normals_; }
  /// Serial number of each owned face with a bubble along its normal: independent of the rank count.
  [[nodiscard]] const std::vector<GlobalIndex>& normal_input() const { return normal_input_; }
  /// Local displacements of a cell: its nodes, then the bubbles along normals, as in VemCell.
  void append_displacements(const mesh::PolyMesh& mesh, Index cell, std::vector<Index>& displacements) const;

  // --- the entities that displacements belong to: copies and faces, ghosts last; blocks of the condensed matrix ---
  [[nodiscard]] Index owned_entities() const { return copies_ + normals_; }
  [[nodiscard]] Index local_entities() const { return local_copies_ + local_normals_; }
  [[nodiscard]] Index entity_of(Index displacement) const;
  [[nodiscard]] Index first_displacement(Index entity) const;
  void append_components(Index entity, std::vector<Index>& displacements) const;
  /// Calls visit(entity) for those of a cell, in the order of its displacements.
  template <class Visit>
  void visit_entities(const mesh::PolyMesh& mesh, Index cell, Visit&& visit) const {
    for (const Index copy : mesh.copies_of(cell)) visit(copy < copies_ ? copy : copy + normals_);
    if (bubbles_ == spaces::Bubbles::fracture) return;
    for (const Index face : mesh.cell_faces[cell])
      if (const Index normal = of_normal(face); normal >= 0) visit(entity_of(normal));
  }
  [[nodiscard]] int width(Index entity) const { return widths_.empty() ? dim_ : widths_[static_cast<std::size_t>(entity)]; }
  [[nodiscard]] la::BlockMatrix::Layout matrix_layout() const;

  [[nodiscard]] la::Handle<Vec> create_vector() const;               ///< All unknowns.
  [[nodiscard]] la::Handle<Vec> create_displacement_vector() const;  ///< What remains after condensation.
  [[nodiscard]] la::Handle<Vec> create_nodal_vector() const;         ///< dim components a node copy.
  [[nodiscard]] MechanicalState create_state() const;                ///< Zeros.

  /// Vec to local arrays, ghosts included.
  void gather(Vec x, MechanicalState& state) const;
  /// Owned part of local arrays to the Vec.
  void scatter(const MechanicalState& state, Vec x) const;
  /// Fills the ghosts of local displacements, or of numbers of them.
  void exchange(std::span<double> displacements) const;
  void exchange(std::span<Index> displacements) const;
  [[nodiscard]] const mesh::Halo& copy_halo() const { return copy_halo_; }
  [[nodiscard]] const mesh::Halo& fracture_halo() const { return fracture_halo_; }

 private:
  void number_normals(const mesh::DistributedMesh& mesh);
  void number_ghosts(const mesh::DistributedMesh& mesh);
  /// What moves displacements, and how many of them belong together.
  [[nodiscard]] const mesh::Halo& displacement_halo() const { return bubbles_ == spaces::Bubbles::all ? displacement_halo_ : copy_halo_; }
  [[nodiscard]] int block_size() const { return bubbles_ == spaces::Bubbles::all ? 1 : dim_; }

  MPI_Comm comm_;
  int dim_;
  spaces::Bubbles bubbles_;
  Index copies_, local_copies_, fractures_, local_fractures_, normals_ = 0, local_normals_ = 0;
  GlobalIndex first_ = 0, total_normals_ = 0;
  std::vector<Index> normal_of_face_;      ///< Number of the bubble along the normal, owned ones first, -1 for none; empty without such.
  std::vector<GlobalIndex> normal_input_;
  std::vector<GlobalIndex> ghosts_;        ///< Global numbers of ghosts' displacements.
  std::vector<GlobalIndex> ghost_blocks_;  ///< Those of first components, by ghost entity.
  std::vector<char> widths_;               ///< Components of each local entity; empty where all have dim.
  mesh::Halo copy_halo_, fracture_halo_, displacement_halo_;
};

}  // namespace polyslip::assembly
