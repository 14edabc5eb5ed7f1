// Cutting the part of one rank, ghosts and global numbers included, out of a serial mesh.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <vector>

#include "polyslip/mesh/distributed_mesh.hpp"

namespace polyslip::mesh {

/// Which rank owns which entity of the serial mesh, and the global numbers that follow: contiguous by rank, within a rank in serial
/// order or backwards.
struct Ownership {
  std::vector<GlobalIndex> first;   ///< First global number of each rank, and the total behind the last.
  std::vector<GlobalIndex> number;  ///< Global number of each serial entity, -1 where nobody owns it.
  std::vector<Index> order;         ///< Serial entity of each global number.

  /// owner[i] is the rank of entity i, or -1 for none.
  Ownership(const std::vector<Index>& owner, const std::vector<char>& is_backwards);

  /// Serial entities of a rank, in its order.
  [[nodiscard]] std::span<const Index> of(Index rank) const {
    return {order.data() + first[rank], static_cast<std::size_t>(first[rank + 1] - first[rank])};
  }
  [[nodiscard]] GlobalIndex total() const { return first.back(); }
};

/// Serial entities present in the part being cut, with their local numbers: one marker for each serial entity, so that membership
/// costs one look-up and clearing costs only what was added.
class LocalSet {
 public:
  explicit LocalSet(Index serial_size) : local_(serial_size, -1) {}

  /// Local number of a serial entity, added behind the others if it is new.
  Index add(Index serial) {
    if (local_[serial] < 0) {
      local_[serial] = size();
      members_.push_back(serial);
    }
    return local_[serial];
  }
  /// Local number or -1.
  [[nodiscard]] Index operator[](Index serial) const { return local_[serial]; }
  [[nodiscard]] Index size() const { return static_cast<Index>(members_.size()); }
  [[nodiscard]] const std::vector<Index>& members() const { return members_; }
  /// Renumbers the members from local number `begin` on by ascending key.
  void sort_from(Index begin, const std::vector<GlobalIndex>& key);
  void clear();

 private:
  std::vector<Index> local_, members_;
};

/// By rank, whether its cells at other ranks come before most of their neighbours within, in serial order, in 3D. Backwards they come behind
/// them: incomplete factorisations eliminate what lies within before what other ranks see, best and fastest in the order of the matrix (the direct
/// solvers of 2D choose their own).
std::vector<char> borders_come_early(const PolyMesh& mesh, const std::vector<Index>& part, Index ranks);

/// Numbers in the whole mesh of the nodes and faces of a piece of it; none where the piece is the whole.
struct WholeNumbers {
  std::span<const Index> nodes, faces;
};

/// Cuts part after part out of one mesh (which must have its copies built). Linear in the size of the parts.
class PartCutter {
 public:
  /// part[c] is the rank of cell c, and what ranks number backwards is told for each. Borrows the mesh. `flow` holds the flow entities of
  /// the whole mesh, or nothing where none are asked for.
  PartCutter(const PolyMesh& whole, const std::vector<Index>& part, const std::vector<char>& is_backwards, FlowEntities flow = {},
             const WholeNumbers& numbers = {});

  /// The part of a rank, ghosts included; its comm is left to the caller.
  DistributedMesh cut(Index rank);

 private:
  void collect_cells(Index rank);
  void collect_fractures(Index rank);
  void collect_copies(Index rank);
  void collect_faces_and_nodes();
  void collect_flow(Index rank);
  void fill_faces(DistributedMesh& part) const;
  void fill_cells(DistributedMesh& part) const;
  void fill_data(DistributedMesh& part) const;
  void fill_flow(DistributedMesh& part, Index rank) const;
  [[nodiscard]] std::span<const Index> ridges_of(Index face) const;

  const PolyMesh& whole_;
  FlowEntities flow_;
  Csr node_cells_;
  Ownership cell_owners_, copy_owners_, fracture_owners_, trace_owners_, ridge_owners_;  // Fractures: entities are faces.
  std::vector<Index> fracture_faces_;  // Serial, ascending.
  LocalSet cells_, copies_, fractures_, faces_, nodes_, traces_, ridges_;
};

/// Numbers where one rank owns all n entities.
Numbering all_owned(Index n);
/// 0, 1 ... for each owned entity.
std::vector<GlobalIndex> counted(const Numbering& numbers);

/// The ranks that own cells which see some entities, and the owner of each: the lowest of these ranks or the highest, in turns by runs of the
/// entities' numbers in the whole mesh. So half of a border falls to either side, in patches, and who owns what shows from the cells around
/// it alone.
class Sharers {
 public:
  explicit Sharers(Index entities) : ranks_(static_cast<std::size_t>(entities), {std::numeric_limits<Index>::max(), -1}) {}

  void add(Index entity, Index rank) {
    auto& [lowest, highest] = ranks_[static_cast<std::size_t>(entity)];
    lowest = std::min(lowest, rank);
    highest = std::max(highest, rank);
  }
  /// `row` is the node or face of each entity, and `numbers` the numbers of these in the whole mesh, or none where they are the same.
  [[nodiscard]] std::vector<Index> owners(const std::vector<Index>& row, std::span<const Index> numbers) const;

  static constexpr Index run = 256;  ///< Enough for patches some nodes wide in 3D, few enough for many turns at each border.

 private:
  std::vector<std::array<Index, 2>> ranks_;
};

/// Those of each copy.
Sharers copy_sharers(const PolyMesh& mesh, const std::vector<Index>& part);
/// Owner of each fracture face, that of its + cell; -1 off Gamma.
std::vector<Index> fracture_owner(const PolyMesh& mesh, const std::vector<Index>& part);

}  // namespace polyslip::mesh
