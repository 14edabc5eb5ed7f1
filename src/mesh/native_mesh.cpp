// The native polytopal mesh format: one HDF5 file, numbers from 0, lengths in metres.
//
//   attributes of /        polyslip_mesh_version = 1, dim = 2 or 3
//   /nodes                 n x 3 doubles; in 2D the third is 0
//   /face_nodes/offsets    faces + 1 integers: face f has the nodes values[offsets[f] .. offsets[f+1])
//   /face_nodes/values     nodes of the faces: both ends (2D), all corners in cyclic order (3D)
//   /cell_faces/offsets    cells + 1 integers
//   /cell_faces/values     faces of the cells
//   /face_cells            faces x 2 integers: the cells of each face, -1 behind a boundary face; on a fracture the + side first
//   /cell_region           a number in /region_names for each cell;    /region_names  strings
//   /face_tag              a number in /tag_names or -1 for each face; /tag_names     strings
// and, where fractures are marked,
//   /face_fracture         a number in /fracture_names or -1 for each face; /fracture_names  strings
//   /fracture_length       doubles, one a fracture;                    /face_tip_distance  doubles, one a face; infinite without
//   tips
//
// Strings may be of any kind; they are written with a fixed width, as HDF5 itself crashes on damaged ones of variable length.
// Faces may be turned either way: reading turns them out of their first cell. Node copies follow from the rest and are not stored.
#include "polyslip/mesh/native_mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "polyslip/common/error.hpp"
#include "polyslip/mesh/formats.hpp"
#include "polyslip/mesh/native_file.hpp"
#include "polyslip/mesh/readers.hpp"

namespace polyslip::mesh {

namespace {

constexpr int version = 1;

/// Checks what was read, so that nothing behind this file meets an index out of range. Messages give the numbers of the file.
class Checker {
 public:
  Checker(const NativeFile& file, const NativeSlice& slice) : file_(file), slice_(slice), mesh_(slice.mesh) {}

  /// Offsets as they are in the file; their values have not been read.
  void offsets(const std::string& group, const RowRange& rows, const std::vector<Index>& offsets, Index n_values) const {
    const std::string dataset = group + "/offsets";
    if (rows.first == 0 && offsets.front() != 0) file_.fail(dataset, "the first entry must be 0");
    Index before = 0;
    for (Index i = 0; i <= rows.size; ++i) {
      const Index number = rows.first + i;
      if (offsets[i] < before) file_.fail(dataset, fmt::format("entry {} is smaller than the one before", number));
      if (offsets[i] > n_values || (number == rows.total && offsets[i] != n_values)) {
        file_.fail(dataset, fmt::format("entry {} of {} is {}, but {}/values has {} entries", number, rows.total + 1, offsets[i], group,
                                        n_values));
      }
      before = offsets[i];
    }
  }

  void topology() const {
    coordinates();
    numbers("/face_nodes/values", mesh_.face_nodes.values, slice_.face_corners, 0, slice_.nodes.total, "nodes");
    numbers("/cell_faces/values", mesh_.cell_faces.values, slice_.cell_sides, 0, slice_.faces.total, "faces");
    for (Index face = 0; face < mesh_.n_faces(); ++face) {
      const Index n = mesh_.face_nodes.row_size(face);
      if (n < mesh_.dim || (mesh_.dim == 2 && n != 2)) {
        file_.fail("/face_nodes/offsets", fmt::format("face {} has {} nodes; it must have {}", slice_.faces.first + face, n,
                                                      mesh_.dim == 2 ? "two in 2D" : "three or more in 3D"));
      }
    }
    for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
      if (mesh_.cell_faces.row_size(cell) <= mesh_.dim) {
        file_.fail("/cell_faces/offsets", fmt::format("cell {} has {} faces; it must have more than {}", slice_.cells.first + cell,
                                                      mesh_.cell_faces.row_size(cell), mesh_.dim));
      }
    }
    sides();
  }

  void groups() const {
    numbers("/cell_region", mesh_.cell_region, slice_.cells, 0, mesh_.region_names.size(), "regions");
    numbers("/face_tag", mesh_.face_tag, slice_.faces, -1, mesh_.tag_names.size(), "tags");
  }

  void fractures() const {
    numbers("/face_fracture", mesh_.face_fracture, slice_.faces, -1, mesh_.fracture_names.size(), "fractures");
    for (const double length : mesh_.fracture_length) {
      if (!(length > 0)) file_.fail("/fracture_length", fmt::format("a length is {:g} m; it must be positive", length));
    }
    for (Index face = 0; face < mesh_.n_faces(); ++face) {
      if (!(mesh_.face_tip_distance[face] >= 0)) {
        file_.fail("/face_tip_distance", fmt::format("entry {} is {:g} m; it must not be negative", slice_.faces.first + face,
                                                     mesh_.face_tip_distance[face]));
      }
      if (mesh_.on_fracture(face) && mesh_.on_boundary(face)) {
        file_.fail("/face_fracture", fmt::format("face {} lies on the boundary; a fracture face must have a cell on both sides",
                                                 slice_.faces.first + face));
      }
    }
  }

  /// face_cells and cell_faces must say the same.
  void incidence(const std::vector<std::array<Index, 2>>& cells_of, long long named) const {
    std::vector<Index> sorted;
    for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
      const Index number = slice_.cells.first + cell;
      for (Index i = mesh_.cell_faces.offsets[cell]; i < mesh_.cell_faces.offsets[cell + 1]; ++i) {
        const auto& [first, second] = cells_of[i];
        if (first != number && second != number) refuse_side(number, mesh_.cell_faces.values[i], cells_of[i], "");
      }
      sorted.assign(mesh_.cell_faces[cell].begin(), mesh_.cell_faces[cell].end());
      std::sort(sorted.begin(), sorted.end());
      const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
      if (twice == sorted.end()) continue;
      const auto faces = mesh_.cell_faces[cell];
      const auto place = std::find(faces.begin(), faces.end(), *twice) - faces.begin();
      refuse_side(number, *twice, cells_of[mesh_.cell_faces.offsets[cell] + place], ", twice");
    }
    const bool is_last = slice_.cells.first + slice_.cells.size == slice_.cells.total;  // so that what other slices find is said first
    if (is_last && slice_.cell_sides.total != named) {
      file_.fail("/cell_faces/values", fmt::format("it has {} entries instead of {}", slice_.cell_sides.total, named));
    }
  }

  /// A node of no cell would have unknowns that nothing holds.
  void corners(const std::vector<Index>& used) const {
    const auto unused = std::find(used.begin(), used.end(), 0);
    if (unused != used.end()) {
      file_.fail("/nodes", fmt::format("node {} is a corner of no face", slice_.nodes.first + (unused - used.begin())),
                 "Leave it out and number the nodes behind it anew");
    }
  }

 private:
  void coordinates() const {
    for (Index node = 0; node < mesh_.n_nodes(); ++node) {
      const Vec3& x = mesh_.nodes[node];
      const Index number = slice_.nodes.first + node;
      if (!x.allFinite()) file_.fail("/nodes", fmt::format("node {} is at ({}, {}, {})", number, x[0], x[1], x[2]));
      if (mesh_.dim == 2 && x[2] != 0) {
        file_.fail("/nodes", fmt::format("node {} has the third coordinate {}; it must be 0 in 2D", number, x[2]));
      }
    }
  }

  /// Numbers from `lowest` to one below `end`.
  void numbers(const std::string& dataset, const std::vector<Index>& values, const RowRange& rows, Index lowest, std::size_t end,
               const char* of_what) const {
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (values[i] < lowest || values[i] >= static_cast<Index>(end)) {
        file_.fail(dataset, fmt::format("entry {} is {}, but there are {} {}, numbered from 0", rows.first + i, values[i], end, of_what));
      }
    }
  }

  void sides() const {
    for (Index face = 0; face < mesh_.n_faces(); ++face) {
      const auto& [first, second] = mesh_.face_cells[face];
      if (first < 0 || second < -1 || std::max(first, second) >= slice_.cells.total || first == second) {
        file_.fail("/face_cells", fmt::format("face {} has the cells {} and {}; there are {} cells, and only the second may be -1",
                                              slice_.faces.first + face, first, second, slice_.cells.total));
      }
    }
  }

  [[noreturn]] void refuse_side(Index cell, Index face, const std::array<Index, 2>& cells, const char* end) const {
    file_.fail("/cell_faces/values",
               fmt::format("cell {} names face {}, which by /face_cells has the cells {} and {}{}", cell, face, cells[0], cells[1], end));
  }

  const NativeFile& file_;
  const NativeSlice& slice_;
  const PolyMesh& mesh_;
};

/// Rows of a slice, with offsets from 0; `entries` becomes the range of their values.
Csr read_rows(const NativeFile& file, const Checker& check, const std::string& group, const RowRange& rows, RowRange& entries) {
  Csr result;
  entries.total = file.rows<Index>(group + "/values");
  result.offsets = file.read<Index>(group + "/offsets", {rows.first, rows.size + 1, rows.total + 1});
  check.offsets(group, rows, result.offsets, entries.total);
  entries.first = result.offsets.front();
  entries.size = result.offsets.back() - entries.first;
  result.values = file.read<Index>(group + "/values", entries);
  for (Index& offset : result.offsets) offset -= entries.first;
  return result;
}

/// Rows of a slice of all that has such rows.
RowRange find_slice(const NativeFile& file, const std::string& group, Index part, Index parts) {
  const Index offsets = file.rows<Index>(group + "/offsets");
  if (offsets == 0) file.fail(group + "/offsets", "the first entry must be 0");
  return RowRange::slice(offsets - 1, part, parts);
}

void read_header(const NativeFile& file, const std::filesystem::path& path, PolyMesh& mesh) {
  if (const int found = file.read_attribute("polyslip_mesh_version"); found != version) {
    throw InputError(fmt::format("the format has version {}; this program reads version {}", found, version), path.string(),
                     "Write it again with this program or with a script of this version");
  }
  mesh.dim = file.read_attribute("dim");
  if (mesh.dim != 2 && mesh.dim != 3)
    throw InputError(fmt::format("attribute dim is {}; it must be 2 or 3", mesh.dim), path.string(), "Repair the file or write it again");
}

void write_rows(NativeFile& file, const std::string& group, const Csr& rows) {
  file.create_group(group.c_str());
  file.write(group + "/offsets", rows.offsets);
  file.write(group + "/values", rows.values);
}

}  // namespace

NativeSlice read_native_slice(const std::filesystem::path& path, Index part, Index parts) {
  const QuietHdf5 quiet;
  const NativeFile file(path, NativeFile::Mode::read);
  NativeSlice slice;
  slice.file = path;
  PolyMesh& mesh = slice.mesh;
  const Checker check(file, slice);
  read_header(file, path, mesh);
  slice.nodes = RowRange::slice(file.rows<Vec3>("/nodes"), part, parts);
  slice.faces = find_slice(file, "/face_nodes", part, parts);
  slice.cells = find_slice(file, "/cell_faces", part, parts);
  if (slice.cells.total == 0) file.fail("/cell_faces/offsets", "the mesh has no cells");
  mesh.nodes = file.read<Vec3>("/nodes", slice.nodes);
  mesh.face_nodes = read_rows(file, check, "/face_nodes", slice.faces, slice.face_corners);
  mesh.cell_faces = read_rows(file, check, "/cell_faces", slice.cells, slice.cell_sides);
  mesh.face_cells = file.read<std::array<Index, 2>>("/face_cells", slice.faces);
  mesh.cell_region = file.read<Index>("/cell_region", slice.cells);
  mesh.region_names = file.read_texts("/region_names");
  mesh.face_tag = file.read<Index>("/face_tag", slice.faces);
  mesh.tag_names = file.read_texts("/tag_names");
  check.topology();
  check.groups();
  slice.fractured = file.has("/face_fracture");
  if (slice.fractured) {
    mesh.face_fracture = file.read<Index>("/face_fracture", slice.faces);
    mesh.fracture_names = file.read_texts("/fracture_names");
    const auto count = static_cast<Index>(mesh.fracture_names.size());
    mesh.fracture_length = file.read<double>("/fracture_length", {0, count, count});
    mesh.face_tip_distance = file.read<double>("/face_tip_distance", slice.faces);
    check.fractures();
  }
  return slice;
}

void check_native_slice(const NativeSlice& slice, const CellSides& sides, long long named, const std::vector<Index>& used) {
  const QuietHdf5 quiet;
  const NativeFile file(slice.file, NativeFile::Mode::read);
  const Checker check(file, slice);
  check.incidence(sides.cells, named);
  check.corners(used);
}

long long named_sides(const NativeSlice& slice) {
  long long named = 0;
  for (const auto& sides : slice.mesh.face_cells) named += sides[1] < 0 ? 1 : 2;
  return named;
}

void orient_native(const std::filesystem::path& path, PolyMesh& mesh, const std::vector<Index>& cells, const std::vector<Index>& faces) {
  try {
    orient_faces(mesh, cells, faces);
  } catch (const InputError& error) {
    throw InputError(path.string() + ": " + error.what());
  }
}

PolyMesh read_native(const std::filesystem::path& path) {
  NativeSlice whole = read_native_slice(path, 0, 1);
  std::vector<Index> used(whole.mesh.nodes.size(), 0);
  for (const Index node : whole.mesh.face_nodes.values) used[node] = 1;
  check_native_slice(whole, cell_sides(whole.mesh), named_sides(whole), used);
  orient_native(path, whole.mesh);
  return std::move(whole.mesh);
}

void write_native(const PolyMesh& mesh, const std::filesystem::path& path) {
  const QuietHdf5 quiet;
  NativeFile file(path, NativeFile::Mode::create);
  file.write_attribute("polyslip_mesh_version", version);
  file.write_attribute("dim", mesh.dim);
  file.write("/nodes", mesh.nodes);
  write_rows(file, "/face_nodes", mesh.face_nodes);
  write_rows(file, "/cell_faces", mesh.cell_faces);
  file.write("/face_cells", mesh.face_cells);
  file.write("/cell_region", mesh.cell_region);
  file.write("/region_names", mesh.region_names);
  file.write("/face_tag", mesh.face_tag);
  file.write("/tag_names", mesh.tag_names);
  if (!mesh.face_fracture.empty()) {
    file.write("/face_fracture", mesh.face_fracture);
    file.write("/fracture_names", mesh.fracture_names);
    file.write("/fracture_length", mesh.fracture_length);
    file.write("/face_tip_distance", mesh.face_tip_distance);
  }
  file.flush();
}

}  // namespace polyslip::mesh
