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
#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <limits>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "polyslip/common/error.hpp"
#include "polyslip/mesh/formats.hpp"
#include "polyslip/mesh/readers.hpp"

namespace polyslip::mesh {

namespace {

constexpr int version = 1;

/// Sole owner of one HDF5 identifier.
class Id {
 public:
  Id(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Id() {
    if (id_ >= 0) close_(id_);
  }
  Id(const Id&) = delete;
  Id& operator=(const Id&) = delete;
  operator hid_t() const { return id_; }  // NOLINT: borrowed on purpose

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

/// HDF5 prints nothing while this lives: our exceptions say what is wrong.
class QuietHdf5 {
 public:
  QuietHdf5() {
    H5Eget_auto2(H5E_DEFAULT, &print_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~QuietHdf5() { H5Eset_auto2(H5E_DEFAULT, print_, data_); }
  QuietHdf5(const QuietHdf5&) = delete;
  QuietHdf5& operator=(const QuietHdf5&) = delete;

 private:
  H5E_auto2_t print_ = nullptr;
  void* data_ = nullptr;
};

/// How an entry of an array lies in a table: so many columns of doubles or of integers.
template <class T>
struct Entry {
  using Scalar = std::conditional_t<std::is_same_v<T, double> || std::is_same_v<T, Vec3>, double, Index>;
  static constexpr int columns = sizeof(T) / sizeof(Scalar);
  static hid_t type() { return std::is_same_v<Scalar, double> ? H5T_NATIVE_DOUBLE : H5T_NATIVE_INT32; }
  static H5T_class_t type_class() { return std::is_same_v<Scalar, double> ? H5T_FLOAT : H5T_INTEGER; }
};

class NativeFile {
 public:
  enum class Mode { create, read };

  NativeFile(const std::filesystem::path& file, Mode mode)
      : name_(file.string()),
        file_(mode == Mode::create ? create(name_) : H5Fopen(name_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose) {
    if (file_ >= 0) return;
    if (mode == Mode::create)
      throw InputError("the file cannot be written", name_, "Check that the folder exists and may be written to");
    throw InputError("this is not an HDF5 file, or a part of it is missing", name_, "Write it again or copy it completely");
  }

  void write_attribute(const char* name, int value) {
    const Id space(H5Screate(H5S_SCALAR), H5Sclose);
    const Id attribute(H5Acreate2(file_, name, H5T_NATIVE_INT, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    written(H5Awrite(attribute, H5T_NATIVE_INT, &value));
  }

  [[nodiscard]] int read_attribute(const char* name) const {
    int value = 0;
    if (H5Aexists(file_, name) > 0) {
      const Id attribute(H5Aopen(file_, name, H5P_DEFAULT), H5Aclose);
      if (H5Aread(attribute, H5T_NATIVE_INT, &value) >= 0) return value;
    }
    throw InputError(fmt::format("attribute {} is missing, so this is not a mesh in the native format", name), name_,
                     "Native meshes are written by polyslip, or by a script that follows the format in its documentation");
  }

  [[nodiscard]] bool has(const char* dataset) const { return H5Lexists(file_, dataset, H5P_DEFAULT) > 0; }

  void create_group(const char* group) { written(Id(H5Gcreate2(file_, group, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose)); }

  template <class T>
  void write(const std::string& dataset, const std::vector<T>& values) {
    write_table(dataset, values.size(), Entry<T>::columns, Entry<T>::type(), values.data());
  }

  void write(const std::string& dataset, const std::vector<std::string>& texts) {
    std::size_t width = 1;
    for (const auto& text : texts) width = std::max(width, text.size());
    std::string columns;
    for (const auto& text : texts) columns += text + std::string(width - text.size(), '\0');
    const Id type = text_type(width);
    write_table(dataset, texts.size(), 1, type, columns.data());
  }

  template <class T>
  [[nodiscard]] std::vector<T> read(const std::string& dataset) const {
    const Id table =
        open(dataset, Entry<T>::type_class(), std::is_same_v<typename Entry<T>::Scalar, double> ? "real numbers" : "integers");
    std::vector<T> values(rows_of(table, dataset, Entry<T>::columns));
    if (!values.empty() && H5Dread(table, Entry<T>::type(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) unreadable(dataset);
    return values;
  }

  [[nodiscard]] std::vector<std::string> read_texts(const std::string& dataset) const {
    const Id table = open(dataset, H5T_STRING, "strings");
    const std::size_t count = rows_of(table, dataset, 1);
    if (count == 0) return {};
    const Id type(H5Dget_type(table), H5Tclose);
    return H5Tis_variable_str(type) > 0 ? read_pointers(table, dataset, count) : read_columns(table, dataset, count, H5Tget_size(type));
  }

  /// Hands everything to the system; a destructor cannot report a full disk.
  void flush() { written(H5Fflush(file_, H5F_SCOPE_GLOBAL)); }

  [[noreturn]] void fail(const std::string& dataset, const std::string& what,
                         const std::string& remedy = "Repair the file or write it again") const {
    throw InputError(what, fmt::format("{}, dataset {}", name_, dataset), remedy);
  }

 private:
  /// In the format of HDF5 1.8, which has checksums on all but the numbers: on damaged files of the older one HDF5 reads beyond its buffers.
  static hid_t create(const std::string& name) {
    const Id access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    H5Pset_libver_bounds(access, H5F_LIBVER_V18, H5F_LIBVER_LATEST);
    return H5Fcreate(name.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
  }

  [[nodiscard]] std::vector<std::string> read_columns(hid_t table, const std::string& dataset, std::size_t count, std::size_t width) const {
    constexpr std::size_t widest = 100'000;
    if (width > widest) fail(dataset, fmt::format("a string of {} bytes is not a name", width));
    std::string columns(count * width, '\0');
    const Id type = text_type(width);
    if (H5Dread(table, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, columns.data()) < 0) unreadable(dataset);
    std::vector<std::string> texts;
    for (std::size_t i = 0; i < count; ++i) {
      const std::string text = columns.substr(i * width, width);
      texts.push_back(text.substr(0, text.find('\0')));
    }
    return texts;
  }

  [[nodiscard]] std::vector<std::string> read_pointers(hid_t table, const std::string& dataset, std::size_t count) const {
    std::vector<char*> pointers(count, nullptr);
    std::vector<std::string> texts;
    const Id type = text_type(H5T_VARIABLE);
    if (H5Dread(table, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, pointers.data()) < 0) unreadable(dataset);
    for (const char* text : pointers) texts.emplace_back(text == nullptr ? "" : text);
    const Id space(H5Dget_space(table), H5Sclose);
    H5Dvlen_reclaim(type, space, H5P_DEFAULT, pointers.data());
    return texts;
  }

  static Id text_type(std::size_t width) {
    const hid_t type = H5Tcopy(H5T_C_S1);
    H5Tset_size(type, width);
    if (width != H5T_VARIABLE) H5Tset_strpad(type, H5T_STR_NULLPAD);
    H5Tset_cset(type, H5T_CSET_UTF8);
    return {type, H5Tclose};
  }

  void write_table(const std::string& dataset, hsize_t rows, int columns, hid_t type, const void* values) {
    const std::array<hsize_t, 2> shape{rows, static_cast<hsize_t>(columns)};
    const Id space(H5Screate_simple(columns == 1 ? 1 : 2, shape.data(), nullptr), H5Sclose);
    const Id table(H5Dcreate2(file_, dataset.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
    written(table);
    if (rows > 0) written(H5Dwrite(table, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values));
  }

  [[nodiscard]] Id open(const std::string& dataset, H5T_class_t expected, const char* kind) const {
    const hid_t table = H5Dopen2(file_, dataset.c_str(), H5P_DEFAULT);
    if (table < 0) fail(dataset, "the dataset is missing");
    const Id type(H5Dget_type(table), H5Tclose);
    if (H5Tget_class(type) != expected) {
      H5Dclose(table);
      fail(dataset, fmt::format("the entries are not {}", kind));
    }
    return {table, H5Dclose};
  }

  [[nodiscard]] std::size_t rows_of(hid_t table, const std::string& dataset, int columns) const {
    const Id space(H5Dget_space(table), H5Sclose);
    std::array<hsize_t, 2> shape{0, 1};
    const int rank = H5Sget_simple_extent_ndims(space);
    if (rank == (columns == 1 ? 1 : 2)) H5Sget_simple_extent_dims(space, shape.data(), nullptr);
    if (rank != (columns == 1 ? 1 : 2) || shape[1] != static_cast<hsize_t>(columns)) {
      fail(dataset, columns == 1 ? "the table must have one dimension" : fmt::format("the table must have {} columns", columns));
    }
    if (shape[0] > static_cast<hsize_t>(std::numeric_limits<Index>::max())) {
      fail(dataset, fmt::format("{} rows are more than 32-bit numbers can count", shape[0]), "Use a smaller mesh");
    }
    return shape[0];
  }

  void written(hid_t status) const {
    if (status < 0) throw InputError("writing failed", name_, "Check the space left on the disk");
  }
  [[noreturn]] void unreadable(const std::string& dataset) const { fail(dataset, "the values cannot be read"); }

  std::string name_;
  Id file_;
};

/// Checks what was read, so that nothing behind this file meets an index out of range.
class Checker {
 public:
  Checker(const NativeFile& file, const PolyMesh& mesh) : file_(file), mesh_(mesh) {}

  void topology() const {
    coordinates();
    rows("/face_nodes", mesh_.face_nodes, mesh_.n_nodes(), "nodes");
    rows("/cell_faces", mesh_.cell_faces, mesh_.n_faces(), "faces");
    if (mesh_.n_cells() == 0) file_.fail("/cell_faces/offsets", "the mesh has no cells");
    for (Index face = 0; face < mesh_.n_faces(); ++face) {
      const Index n = mesh_.face_nodes.row_size(face);
      if (n < mesh_.dim || (mesh_.dim == 2 && n != 2)) {
        file_.fail("/face_nodes/offsets", fmt::format("face {} has {} nodes; it must have {}", face, n,
                                                      mesh_.dim == 2 ? "two in 2D" : "three or more in 3D"));
      }
    }
    for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
      if (mesh_.cell_faces.row_size(cell) <= mesh_.dim) {
        file_.fail("/cell_faces/offsets", fmt::format("cell {} has {} faces; it must have more than {}", cell,
                                                      mesh_.cell_faces.row_size(cell), mesh_.dim));
      }
    }
    sides();
    corners();
  }

  void groups() const {
    numbers("/cell_region", mesh_.cell_region, mesh_.n_cells(), 0, mesh_.region_names.size(), "regions");
    numbers("/face_tag", mesh_.face_tag, mesh_.n_faces(), -1, mesh_.tag_names.size(), "tags");
  }

  void fractures() const {
    numbers("/face_fracture", mesh_.face_fracture, mesh_.n_faces(), -1, mesh_.fracture_names.size(), "fractures");
    size("/fracture_length", mesh_.fracture_length.size(), mesh_.fracture_names.size());
    size("/face_tip_distance", mesh_.face_tip_distance.size(), mesh_.n_faces());
    for (const double length : mesh_.fracture_length) {
      if (!(length > 0)) file_.fail("/fracture_length", fmt::format("a length is {:g} m; it must be positive", length));
    }
    for (Index face = 0; face < mesh_.n_faces(); ++face) {
      if (!(mesh_.face_tip_distance[face] >= 0)) {
        file_.fail("/face_tip_distance",
                   fmt::format("entry {} is {:g} m; it must not be negative", face, mesh_.face_tip_distance[face]));
      }
      if (mesh_.on_fracture(face) && mesh_.on_boundary(face)) {
        file_.fail("/face_fracture",
                   fmt::format("face {} lies on the boundary; a fracture face must have a cell on both sides", face));
      }
    }
  }

 private:
  void size(const std::string& dataset, std::size_t actual, std::size_t expected) const {
    if (actual != expected) file_.fail(dataset, fmt::format("it has {} entries instead of {}", actual, expected));
  }

  void coordinates() const {
    for (Index node = 0; node < mesh_.n_nodes(); ++node) {
      const Vec3& x = mesh_.nodes[node];
      if (!x.allFinite()) file_.fail("/nodes", fmt::format("node {} is at ({}, {}, {})", node, x[0], x[1], x[2]));
      if (mesh_.dim == 2 && x[2] != 0) {
        file_.fail("/nodes", fmt::format("node {} has the third coordinate {}; it must be 0 in 2D", node, x[2]));
      }
    }
  }

  void rows(const std::string& dataset, const Csr& csr, Index n_values, const char* of_what) const {
    const std::string offsets = dataset + "/offsets", values = dataset + "/values";
    if (csr.offsets.empty() || csr.offsets.front() != 0) file_.fail(offsets, "the first entry must be 0");
    for (std::size_t i = 1; i < csr.offsets.size(); ++i) {
      if (csr.offsets[i] < csr.offsets[i - 1]) file_.fail(offsets, fmt::format("entry {} is smaller than the one before", i));
    }
    if (static_cast<std::size_t>(csr.offsets.back()) != csr.values.size()) {
      file_.fail(offsets,
                 fmt::format("the last entry is {}, but {} has {} entries", csr.offsets.back(), values, csr.values.size()));
    }
    numbers(values, csr.values, static_cast<Index>(csr.values.size()), 0, n_values, of_what);
  }

  /// `count` numbers from `lowest` to one below `end`.
  void numbers(const std::string& dataset, const std::vector<Index>& values, Index count, Index lowest, std::size_t end,
               const char* of_what) const {
    size(dataset, values.size(), count);
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (values[i] < lowest || values[i] >= static_cast<Index>(end)) {
        file_.fail(dataset, fmt::format("entry {} is {}, but there are {} {}, numbered from 0", i, values[i], end, of_what));
      }
    }
  }

  /// face_cells and cell_faces must say the same.
  void sides() const {
    size("/face_cells", mesh_.face_cells.size(), mesh_.n_faces());
    Index named = 0;
    for (Index face = 0; face < mesh_.n_faces(); ++face) {
      const auto& [first, second] = mesh_.face_cells[face];
      if (first < 0 || second < -1 || std::max(first, second) >= mesh_.n_cells() || first == second) {
        file_.fail("/face_cells", fmt::format("face {} has the cells {} and {}; there are {} cells, and only the second may be -1",
                                              face, first, second, mesh_.n_cells()));
      }
      named += second < 0 ? 1 : 2;
    }
    std::vector<Index> last_cell(mesh_.n_faces(), -1);
    for (Index cell = 0; cell < mesh_.n_cells(); ++cell) {
      for (const Index face : mesh_.cell_faces[cell]) {
        const auto& [first, second] = mesh_.face_cells[face];
        if ((first != cell && second != cell) || last_cell[face] == cell) {
          file_.fail("/cell_faces/values", fmt::format("cell {} names face {}, which by /face_cells has the cells {} and {}{}",
                                                       cell, face, first, second, last_cell[face] == cell ? ", twice" : ""));
        }
        last_cell[face] = cell;
      }
    }
    size("/cell_faces/values", mesh_.cell_faces.values.size(), named);
  }

  /// A node of no cell would have unknowns that nothing holds.
  void corners() const {
    std::vector<char> used(mesh_.nodes.size(), 0);
    for (const Index node : mesh_.face_nodes.values) used[node] = 1;
    const auto unused = std::find(used.begin(), used.end(), 0);
    if (unused != used.end()) {
      file_.fail("/nodes", fmt::format("node {} is a corner of no face", unused - used.begin()), "Leave it out and number the nodes behind it anew");
    }
  }

  const NativeFile& file_;
  const PolyMesh& mesh_;
};

Csr read_rows(const NativeFile& file, const std::string& group) {
  return {file.read<Index>(group + "/offsets"), file.read<Index>(group + "/values")};
}

void write_rows(NativeFile& file, const std::string& group, const Csr& rows) {
  file.create_group(group.c_str());
  file.write(group + "/offsets", rows.offsets);
  file.write(group + "/values", rows.values);
}

}  // namespace

PolyMesh read_native(const std::filesystem::path& path) {
  const QuietHdf5 quiet;
  const NativeFile file(path, NativeFile::Mode::read);
  if (const int found = file.read_attribute("polyslip_mesh_version"); found != version) {
    throw InputError(fmt::format("the format has version {}; this program reads version {}", found, version), path.string(),
                     "Write it again with this program or with a script of this version");
  }
  PolyMesh mesh;
  mesh.dim = file.read_attribute("dim");
  if (mesh.dim != 2 && mesh.dim != 3)
    throw InputError(fmt::format("attribute dim is {}; it must be 2 or 3", mesh.dim), path.string(), "Repair the file or write it again");
  mesh.nodes = file.read<Vec3>("/nodes");
  mesh.face_nodes = read_rows(file, "/face_nodes");
  mesh.cell_faces = read_rows(file, "/cell_faces");
  mesh.face_cells = file.read<std::array<Index, 2>>("/face_cells");
  mesh.cell_region = file.read<Index>("/cell_region");
  mesh.region_names = file.read_texts("/region_names");
  mesh.face_tag = file.read<Index>("/face_tag");
  mesh.tag_names = file.read_texts("/tag_names");
  const Checker check(file, mesh);
  check.topology();
  check.groups();
  if (file.has("/face_fracture")) {
    mesh.face_fracture = file.read<Index>("/face_fracture");
    mesh.fracture_names = file.read_texts("/fracture_names");
    mesh.fracture_length = file.read<double>("/fracture_length");
    mesh.face_tip_distance = file.read<double>("/face_tip_distance");
    check.fractures();
  }
  try {
    orient_faces(mesh);
  } catch (const InputError& error) {
    throw InputError(path.string() + ": " + error.what());
  }
  return mesh;
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
