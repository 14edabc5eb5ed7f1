#include "polyslip/mesh/builder.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "polyslip/common/error.hpp"
#include "polyslip/mesh/face_tools.hpp"

namespace polyslip::mesh {
namespace {

Index number_of(const std::string& name, std::vector<std::string>& names) {
  const auto at = std::find(names.begin(), names.end(), name);
  const auto number = static_cast<Index>(at - names.begin());
  if (at == names.end()) names.push_back(name);
  return number;
}

}  // namespace

MeshBuilder::MeshBuilder(int dim, std::vector<Vec3> nodes, std::string where)
    : dim_(dim), where_(std::move(where)), nodes_(std::move(nodes)) {}

Index MeshBuilder::region(const std::string& name) { return number_of(name, regions_); }
Index MeshBuilder::tag(const std::string& name) { return number_of(name, tags_); }

void MeshBuilder::reserve(std::size_t cells, std::size_t faces_of_cells, std::size_t nodes_of_faces) {
  cell_region_.reserve(cells);
  owner_.reserve(faces_of_cells);
  rows_.offsets.reserve(faces_of_cells + 1);
  rows_.values.reserve(nodes_of_faces);
}

Index MeshBuilder::add_cell(Index region) {
  cell_region_.push_back(region);
  return static_cast<Index>(cell_region_.size()) - 1;
}

void MeshBuilder::add_face(std::span<const Index> nodes) { add_row(static_cast<Index>(cell_region_.size()) - 1, nodes); }

Index MeshBuilder::add_polygon(std::span<const Index> nodes, Index region) {
  const Index cell = add_cell(region);
  Index from = nodes.back();
  for (const Index to : nodes) {
    add_face(std::array{from, to});
    from = to;
  }
  return cell;
}

void MeshBuilder::tag_face(Index tag, std::span<const Index> nodes) { add_row(-1 - tag, nodes); }

void MeshBuilder::add_row(Index owner, std::span<const Index> nodes) {
  rows_.push_row(nodes);
  owner_.push_back(owner);
  const Index row = rows_.rows() - 1;
  for (const Index s : nodes) {
    if (s < 0 || s >= static_cast<Index>(nodes_.size())) fail("has a node that does not exist", row, "Check the node numbers");
  }
  if (static_cast<int>(nodes.size()) < dim_ || (dim_ == 2 && nodes.size() > 2)) {
    fail(fmt::format("has {} nodes; a face has two in 2D, three or more in 3D", nodes.size()), row, "Check this cell");
  }
}

PolyMesh MeshBuilder::build() {
  PolyMesh mesh;
  mesh.dim = dim_;
  mesh.region_names = regions_.empty() ? std::vector<std::string>{"rock"} : std::move(regions_);
  mesh.tag_names = std::move(tags_);
  number_faces(mesh, first_equal_rows());
  mesh.cell_region = std::move(cell_region_);
  drop_unused_nodes(mesh);
  *this = MeshBuilder(dim_, {}, where_);
  try {
    orient_faces(mesh);
  } catch (const InputError& error) {
    throw InputError(where_ + ": " + error.what());
  }
  return mesh;
}

/// For each row the first row of a cell with the same set of nodes, -1 if there is none. Rows are sorted by their smallest node
/// first (a counting sort), the few rows that share it by the rest.
std::vector<Index> MeshBuilder::first_equal_rows() const {
  Csr sorted = rows_;
  std::vector<Index> bucket(nodes_.size() + 1, 0);
  for (Index r = 0; r < sorted.rows(); ++r) {
    const auto row = sorted[r];
    std::sort(row.begin(), row.end());
    if (std::adjacent_find(row.begin(), row.end()) != row.end()) fail("names a node twice", r, "Repair this cell in the mesh file");
    ++bucket[row[0] + 1];
  }
  std::partial_sum(bucket.begin(), bucket.end(), bucket.begin());
  std::vector<Index> order(sorted.rows());
  std::vector<Index> next = bucket;
  for (Index r = 0; r < sorted.rows(); ++r) order[next[sorted[r][0]]++] = r;

  const auto compare = [&](Index a, Index b) {
    const auto row_a = std::as_const(sorted)[a], row_b = std::as_const(sorted)[b];
    return std::lexicographical_compare_three_way(row_a.begin(), row_a.end(), row_b.begin(), row_b.end());
  };
  std::vector<Index> first(sorted.rows(), -1);
  for (std::size_t s = 0; s + 1 < bucket.size(); ++s) {
    const auto begin = order.begin() + bucket[s], end = order.begin() + bucket[s + 1];
    std::sort(begin, end, [&](Index a, Index b) {
      const auto by_nodes = compare(a, b);
      if (by_nodes != 0) return by_nodes < 0;
      return std::pair(owner_[a] < 0, a) < std::pair(owner_[b] < 0, b);  // rows of cells before tagged faces
    });
    for (auto group = begin; group != end;) {
      const auto group_end = std::find_if(group, end, [&](Index r) { return compare(*group, r) != 0; });
      for (auto r = group; r != group_end; ++r) first[*r] = owner_[*group] < 0 ? -1 : *group;
      group = group_end;
    }
  }
  return first;
}

void MeshBuilder::number_faces(PolyMesh& mesh, const std::vector<Index>& first_equal) {
  std::vector<Index> face_of(rows_.rows(), -1);
  mesh.cell_faces.offsets.assign(cell_region_.size() + 1, 0);
  for (Index r = 0; r < rows_.rows(); ++r) {
    const Index cell = owner_[r];
    if (cell < 0) continue;
    Index& face = face_of[first_equal[r]];
    if (first_equal[r] == r) {
      face = mesh.n_faces();
      mesh.face_nodes.push_row(rows_[r]);
      mesh.face_cells.push_back({cell, -1});
    } else {
      auto& cells = mesh.face_cells[face];
      if (cells[0] == cell || cells[1] >= 0) {
        fail(fmt::format("is already a face of cells {} and {}", cells[0], cells[1] < 0 ? cells[0] : cells[1]), r,
             "A face belongs to two cells at most; look for duplicated or overlapping cells");
      }
      cells[1] = cell;
    }
    mesh.cell_faces.values.push_back(face);
    ++mesh.cell_faces.offsets[cell + 1];
  }
  std::partial_sum(mesh.cell_faces.offsets.begin(), mesh.cell_faces.offsets.end(), mesh.cell_faces.offsets.begin());

  mesh.face_tag.assign(mesh.n_faces(), -1);
  for (Index r = 0; r < rows_.rows(); ++r) {
    if (owner_[r] >= 0) continue;
    if (first_equal[r] < 0) {
      fail(fmt::format("in group '{}' is not a face of any cell", mesh.tag_names[-1 - owner_[r]]), r,
           "Generate surface and volume elements together, or remove the group");
    }
    Index& tag = mesh.face_tag[face_of[first_equal[r]]];
    if (tag < 0) tag = -1 - owner_[r];
  }
}

void MeshBuilder::drop_unused_nodes(PolyMesh& mesh) {
  std::vector<Index> number(nodes_.size(), -1);
  for (const Index s : mesh.face_nodes.values) number[s] = 0;
  for (std::size_t s = 0; s < nodes_.size(); ++s) {
    if (number[s] < 0) continue;
    number[s] = mesh.n_nodes();
    mesh.nodes.push_back(nodes_[s]);
  }
  for (Index& s : mesh.face_nodes.values) s = number[s];
}

void MeshBuilder::fail(const std::string& what, Index row, const std::string& remedy) const {
  const std::string of_cell = owner_[row] < 0 ? "" : fmt::format(" of cell {}", owner_[row]);
  throw InputError(fmt::format("the face{} with nodes {} {}", of_cell, fmt::join(rows_[row], " "), what), where_, remedy);
}

void tag_boundary(PolyMesh& mesh, const std::string& tag, const std::function<bool(const Vec3&)>& inside) {
  mesh.face_tag.resize(mesh.n_faces(), -1);
  const Index number = number_of(tag, mesh.tag_names);
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    if (mesh.on_boundary(f) && mesh.face_tag[f] < 0 && inside(node_average(mesh, f))) mesh.face_tag[f] = number;
  }
}

}  // namespace polyslip::mesh
