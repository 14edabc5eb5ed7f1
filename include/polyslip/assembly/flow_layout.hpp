// How the pressure unknowns lie in a distributed Vec and in local arrays with ghosts (scheme.md section 4).
//
// Local order on a rank, which is also that of its part of a Vec for the owned half:
//   [ owned: cells p_K | traces p_sigma | fracture faces p_sigma^f | ridges p_e ][ ghosts: cells | traces | fracture faces | ridges
//   ]
// Global numbers are contiguous by rank. Fracture faces and ridges carry unknowns only where fractures carry fluid.
#pragma once

#include <span>

#include "polyslip/assembly/layout.hpp"

namespace polyslip::assembly {

class FlowLayout {
 public:
  /// The mesh must have been distributed with its flow entities.
  FlowLayout(const mesh::DistributedMesh& mesh, bool with_fractures);

  [[nodiscard]] bool with_fractures() const { return with_fractures_; }
  [[nodiscard]] const mesh::Numbering& numbering() const { return numbering_; }
  [[nodiscard]] Index size() const { return numbering_.owned; }  ///< Owned unknowns.
  [[nodiscard]] Index local_size() const { return numbering_.local(); }

  /// Local unknown of a local cell, trace, fracture face or ridge.
  [[nodiscard]] Index cell(Index i) const { return number(0, i); }
  [[nodiscard]] Index trace(Index i) const { return number(1, i); }
  [[nodiscard]] Index fracture(Index i) const { return number(2, i); }
  [[nodiscard]] Index ridge(Index i) const { return number(3, i); }

  [[nodiscard]] la::Handle<Vec> create_vector() const;
  /// Vec to a local array of local_size() entries, ghosts included.
  void gather(Vec q, std::span<double> local) const;
  [[nodiscard]] const mesh::Halo& halo() const { return halo_; }

 private:
  /// Where the unknowns of one kind of entity lie.
  struct Range {
    Index owned = 0;        ///< Entities of this rank.
    Index start = 0;        ///< Unknown of the first owned one.
    Index ghost_start = 0;  ///< Unknown of the first ghost.
  };
  [[nodiscard]] Index number(int kind, Index i) const {
    const Range& range = ranges_[kind];
    return i < range.owned ? range.start + i : range.ghost_start + i - range.owned;
  }
  void number_ghosts(const std::array<const mesh::Numbering*, 4>& kinds);

  MPI_Comm comm_;
  bool with_fractures_;
  std::array<Range, 4> ranges_;
  mesh::Numbering numbering_;
  mesh::Halo halo_;
};

}  // namespace polyslip::assembly
