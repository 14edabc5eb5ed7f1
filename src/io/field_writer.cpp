#include "polyslip/io/field_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <fstream>
#include <iterator>
#include <optional>
#include <span>

#include "polyslip/common/mpi.hpp"
#include "polyslip/io/atomic_file.hpp"
#include "polyslip/io/hdf5.hpp"

namespace polyslip::io {

namespace {

// Cell types in an XDMF "Mixed" topology; lines, polygons and polyhedra are followed by a count.
constexpr GlobalIndex xdmf_polyline = 2, xdmf_polygon = 3, xdmf_tetrahedron = 6, xdmf_hexahedron = 9, xdmf_polyhedron = 16;

/// What XDMF calls a grid: points and the stream of cells, this rank's rows of both.
struct Geometry {
  RowRange cell_rows, point_rows;
  std::vector<double> points;
  std::vector<GlobalIndex> topology;
};

RowRange owned_rows(const mesh::Numbering& numbering) {
  return {static_cast<hsize_t>(numbering.owned), static_cast<hsize_t>(numbering.first), static_cast<hsize_t>(numbering.total)};
}

/// Global copy that the cell sees at each of some nodes, appended to `out`.
template <class Nodes>
void append_copies(const mesh::DistributedMesh& part, Index cell, const Nodes& nodes, std::vector<GlobalIndex>& out) {
  const auto of_cell = part.mesh.cell_nodes[cell];
  const auto copies = part.mesh.copies_of(cell);
  for (const Index node : nodes) {
    const auto place = std::find(of_cell.begin(), of_cell.end(), node) - of_cell.begin();
    out.push_back(part.copies.global(copies[place]));
  }
}

/// Nodes of a 2D cell counter-clockwise: its edges, each turned to have the cell on its left, chained end to start.
std::vector<Index> polygon_nodes(const mesh::PolyMesh& mesh, Index cell) {
  std::vector<std::array<Index, 2>> edges;
  for (const Index face : mesh.cell_faces[cell]) {
    const auto ends = mesh.face_nodes[face];
    const bool left = mesh.orientation(cell, face) > 0;
    edges.push_back({ends[left ? 0 : 1], ends[left ? 1 : 0]});
  }
  std::vector<Index> nodes{edges.front()[0]};
  while (nodes.size() < edges.size()) {
    const auto next = std::find_if(edges.begin(), edges.end(), [&](const auto& edge) { return edge[0] == nodes.back(); });
    assert(next != edges.end());
    nodes.push_back((*next)[1]);
  }
  return nodes;
}

void append_polygon(const mesh::DistributedMesh& part, Index cell, std::vector<GlobalIndex>& out) {
  const std::vector<Index> nodes = polygon_nodes(part.mesh, cell);
  out.insert(out.end(), {xdmf_polygon, static_cast<GlobalIndex>(nodes.size())});
  append_copies(part, cell, nodes, out);
}

/// Nodes of the first face of a cell, turned so that its normal points into the cell, and room for others behind them.
template <std::size_t n>
std::array<Index, n> nodes_on_first_face(const mesh::PolyMesh& mesh, Index cell) {
  const Index face = mesh.cell_faces[cell][0];
  const auto base = mesh.face_nodes[face];
  std::array<Index, n> nodes;
  nodes.fill(-1);
  std::copy(base.begin(), base.end(), nodes.begin());
  if (mesh.orientation(cell, face) > 0) std::reverse(nodes.begin(), nodes.begin() + static_cast<std::ptrdiff_t>(base.size()));
  return nodes;
}

/// A triangle seen from the fourth node, and that one, as VTK and XDMF have them.
std::array<Index, 4> tetrahedron_nodes(const mesh::PolyMesh& mesh, Index cell) {
  auto nodes = nodes_on_first_face<4>(mesh, cell);
  for (const Index node : mesh.cell_nodes[cell])
    if (std::find(nodes.begin(), nodes.end(), node) == nodes.end()) nodes[3] = node;
  return nodes;
}

/// A quadrilateral seen from the others, and the nodes that edges lead to from its own, as VTK and XDMF have them; none for other polyhedra of
/// as many quadrilaterals and nodes.
std::optional<std::array<Index, 8>> hexahedron_nodes(const mesh::PolyMesh& mesh, Index cell) {
  auto nodes = nodes_on_first_face<8>(mesh, cell);
  const auto base = std::span(nodes).first<4>(), opposite = std::span(nodes).last<4>();
  for (const Index face : mesh.cell_faces[cell].subspan(1)) {
    const auto corners = mesh.face_nodes[face];
    for (std::size_t k = 0; k < 4; ++k) {
      const auto place = static_cast<std::size_t>(std::find(base.begin(), base.end(), corners[k]) - base.begin());
      for (const Index neighbour : {corners[(k + 1) % 4], corners[(k + 3) % 4]}) {
        if (place == base.size() || std::find(base.begin(), base.end(), neighbour) != base.end()) continue;
        if (opposite[place] != -1 && opposite[place] != neighbour) return {};
        opposite[place] = neighbour;
      }
    }
  }
  auto sorted = nodes;
  std::sort(sorted.begin(), sorted.end());
  if (sorted.front() == -1 || std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end()) return {};
  return nodes;
}

/// Faces are turned so that their normals point out of the cell.
void append_polyhedron(const mesh::DistributedMesh& part, Index cell, std::vector<GlobalIndex>& out) {
  const auto faces = part.mesh.cell_faces[cell];
  out.insert(out.end(), {xdmf_polyhedron, static_cast<GlobalIndex>(faces.size())});
  for (const Index face : faces) {
    const auto nodes = part.mesh.face_nodes[face];
    out.push_back(static_cast<GlobalIndex>(nodes.size()));
    append_copies(part, cell, nodes, out);
    if (part.mesh.orientation(cell, face) < 0) std::reverse(out.end() - static_cast<std::ptrdiff_t>(nodes.size()), out.end());
  }
}

/// Tetrahedra and hexahedra by their nodes: that is a quarter of what their faces take.
void append_solid(const mesh::DistributedMesh& part, Index cell, std::vector<GlobalIndex>& out) {
  const mesh::PolyMesh& mesh = part.mesh;
  const auto faces = mesh.cell_faces[cell];
  const auto consists_of = [&](std::size_t count, Index corners, Index nodes) {
    return faces.size() == count && mesh.cell_nodes.row_size(cell) == nodes &&
           std::all_of(faces.begin(), faces.end(), [&](Index face) { return mesh.face_nodes.row_size(face) == corners; });
  };
  if (consists_of(4, 3, 4)) {
    out.push_back(xdmf_tetrahedron);
    return append_copies(part, cell, tetrahedron_nodes(mesh, cell), out);
  }
  const auto nodes = consists_of(6, 4, 8) ? hexahedron_nodes(mesh, cell) : std::nullopt;
  if (!nodes) return append_polyhedron(part, cell, out);
  out.push_back(xdmf_hexahedron);
  append_copies(part, cell, *nodes, out);
}

Geometry matrix_geometry(const mesh::DistributedMesh& part) {
  Geometry geometry{owned_rows(part.cells), owned_rows(part.copies), {}, {}};
  for (Index copy = 0; copy < part.copies.owned; ++copy) {
    const Vec3& x = part.mesh.nodes[part.mesh.copy_node[copy]];
    geometry.points.insert(geometry.points.end(), x.begin(), x.end());
  }
  for (Index cell = 0; cell < part.cells.owned; ++cell) {
    (part.mesh.dim == 2 ? append_polygon : append_solid)(part, cell, geometry.topology);
  }
  return geometry;
}

/// Every face has corners of its own: fields on faces are constants.
Geometry fracture_geometry(const mesh::DistributedMesh& part) {
  Geometry geometry{owned_rows(part.fractures), {}, {}, {}};
  for (Index i = 0; i < part.fractures.owned; ++i) {
    for (const Index node : part.mesh.face_nodes[part.fracture_faces[i]]) {
      const Vec3& x = part.mesh.nodes[node];
      geometry.points.insert(geometry.points.end(), x.begin(), x.end());
    }
  }
  geometry.point_rows = RowRange::in_rank_order(part.comm, geometry.points.size() / 3);
  auto point = static_cast<GlobalIndex>(geometry.point_rows.first);
  for (Index i = 0; i < part.fractures.owned; ++i) {
    const Index corners = part.mesh.face_nodes.row_size(part.fracture_faces[i]);
    geometry.topology.insert(geometry.topology.end(), {part.mesh.dim == 2 ? xdmf_polyline : xdmf_polygon, corners});
    for (Index k = 0; k < corners; ++k) geometry.topology.push_back(point++);
  }
  return geometry;
}

const char* attribute_type(int components) {
  switch (components) {
    case 1:
      return "Scalar";
    case 3:
      return "Vector";
    default:
      return "Tensor";
  }
}

/// Symmetric tensors xx yy zz xy yz xz as full ones, row by row.
std::vector<double> full_tensors(std::span<const double> six, std::size_t count) {
  std::vector<double> nine;
  nine.reserve(9 * count);
  for (std::size_t i = 0; i < count; ++i) {
    for (const int c : {0, 3, 5, 3, 1, 4, 5, 4, 2}) nine.push_back(six[6 * i + static_cast<std::size_t>(c)]);
  }
  return nine;
}

/// The grids of single times in the text of an XDMF file, in order.
std::vector<std::string> grids_of(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::vector<std::string> grids;
  for (std::string line, grid; std::getline(in, line);) {
    if (line.find("GridType=\"Uniform\"") != std::string::npos) grid.clear();
    grid += line + "\n";
    if (line.starts_with("      </Grid>")) grids.push_back(grid);
  }
  return grids;
}

/// One pair of files, <name>.xdmf and <name>.h5.
class Series {
 public:
  Series(MPI_Comm comm, const std::filesystem::path& directory, const std::string& name, const Geometry& geometry,
         std::optional<double> kept_until)
      : comm_(comm), directory_(directory), name_(name), cell_rows_(geometry.cell_rows), point_rows_(geometry.point_rows) {
    stream_length_ = RowRange::in_rank_order(comm, geometry.topology.size()).total;
    if (kept_until && go_on(geometry, *kept_until)) return;
    steps_ = 0;
    grids_.clear();
    last_time_.reset();
    H5File file(comm, path(".h5"), H5File::Mode::create);
    write_geometry(file, geometry);
    file.create_group("/fields");
    file.flush();
  }

  [[nodiscard]] std::optional<double> last_time() const { return last_time_; }

  void write(double time, const std::vector<Field>& fields) {
    const std::string group = fmt::format("/fields/{}", steps_++);
    std::string attributes;
    {
      // Closed before the XDMF text names the new step: a reader, or a run killed in between, finds whole steps only.
      H5File file(comm_, path(".h5"), H5File::Mode::read_write);
      file.create_group(group);
      file.write_attribute(group, "time", time);
      for (const Field& field : fields) attributes += write_field(file, group, field);
      file.flush();
    }
    grids_ += fmt::format(
        "      <Grid Name=\"{0}\" GridType=\"Uniform\">\n"
        "        <Time Value=\"{1}\"/>\n"
        "        <Topology TopologyType=\"Mixed\" NumberOfElements=\"{2}\">{3}</Topology>\n"
        "        <Geometry GeometryType=\"XYZ\">{4}</Geometry>\n"
        "{5}"
        "      </Grid>\n",
        name_, time, cell_rows_.total, item(topology_, fmt::format("{}", stream_length_), "NumberType=\"Int\" Precision=\"4\""),
        item(points_, fmt::format("{} 3", point_rows_.total)), attributes);
    last_time_ = time;
    write_text();
  }

 private:
  /// Keeps the fields up to a time; false where the files of an earlier run are not there or not in order.
  bool go_on(const Geometry& geometry, double until) {
    std::vector<std::string> grids = read_grids();
    try {
      H5File file(comm_, path(".h5"), H5File::Mode::read_write);
      int levels = 0;
      for (; file.has(fmt::format("/fields/{}", levels)); ++levels) {
        const double time = file.read_attribute(fmt::format("/fields/{}", levels), "time");
        if (time > until || levels == static_cast<int>(grids.size())) break;
        last_time_ = time;
      }
      steps_ = levels;
      for (; file.has(fmt::format("/fields/{}", levels)); ++levels) file.remove(fmt::format("/fields/{}", levels));
      if (steps_ == 0) return false;
      grids.resize(static_cast<std::size_t>(steps_));
      for (const std::string& grid : grids) grids_ += grid;
      if (file.read_attribute("/", "ranks") != mpi::size(comm_)) write_new_geometry(file, geometry);
      file.flush();
    } catch (const std::runtime_error&) {
      return false;  // cut short by whatever ended the earlier run
    }
    write_text();
    return true;
  }

  /// The text of rank 0's file, on all ranks.
  [[nodiscard]] std::vector<std::string> read_grids() const {
    std::vector<std::string> grids;
    if (mpi::rank(comm_) == 0) grids = grids_of(path(".xdmf"));
    grids.resize(static_cast<std::size_t>(mpi::max(comm_, static_cast<long long>(grids.size()))));
    return grids;  // ranks but the first write no text
  }

  void write_geometry(H5File& file, const Geometry& geometry) {
    file.write(points_, point_rows_, 3, geometry.points);
    file.write(topology_, RowRange::in_rank_order(comm_, geometry.topology.size()), 1, geometry.topology);
    file.write_attribute("/", "ranks", mpi::size(comm_));
  }

  void write_new_geometry(H5File& file, const Geometry& geometry) {
    for (std::string* table : {&points_, &topology_}) {
      *table += fmt::format("_{}", steps_);
      if (file.has(*table)) file.remove(*table);
    }
    write_geometry(file, geometry);
  }

  /// Writes one table and returns its XDMF attribute.
  std::string write_field(H5File& file, const std::string& group, const Field& field) const {
    const RowRange& rows = field.on == Location::copy ? point_rows_ : cell_rows_;
    const int columns = field.components == 6 ? 9 : field.components;
    assert(columns == 1 || columns == 3 || columns == 9);
    const std::string table = group + "/" + field.name;
    if (field.components == 6) {
      file.write(table, rows, columns, full_tensors(field.values, rows.count));
    } else {
      file.write(table, rows, columns, field.values);
    }
    return fmt::format("        <Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"{}\">{}</Attribute>\n", field.name,
                       attribute_type(columns), field.on == Location::copy ? "Node" : "Cell",
                       item(table, columns == 1 ? fmt::format("{}", rows.total) : fmt::format("{} {}", rows.total, columns)));
  }

  [[nodiscard]] std::string item(const std::string& table, const std::string& dimensions,
                                 const char* number = "NumberType=\"Float\" Precision=\"8\"") const {
    return fmt::format("<DataItem Dimensions=\"{}\" {} Format=\"HDF\">{}.h5:{}</DataItem>", dimensions, number, name_, table);
  }

  void write_text() const {
    mpi::on_root(comm_, [&] {
      write_atomically(path(".xdmf"), fmt::format("<?xml version=\"1.0\"?>\n"
                                                  "<Xdmf Version=\"3.0\">\n"
                                                  "  <Domain>\n"
                                                  "    <Grid Name=\"{}\" GridType=\"Collection\" CollectionType=\"Temporal\">\n"
                                                  "{}"
                                                  "    </Grid>\n"
                                                  "  </Domain>\n"
                                                  "</Xdmf>\n",
                                                  name_, grids_));
    });
  }

  [[nodiscard]] std::filesystem::path path(const char* ending) const { return directory_ / (name_ + ending); }

  MPI_Comm comm_;
  std::filesystem::path directory_;
  std::string name_;
  RowRange cell_rows_, point_rows_;
  hsize_t stream_length_ = 0;
  std::string points_ = "/points", topology_ = "/topology";
  int steps_ = 0;
  std::string grids_;  ///< XDMF text of the steps written so far; of rank 0.
  std::optional<double> last_time_;
};

}  // namespace

struct FieldWriter::Files {
  Series matrix;
  std::optional<Series> fractures;
};

FieldWriter::FieldWriter(const mesh::DistributedMesh& mesh, const std::filesystem::path& directory,
                         std::optional<double> kept_until) {
  mpi::on_root(mesh.comm, [&] {
    std::filesystem::create_directories(directory);
    if (!kept_until) std::filesystem::remove(directory / "matrix.xdmf");
    if (!kept_until || mesh.fractures.total == 0)
      for (const char* file : {"fractures.xdmf", "fractures.h5"}) std::filesystem::remove(directory / file);
  });
  files_ = std::make_unique<Files>(Files{Series(mesh.comm, directory, "matrix", matrix_geometry(mesh), kept_until), std::nullopt});
  if (mesh.fractures.total > 0) files_->fractures.emplace(mesh.comm, directory, "fractures", fracture_geometry(mesh), kept_until);
}

std::optional<double> FieldWriter::last_time() const { return files_->matrix.last_time(); }

FieldWriter::~FieldWriter() = default;

void FieldWriter::write(double time, const std::vector<Field>& fields) {
  std::vector<Field> in_matrix, on_fractures;
  std::ranges::partition_copy(fields, std::back_inserter(on_fractures), std::back_inserter(in_matrix),
                              [](const Field& field) { return field.on == Location::fracture_face; });
  files_->matrix.write(time, in_matrix);
  if (files_->fractures) files_->fractures->write(time, on_fractures);
}

}  // namespace polyslip::io
