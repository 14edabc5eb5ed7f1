#include "polyslip/mesh/cut.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "polyslip/mesh/flow_entities.hpp"

namespace polyslip::mesh {

namespace {

/// Rows of `rows` seen from their values: for each value the rows that hold it, ascending.
Csr transpose(const Csr& rows, Index n_values) {
  Csr result;
  result.offsets.assign(static_cast<std::size_t>(n_values) + 1, 0);
  for (const Index value : rows.values) ++result.offsets[value + 1];
  for (Index value = 0; value < n_values; ++value) result.offsets[value + 1] += result.offsets[value];
  result.values.resize(rows.values.size());
  std::vector<Index> next(result.offsets.begin(), result.offsets.end() - 1);
  for (Index row = 0; row < rows.rows(); ++row) {
    for (const Index value : rows[row]) result.values[next[value]++] = row;
  }
  return result;
}

/// values[m] for each member; an empty array (nothing known) stays empty.
template <class T>
std::vector<T> gather(const std::vector<T>& values, const std::vector<Index>& members) {
  std::vector<T> result;
  if (values.empty()) return result;
  result.reserve(members.size());
  for (const Index member : members) result.push_back(values[member]);
  return result;
}

/// Rows of the members with their values in local numbers.
Csr gather(const Csr& rows, const std::vector<Index>& members, const LocalSet& values) {
  Csr result;
  result.offsets.reserve(members.size() + 1);
  for (const Index member : members) {
    for (const Index value : rows[member]) result.values.push_back(values[value]);
    result.offsets.push_back(static_cast<Index>(result.values.size()));
  }
  return result;
}

/// Adds the owned entities of a rank; ghosts are added after it.
void add_owned(LocalSet& set, const Ownership& owners, Index rank) {
  for (const Index entity : owners.of(rank)) set.add(entity);
}

Numbering numbering(const LocalSet& set, const Ownership& owners, Index rank) {
  Numbering result;
  result.owned = static_cast<Index>(owners.of(rank).size());
  result.first = owners.first[rank];
  result.total = owners.total();
  result.ghosts.reserve(set.members().size() - result.owned);
  for (Index i = result.owned; i < set.size(); ++i) result.ghosts.push_back(owners.number[set.members()[i]]);
  return result;
}

}  // namespace

Ownership::Ownership(const std::vector<Index>& owner, const std::vector<char>& is_backwards)
    : first(is_backwards.size() + 1, 0), number(owner.size(), -1) {
  for (const Index rank : owner) {
    if (rank >= 0) ++first[rank + 1];
  }
  for (std::size_t rank = 0; rank < is_backwards.size(); ++rank) first[rank + 1] += first[rank];
  order.resize(first.back());
  std::vector<GlobalIndex> next;
  for (std::size_t rank = 0; rank < is_backwards.size(); ++rank) next.push_back(is_backwards[rank] ? first[rank + 1] - 1 : first[rank]);
  for (std::size_t i = 0; i < owner.size(); ++i) {
    if (owner[i] < 0) continue;
    GlobalIndex& place = next[owner[i]];
    number[i] = is_backwards[owner[i]] ? place-- : place++;
    order[number[i]] = static_cast<Index>(i);
  }
}

void LocalSet::sort_from(Index begin, const std::vector<GlobalIndex>& key) {
  std::sort(members_.begin() + begin, members_.end(), [&](Index a, Index b) { return key[a] < key[b]; });
  for (Index i = begin; i < size(); ++i) local_[members_[i]] = i;
}

void LocalSet::clear() {
  for (const Index member : members_) local_[member] = -1;
  members_.clear();
}

Numbering all_owned(Index n) { return {.owned = n, .first = 0, .total = n, .ghosts = {}}; }

std::vector<GlobalIndex> counted(const Numbering& numbers) {
  std::vector<GlobalIndex> result(numbers.owned);
  std::iota(result.begin(), result.end(), 0);
  return result;
}

std::vector<Index> Sharers::owners(const std::vector<Index>& row, std::span<const Index> numbers) const {
  std::vector<Index> result(ranks_.size());
  for (std::size_t i = 0; i < ranks_.size(); ++i) {
    const Index number = numbers.empty() ? row[i] : numbers[row[i]];
    result[i] = ranks_[i][static_cast<std::size_t>(number / run % 2)];
  }
  return result;
}

std::vector<char> borders_come_early(const PolyMesh& mesh, const std::vector<Index>& part, Index ranks) {
  std::vector<char> early(ranks, 0);
  if (mesh.dim == 2) return early;
  std::vector<char> is_seen(part.size(), 0);
  const auto visit_pairs = [&](auto&& visit) {
    for (const auto& sides : mesh.face_cells)
      if (sides[0] >= 0 && sides[1] >= 0) visit(std::min(sides[0], sides[1]), std::max(sides[0], sides[1]));
  };
  visit_pairs([&](Index first, Index second) {
    if (part[first] != part[second]) is_seen[first] = is_seen[second] = 1;
  });
  std::vector<long long> before(ranks, 0), behind(ranks, 0);  // neighbours within of cells at borders, in serial order
  visit_pairs([&](Index first, Index second) {
    if (part[first] != part[second] || part[first] < 0 || is_seen[first] == is_seen[second]) return;
    ++(is_seen[second] != 0 ? before : behind)[part[first]];
  });
  for (Index rank = 0; rank < ranks; ++rank) early[rank] = behind[rank] > before[rank] ? 1 : 0;
  return early;
}

Sharers copy_sharers(const PolyMesh& mesh, const std::vector<Index>& part) {
  Sharers sharers(mesh.n_copies());
  for (Index cell = 0; cell < mesh.n_cells(); ++cell) {
    for (const Index copy : mesh.copies_of(cell)) sharers.add(copy, part[cell]);
  }
  return sharers;
}

std::vector<Index> fracture_owner(const PolyMesh& mesh, const std::vector<Index>& part) {
  std::vector<Index> owner(mesh.n_faces(), -1);
  for (Index face = 0; face < mesh.n_faces(); ++face) {
    if (mesh.on_fracture(face) && !mesh.on_boundary(face)) owner[face] = part[mesh.face_cells[face][0]];
  }
  return owner;
}

PartCutter::PartCutter(const PolyMesh& whole, const std::vector<Index>& part, const std::vector<char>& is_backwards, FlowEntities flow,
                       const WholeNumbers& numbers)
    : whole_(whole),
      flow_(std::move(flow)),
      node_cells_(transpose(whole.cell_nodes, whole.n_nodes())),
      cell_owners_(part, is_backwards),
      copy_owners_(copy_sharers(whole, part).owners(whole.copy_node, numbers.nodes), is_backwards),
      fracture_owners_(fracture_owner(whole, part), is_backwards),
      trace_owners_(trace_sharers(whole, flow_, part).owners(flow_.trace_face, numbers.faces), is_backwards),
      ridge_owners_(ridge_owner(whole, flow_, part), is_backwards),
      fracture_faces_(inner_fracture_faces(whole)),
      cells_(whole.n_cells()),
      copies_(whole.n_copies()),
      fractures_(whole.n_faces()),
      faces_(whole.n_faces()),
      nodes_(whole.n_nodes()),
      traces_(flow_.traces.total),
      ridges_(flow_.ridges.total) {}

DistributedMesh PartCutter::cut(Index rank) {
  collect_cells(rank);
  collect_fractures(rank);
  collect_copies(rank);
  collect_faces_and_nodes();
  if (!flow_.empty()) collect_flow(rank);

  DistributedMesh part;
  part.cells = numbering(cells_, cell_owners_, rank);
  part.copies = numbering(copies_, copy_owners_, rank);
  part.fractures = numbering(fractures_, fracture_owners_, rank);
  part.cell_input = cells_.members();
  part.copy_input = copies_.members();
  part.fracture_face_input = fractures_.members();
  for (const Index face : fractures_.members()) part.fracture_faces.push_back(faces_[face]);
  part.total_faces = whole_.n_faces();
  part.total_nodes = whole_.n_nodes();
  fill_faces(part);
  fill_cells(part);
  fill_data(part);
  if (!flow_.empty()) fill_flow(part, rank);

  for (LocalSet* set : {&cells_, &copies_, &fractures_, &faces_, &nodes_, &traces_, &ridges_}) set->clear();
  return part;
}

/// Owned cells, the cells that share a node with them, and the cells across the fracture faces of all these.
void PartCutter::collect_cells(Index rank) {
  add_owned(cells_, cell_owners_, rank);
  const Index owned = cells_.size();
  for (Index i = 0; i < owned; ++i) {
    for (const Index node : whole_.cell_nodes[cells_.members()[i]]) {
      if (nodes_[node] >= 0) continue;
      nodes_.add(node);
      for (const Index cell : node_cells_[node]) cells_.add(cell);
    }
  }
  const Index around = cells_.size();
  for (Index i = 0; i < around; ++i) {
    for (const Index face : whole_.cell_faces[cells_.members()[i]]) {
      if (fracture_owners_.number[face] < 0) continue;
      for (const Index cell : whole_.face_cells[face]) cells_.add(cell);
    }
  }
  cells_.sort_from(owned, cell_owners_.number);
}

void PartCutter::collect_fractures(Index rank) {
  add_owned(fractures_, fracture_owners_, rank);
  const Index owned = fractures_.size();
  for (const Index cell : cells_.members()) {
    for (const Index face : whole_.cell_faces[cell]) {
      if (fracture_owners_.number[face] < 0) continue;
      const auto& sides = whole_.face_cells[face];
      if (cells_[sides[0]] >= 0 && cells_[sides[1]] >= 0) fractures_.add(face);
    }
  }
  fractures_.sort_from(owned, fracture_owners_.number);
}

void PartCutter::collect_copies(Index rank) {
  add_owned(copies_, copy_owners_, rank);
  const Index owned = copies_.size();
  for (const Index cell : cells_.members()) {
    for (const Index copy : whole_.copies_of(cell)) copies_.add(copy);
  }
  copies_.sort_from(owned, copy_owners_.number);
}

void PartCutter::collect_faces_and_nodes() {
  for (const Index cell : cells_.members()) {
    for (const Index face : whole_.cell_faces[cell]) faces_.add(face);
    for (const Index node : whole_.cell_nodes[cell]) nodes_.add(node);
  }
}

/// A face whose first cell is not here is turned, so that the one that is here comes first; fracture faces keep their + side first,
/// here or not (-1).
void PartCutter::fill_faces(DistributedMesh& part) const {
  PolyMesh& mesh = part.mesh;
  mesh.face_nodes = gather(whole_.face_nodes, faces_.members(), nodes_);
  mesh.face_cells.reserve(faces_.members().size());
  part.face_is_boundary.reserve(faces_.members().size());
  for (Index face = 0; face < faces_.size(); ++face) {
    const Index serial = faces_.members()[face];
    const auto& sides = whole_.face_cells[serial];
    const bool boundary = sides[1] < 0;
    std::array<Index, 2> local{cells_[sides[0]], boundary ? -1 : cells_[sides[1]]};
    if (local[0] < 0 && !whole_.on_fracture(serial)) {
      std::swap(local[0], local[1]);
      const auto nodes = mesh.face_nodes[face];
      std::reverse(nodes.begin() + (nodes.size() > 2 ? 1 : 0), nodes.end());  // 3D: the first node stays first
    }
    mesh.face_cells.push_back(local);
    part.face_is_boundary.push_back(boundary ? 1 : 0);
  }
}

void PartCutter::fill_cells(DistributedMesh& part) const {
  PolyMesh& mesh = part.mesh;
  mesh.cell_faces = gather(whole_.cell_faces, cells_.members(), faces_);
  mesh.cell_nodes = gather(whole_.cell_nodes, cells_.members(), nodes_);
  mesh.cell_copies.reserve(mesh.cell_nodes.values.size());
  for (const Index cell : cells_.members()) {
    for (const Index copy : whole_.copies_of(cell)) mesh.cell_copies.push_back(copies_[copy]);
  }
  mesh.copy_node.reserve(copies_.members().size());
  for (const Index copy : copies_.members()) mesh.copy_node.push_back(nodes_[whole_.copy_node[copy]]);
}

void PartCutter::fill_data(DistributedMesh& part) const {
  PolyMesh& mesh = part.mesh;
  mesh.dim = whole_.dim;
  mesh.nodes = gather(whole_.nodes, nodes_.members());
  mesh.cell_region = gather(whole_.cell_region, cells_.members());
  mesh.region_names = whole_.region_names;
  mesh.face_tag = gather(whole_.face_tag, faces_.members());
  mesh.tag_names = whole_.tag_names;
  mesh.face_fracture = gather(whole_.face_fracture, faces_.members());
  mesh.fracture_names = whole_.fracture_names;
  mesh.fracture_length = whole_.fracture_length;
  mesh.face_tip_distance = gather(whole_.face_tip_distance, faces_.members());
}

std::span<const Index> PartCutter::ridges_of(Index face) const {
  const auto place = std::lower_bound(fracture_faces_.begin(), fracture_faces_.end(), face) - fracture_faces_.begin();
  return flow_.fracture_ridges[static_cast<Index>(place)];
}

/// All traces that local cells see and all ridges of local fracture faces. What the rows of owned entities need is among them:
///  * an owned trace is seen by an owned cell; the cell across, if it sees the trace too, shares the face's nodes and is here;
///  * an owned ridge lies on a fracture face whose + cell is owned, so that an owned cell has the ridge's nodes. Both cells of any
///    other fracture face at the ridge have these nodes too, hence are in the ghost layer: the face is local, with both its sides.
void PartCutter::collect_flow(Index rank) {
  add_owned(traces_, trace_owners_, rank);
  add_owned(ridges_, ridge_owners_, rank);
  const Index owned_traces = traces_.size(), owned_ridges = ridges_.size();
  for (const Index face : faces_.members()) {
    for (int side = 0; side < 2; ++side) {
      const Index cell = whole_.face_cells[face][side];
      if (cell >= 0 && cells_[cell] >= 0) traces_.add(flow_.face_traces[face][side]);
    }
  }
  for (const Index face : fractures_.members()) {
    for (const Index ridge : ridges_of(face)) ridges_.add(ridge);
  }
  traces_.sort_from(owned_traces, trace_owners_.number);
  ridges_.sort_from(owned_ridges, ridge_owners_.number);
}

void PartCutter::fill_flow(DistributedMesh& part, Index rank) const {
  FlowEntities& flow = part.flow;
  flow.traces = numbering(traces_, trace_owners_, rank);
  flow.trace_input = traces_.members();
  for (const Index trace : traces_.members()) flow.trace_face.push_back(faces_[flow_.trace_face[trace]]);
  for (Index face = 0; face < faces_.size(); ++face) {
    const auto& sides = part.mesh.face_cells[face];
    const auto& traces = flow_.face_traces[faces_.members()[face]];
    // A face that was turned has the same trace on both sides.
    flow.face_traces.push_back({sides[0] < 0 ? -1 : traces_[traces[0]], sides[1] < 0 ? -1 : traces_[traces[1]]});
  }

  flow.ridges = numbering(ridges_, ridge_owners_, rank);
  flow.ridge_input = ridges_.members();
  for (const Index face : fractures_.members()) {
    std::vector<Index> ridges;
    for (const Index ridge : ridges_of(face)) ridges.push_back(ridges_[ridge]);
    flow.fracture_ridges.push_row(ridges);
  }
  for (const Index ridge : ridges_.members()) {
    const auto& [first, second] = flow_.ridge_nodes[ridge];
    flow.ridge_nodes.push_back({nodes_[first], second < 0 ? -1 : nodes_[second]});
    std::vector<Index> boundary;
    for (const Index face : flow_.ridge_boundary_faces[ridge]) {
      if (faces_[face] >= 0) boundary.push_back(faces_[face]);
    }
    flow.ridge_boundary_faces.push_row(boundary);
  }
}

}  // namespace polyslip::mesh
