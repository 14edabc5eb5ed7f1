// Files for ParaView, read back: geometry of the cells written, order of values, jumps at copies, state after every write.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <fstream>
#include <regex>
#include <sstream>

#include "polyslip/common/error.hpp"
#include "polyslip/io/field_writer.hpp"
#include "polyslip/io/hdf5.hpp"
#include "polyslip/mesh/generators.hpp"
#include "support/boxes.hpp"
#include "temporary_directory.hpp"
#include "unit/mesh/grid.hpp"

namespace polyslip {
namespace {

using test::TemporaryDirectory;

/// All rows of a table, on every rank.
io::RowRange all_rows(const io::H5File& file, const std::string& table) {
  const auto rows = file.shape(table).first;
  return {rows, 0, rows};
}

/// A grid as a reader of the XDMF file sees it: the corners of the faces of each cell (of the cell itself in 2D), and a list of
/// points.
struct Grid {
  std::vector<Vec3> points;
  std::vector<std::vector<std::vector<GlobalIndex>>> cells;

  [[nodiscard]] std::vector<GlobalIndex> corners(std::size_t cell) const {
    std::vector<GlobalIndex> all;
    for (const auto& face : cells[cell]) all.insert(all.end(), face.begin(), face.end());
    return all;
  }
  [[nodiscard]] Vec3 centre(std::size_t cell) const {
    Vec3 sum = Vec3::Zero();
    for (const GlobalIndex p : corners(cell)) sum += points[p];
    return sum / static_cast<double>(corners(cell).size());
  }
  /// Twice the area vector of a planar polygon.
  [[nodiscard]] Vec3 area_vector(const std::vector<GlobalIndex>& polygon) const {
    Vec3 sum = Vec3::Zero();
    for (std::size_t k = 0; k < polygon.size(); ++k) sum += points[polygon[k]].cross(points[polygon[(k + 1) % polygon.size()]]);
    return sum;
  }
  /// Area (2D, counter-clockwise positive) or volume (3D, outward normals positive).
  [[nodiscard]] double measure(std::size_t cell, int dim) const {
    if (dim == 2) return area_vector(cells[cell][0])[2] / 2;
    double sum = 0;
    for (const auto& face : cells[cell]) sum += points[face[0]].dot(area_vector(face)) / 6;
    return sum;
  }
};

// Faces of VTK's cells by their nodes, normals outward.
using Faces = std::vector<std::vector<GlobalIndex>>;
const Faces faces_of_tetrahedron{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
const Faces faces_of_hexahedron{{0, 4, 7, 3}, {1, 2, 6, 5}, {0, 1, 5, 4}, {3, 7, 6, 2}, {0, 3, 2, 1}, {4, 5, 6, 7}};

void append_faces(const Faces& faces, const GlobalIndex* nodes, Faces& to) {
  for (const auto& face : faces) {
    auto& corners = to.emplace_back();
    for (GlobalIndex k : face) corners.push_back(nodes[k]);
  }
}

Grid read_grid(const std::filesystem::path& path) {
  const io::H5File file(PETSC_COMM_WORLD, path, io::H5File::Mode::read);
  const auto coordinates = file.read_doubles("/points", all_rows(file, "/points"));
  const auto stream = file.read_integers("/topology", all_rows(file, "/topology"));
  Grid grid;
  for (std::size_t i = 0; i < coordinates.size(); i += 3) {
    grid.points.emplace_back(coordinates[i], coordinates[i + 1], coordinates[i + 2]);
  }
  for (std::size_t at = 0; at < stream.size();) {
    const GlobalIndex type = stream[at++];
    EXPECT_TRUE(type == 2 || type == 3 || type == 6 || type == 9 || type == 16) << type;
    if (type == 6 || type == 9) {
      append_faces(type == 6 ? faces_of_tetrahedron : faces_of_hexahedron, &stream[at], grid.cells.emplace_back());
      at += type == 6 ? 4 : 8;
      continue;
    }
    const GlobalIndex faces = type == 16 ? stream[at++] : 1;
    auto& cell = grid.cells.emplace_back();
    for (GlobalIndex f = 0; f < faces; ++f) {
      const GlobalIndex corners = stream[at++];
      cell.emplace_back(stream.begin() + static_cast<long>(at), stream.begin() + static_cast<long>(at) + corners);
      at += static_cast<std::size_t>(corners);
    }
  }
  return grid;
}

std::vector<double> read_field(const std::filesystem::path& path, const std::string& table) {
  const io::H5File file(PETSC_COMM_WORLD, path, io::H5File::Mode::read);
  return file.read_doubles(table, all_rows(file, table));
}

std::string content(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

/// Cells dealt out like cards, so that every cell has neighbours on other ranks.
mesh::DistributedMesh scattered(int dim, const mesh::FractureMark& marked = {}) {
  auto serial = mesh::grid(dim, {4, 4, 2}, marked);
  std::vector<Index> part(static_cast<std::size_t>(serial.n_cells()));
  for (std::size_t c = 0; c < part.size(); ++c) part[c] = static_cast<Index>(c) % mpi::size(PETSC_COMM_WORLD);
  return mesh::distribute(PETSC_COMM_WORLD, std::move(serial), part);
}

mesh::DistributedMesh all_on_last_rank(int dim, const mesh::FractureMark& marked = {}) {
  auto serial = mesh::grid(dim, {4, 4, 2}, marked);
  const std::vector<Index> part(static_cast<std::size_t>(serial.n_cells()), mpi::size(PETSC_COMM_WORLD) - 1);
  return mesh::distribute(PETSC_COMM_WORLD, std::move(serial), part);
}

Vec3 grid_centre(int dim, GlobalIndex cell) {
  return {(cell % 4 + 0.5) / 4, (cell / 4 % 4 + 0.5) / 4, dim == 3 ? (cell / 16 + 0.5) / 2 : 0.0};
}

/// 1 right of the plane x = 1/2, 0 left of it.
double side(const Vec3& x) { return x[0] > 0.5 ? 1 : 0; }

bool middle_plane(const Vec3& x, int axis) { return axis == 0 && std::abs(x[0] - 0.5) < 1e-9; }

class field_writer : public ::testing::TestWithParam<int> {
 protected:
  int dim() const { return GetParam(); }
  TemporaryDirectory directory_;
  std::filesystem::path matrix_ = directory_.path() / "matrix.h5", fractures_ = directory_.path() / "fractures.h5";
};
INSTANTIATE_TEST_SUITE_P(dimension, field_writer, ::testing::Values(2, 3));

TEST_P(field_writer, cells_have_their_volumes_and_outward_faces) {
  const auto part = scattered(dim(), mesh::crossing());
  io::FieldWriter writer(part, directory_.path());
  const Grid grid = read_grid(matrix_);
  ASSERT_EQ(static_cast<GlobalIndex>(grid.cells.size()), part.cells.total);
  ASSERT_EQ(static_cast<GlobalIndex>(grid.points.size()), part.copies.total);
  for (std::size_t c = 0; c < grid.cells.size(); ++c) EXPECT_NEAR(grid.measure(c, dim()), dim() == 2 ? 1.0 / 16 : 1.0 / 32, 1e-14);
}

TEST(solids, have_their_volumes_and_outward_faces_whatever_they_are_written_as) {
  for (const auto& [shape, numbers] : {std::pair("hexahedra", 9), {"tets", 5}, {"prisms", 0}, {"polyhedra", 0}, {"cut", 0}}) {
    SCOPED_TRACE(shape);
    const TemporaryDirectory directory;
    auto serial = mesh::make_box(tests::unit_box({3, shape}, 3));
    mesh::build_copies(serial);
    const auto part = mesh::distribute(PETSC_COMM_WORLD, std::move(serial));
    const io::FieldWriter writer(part, directory.path());
    const Grid grid = read_grid(directory.path() / "matrix.h5");
    double sum = 0;
    for (std::size_t c = 0; c < grid.cells.size(); ++c) {
      sum += grid.measure(c, 3);
      EXPECT_GT(grid.measure(c, 3), 0) << c;
    }
    EXPECT_NEAR(sum, 1, 1e-13);
    const io::H5File file(PETSC_COMM_WORLD, directory.path() / "matrix.h5", io::H5File::Mode::read);
    if (numbers > 0) {
      EXPECT_EQ(static_cast<GlobalIndex>(all_rows(file, "/topology").total), numbers * part.cells.total);
    }
  }
}

TEST_P(field_writer, cell_values_stay_with_their_cells) {
  const auto part = scattered(dim());
  const std::vector<double> input(part.cell_input.begin(), part.cell_input.end());
  io::FieldWriter(part, directory_.path()).write(0, {{"input", io::Location::cell, 1, input}});
  const Grid grid = read_grid(matrix_);
  const auto written = read_field(matrix_, "/fields/0/input");
  ASSERT_EQ(written.size(), grid.cells.size());
  for (std::size_t c = 0; c < written.size(); ++c) {
    EXPECT_NEAR((grid.centre(c) - grid_centre(dim(), static_cast<GlobalIndex>(written[c]))).norm(), 0, 1e-14);
  }
}

TEST_P(field_writer, point_values_jump_across_a_fracture_only) {
  const auto part = scattered(dim(), middle_plane);
  std::vector<double> displacement(3 * static_cast<std::size_t>(part.mesh.n_copies()));
  for (Index c = 0; c < part.mesh.n_cells(); ++c) {
    for (const Index copy : part.mesh.copies_of(c)) displacement[3 * copy] = side(grid_centre(dim(), part.cell_input[c]));
  }
  io::FieldWriter(part, directory_.path()).write(0, {{"displacement", io::Location::copy, 3, displacement}});
  const Grid grid = read_grid(matrix_);
  const auto written = read_field(matrix_, "/fields/0/displacement");
  ASSERT_EQ(written.size(), 3 * grid.points.size());
  for (std::size_t c = 0; c < grid.cells.size(); ++c) {
    for (const GlobalIndex point : grid.corners(c)) EXPECT_EQ(written[3 * point], side(grid.centre(c)));
  }
}

TEST_P(field_writer, fracture_faces_lie_in_place_with_their_values_and_point_out_of_the_plus_side) {
  const auto part = scattered(dim(), mesh::crossing());
  std::vector<double> centres;
  for (const Index face : part.fracture_faces) {
    Vec3 x = Vec3::Zero();
    for (const Index node : part.mesh.face_nodes[face]) x += part.mesh.nodes[node] / double(part.mesh.face_nodes.row_size(face));
    centres.insert(centres.end(), x.begin(), x.end());
  }
  io::FieldWriter(part, directory_.path()).write(0, {{"centre", io::Location::fracture_face, 3, centres}});
  const Grid grid = read_grid(fractures_);
  const auto written = read_field(fractures_, "/fields/0/centre");
  ASSERT_EQ(static_cast<GlobalIndex>(grid.cells.size()), part.fractures.total);
  for (std::size_t f = 0; f < grid.cells.size(); ++f) {
    EXPECT_NEAR((grid.centre(f) - Vec3(written[3 * f], written[3 * f + 1], written[3 * f + 2])).norm(), 0, 1e-14);
    const auto& corners = grid.cells[f][0];  // + is the side of lower x or y in these grids
    const Vec3 t = grid.points[corners.back()] - grid.points[corners.front()];
    const Vec3 normal = dim() == 2 ? Vec3(t[1], -t[0], 0) : grid.area_vector(corners);
    EXPECT_GT(normal.sum(), 0.1);
  }
}

TEST_P(field_writer, the_text_names_every_step_and_nothing_that_is_not_there) {
  const auto part = scattered(dim(), middle_plane);
  const std::vector<double> stress(9 * static_cast<std::size_t>(part.cells.owned), 1.0);
  const std::vector<double> aperture(static_cast<std::size_t>(part.fractures.owned), 1.0);
  io::FieldWriter writer(part, directory_.path());
  for (int step = 0; step < 3; ++step) {
    writer.write(0.1 * step, {{"stress", io::Location::cell, 9, stress}, {"aperture", io::Location::fracture_face, 1, aperture}});
    for (const std::string name : {"matrix", "fractures"}) {
      const std::string text = content(directory_.path() / (name + ".xdmf"));
      const io::H5File file(PETSC_COMM_WORLD, directory_.path() / (name + ".h5"), io::H5File::Mode::read);
      EXPECT_EQ(file.read_attribute("/fields/" + std::to_string(step), "time"), 0.1 * step);
      EXPECT_NE(text.find("<Time Value=\"" + std::string(step == 0 ? "0" : step == 1 ? "0.1" : "0.2") + "\"/>"), std::string::npos);
      const std::regex item("Dimensions=\"(\\d+)( \\d+)?\"[^>]*>" + name + ".h5:([^<]*)<");
      int items = 0;
      for (auto it = std::sregex_iterator(text.begin(), text.end(), item); it != std::sregex_iterator(); ++it, ++items) {
        const auto [rows, columns] = file.shape((*it)[3]);
        EXPECT_EQ(rows, std::stoull((*it)[1])) << (*it)[3];
        EXPECT_EQ(columns, (*it)[2].matched ? std::stoi((*it)[2]) : 1) << (*it)[3];
      }
      EXPECT_EQ(items, 3 * (step + 1)) << name;
    }
  }
}

TEST_P(field_writer, symmetric_tensors_become_full_ones) {
  const auto part = scattered(dim());
  std::vector<double> stress;
  for (Index c = 0; c < part.cells.owned; ++c) stress.insert(stress.end(), {11, 22, 33, 12, 23, 13});
  io::FieldWriter(part, directory_.path()).write(0, {{"stress", io::Location::cell, 6, stress}});
  const auto written = read_field(matrix_, "/fields/0/stress");
  ASSERT_EQ(static_cast<GlobalIndex>(written.size()), 9 * part.cells.total);
  const std::vector<double> full{11, 12, 13, 12, 22, 23, 13, 23, 33};
  for (std::size_t i = 0; i < written.size(); ++i) EXPECT_EQ(written[i], full[i % 9]);
}

TEST_P(field_writer, ranks_without_cells_take_part) {
  const auto part = all_on_last_rank(dim(), middle_plane);
  const std::vector<double> ones(static_cast<std::size_t>(part.cells.owned), 1.0);
  const std::vector<double> twos(static_cast<std::size_t>(part.fractures.owned), 2.0);
  io::FieldWriter(part, directory_.path())
      .write(0, {{"one", io::Location::cell, 1, ones}, {"two", io::Location::fracture_face, 1, twos}});
  EXPECT_EQ(read_grid(matrix_).cells.size(), dim() == 2 ? 16U : 32U);
  EXPECT_EQ(read_field(matrix_, "/fields/0/one"), std::vector<double>(dim() == 2 ? 16 : 32, 1.0));
  EXPECT_EQ(read_field(fractures_, "/fields/0/two"), std::vector<double>(dim() == 2 ? 4 : 8, 2.0));
}

TEST_P(field_writer, a_mesh_without_fractures_leaves_no_fracture_files_not_even_old_ones) {
  const auto fractured = scattered(dim(), middle_plane);
  io::FieldWriter(fractured, directory_.path()).write(0, {});
  EXPECT_TRUE(std::filesystem::exists(directory_.path() / "fractures.xdmf"));
  const auto whole = scattered(dim());
  io::FieldWriter(whole, directory_.path()).write(0, {});
  EXPECT_TRUE(std::filesystem::exists(directory_.path() / "matrix.xdmf"));
  EXPECT_FALSE(std::filesystem::exists(directory_.path() / "fractures.xdmf"));
  EXPECT_FALSE(std::filesystem::exists(fractures_));
}

TEST(hdf5, a_missing_file_is_named) {
  try {
    const io::H5File file(PETSC_COMM_WORLD, "/nowhere/at/all/matrix.h5", io::H5File::Mode::read);
    FAIL() << "no exception";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("/nowhere/at/all/matrix.h5: HDF5 cannot open the file"), std::string::npos) << e.what();
  }
}

TEST(hdf5, a_missing_table_and_a_wrong_row_count_are_named) {
  const TemporaryDirectory directory;
  const auto rows = io::RowRange::in_rank_order(PETSC_COMM_WORLD, 2);
  io::H5File file(PETSC_COMM_WORLD, directory.path() / "a.h5", io::H5File::Mode::create);
  file.write("/here", rows, 2, std::vector<double>{1, 2, 3, 4});
  EXPECT_TRUE(file.has("/here"));
  EXPECT_FALSE(file.has("/there"));
  EXPECT_EQ(file.read_doubles("/here", rows), (std::vector<double>{1, 2, 3, 4}));
  EXPECT_THROW((void)file.read_doubles("/there", rows), std::runtime_error);
  EXPECT_THROW((void)file.read_doubles("/here", {2, rows.first, rows.total + 1}), std::runtime_error);
}

TEST(hdf5, no_identifier_is_left_open) {
  const TemporaryDirectory directory;
  const auto part = scattered(3, middle_plane);
  const std::vector<double> ones(static_cast<std::size_t>(part.cells.owned), 1.0);
  const auto before = H5Fget_obj_count(H5F_OBJ_ALL, H5F_OBJ_ALL);
  io::FieldWriter writer(part, directory.path());
  writer.write(0, {{"one", io::Location::cell, 1, ones}});
  (void)read_grid(directory.path() / "matrix.h5");
  EXPECT_EQ(H5Fget_obj_count(H5F_OBJ_ALL, H5F_OBJ_ALL), before);
}

}  // namespace
}  // namespace polyslip
