// Meshes from files: what is read is what was written, and what cannot be read is refused in words.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <mpi.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <map>
#include <set>

#include "polyslip/common/error.hpp"
#include "polyslip/mesh/generators.hpp"
#include "polyslip/mesh/readers.hpp"
#include "unit/mesh/grid.hpp"

namespace polyslip::mesh {
namespace {

namespace fs = std::filesystem;

/// A folder of this process, gone at the end of the test.
class Readers : public ::testing::Test {
 protected:
  Readers() : folder_(fs::temp_directory_path() / ("polyslip_readers_" + std::to_string(getpid()))) {
    fs::create_directories(folder_);
  }
  ~Readers() override { fs::remove_all(folder_); }

  [[nodiscard]] fs::path at(const std::string& name) const { return folder_ / name; }
  fs::path text_file(const std::string& name, const std::string& text) const {
    std::ofstream(at(name), std::ios::binary) << text;
    return at(name);
  }
  /// The refusal of a file; fails the test if it is read.
  static std::string refusal(const fs::path& file) {
    try {
      read_mesh(file);
    } catch (const InputError& error) {
      return error.what();
    }
    ADD_FAILURE() << file << " was read";
    return "";
  }

 private:
  fs::path folder_;
};

void expect_contains(const std::string& text, const std::vector<std::string>& parts) {
  for (const auto& part : parts) EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is not in: " << text;
}

void expect_equal(const PolyMesh& a, const PolyMesh& b) {
  EXPECT_EQ(a.dim, b.dim);
  EXPECT_EQ(a.nodes, b.nodes);
  EXPECT_EQ(a.face_nodes.offsets, b.face_nodes.offsets);
  EXPECT_EQ(a.face_nodes.values, b.face_nodes.values);
  EXPECT_EQ(a.cell_faces.offsets, b.cell_faces.offsets);
  EXPECT_EQ(a.cell_faces.values, b.cell_faces.values);
  EXPECT_EQ(a.face_cells, b.face_cells);
  EXPECT_EQ(a.cell_region, b.cell_region);
  EXPECT_EQ(a.region_names, b.region_names);
  EXPECT_EQ(a.face_tag, b.face_tag);
  EXPECT_EQ(a.tag_names, b.tag_names);
  EXPECT_EQ(a.face_fracture, b.face_fracture);
  EXPECT_EQ(a.fracture_names, b.fracture_names);
  EXPECT_EQ(a.fracture_length, b.fracture_length);
  EXPECT_EQ(a.face_tip_distance, b.face_tip_distance);
}

std::map<std::string, int> tagged(const PolyMesh& mesh) {
  std::map<std::string, int> count;
  for (const Index tag : mesh.face_tag) {
    if (tag >= 0) ++count[mesh.tag_names[tag]];
  }
  return count;
}

std::map<std::string, int> in_regions(const PolyMesh& mesh) {
  std::map<std::string, int> count;
  for (const Index region : mesh.cell_region) ++count[mesh.region_names[region]];
  return count;
}

// ---- native format

TEST_F(Readers, native_round_trip_is_exact) {
  BoxSpec box;
  box.cells = {3, 3, 3};
  box.max = {1, 1, 1};
  box.shape = "polyhedra";
  int i = 0;
  for (const PolyMesh& mesh : {grid(2, {5, 4, 0}), grid(2, {8, 6, 0}, crossing()), grid(3, {4, 4, 3}, crossing()), make_box(box)}) {
    const auto file = at("mesh" + std::to_string(i++) + ".h5");
    write_native(mesh, file);
    expect_equal(read_mesh(file), mesh);
  }
}

TEST_F(Readers, native_reading_turns_faces_out_of_their_first_cell) {
  PolyMesh mesh = grid(3, {2, 2, 2});
  const PolyMesh original = mesh;
  for (Index face = 0; face < mesh.n_faces(); face += 2) {
    const auto nodes = mesh.face_nodes[face];
    std::reverse(nodes.begin(), nodes.end());
  }
  write_native(mesh, at("turned.h5"));
  EXPECT_EQ(read_mesh(at("turned.h5")).face_nodes.values, original.face_nodes.values);
}

/// Each change must be refused with words that name the file and the dataset.
TEST_F(Readers, native_files_with_inconsistent_tables_are_refused_by_name) {
  using Change = std::function<void(PolyMesh&)>;
  const std::vector<std::pair<std::string, Change>> changes{
      {"/nodes", [](PolyMesh& m) { m.nodes[3][1] = std::nan(""); }},
      {"/nodes", [](PolyMesh& m) { m.nodes.push_back(m.nodes[3]); }},
      {"/face_nodes/offsets", [](PolyMesh& m) { m.face_nodes.offsets[2] = 99999; }},
      {"/face_nodes/offsets", [](PolyMesh& m) { m.face_nodes.offsets.back() += 1; }},
      {"/face_nodes/values", [](PolyMesh& m) { m.face_nodes.values[5] = m.n_nodes(); }},
      {"/face_nodes/values", [](PolyMesh& m) { m.face_nodes.values[5] = -1; }},
      {"/cell_faces/values", [](PolyMesh& m) { m.cell_faces.values[1] = m.cell_faces.values[0]; }},
      {"/cell_faces/offsets", [](PolyMesh& m) { m.cell_faces.offsets[1] = 1; }},
      {"/face_cells", [](PolyMesh& m) { m.face_cells.pop_back(); }},
      {"/face_cells",
       [](PolyMesh& m) {
         m.face_cells[0] = {-1, 0};
       }},
      {"/cell_region", [](PolyMesh& m) { m.cell_region[0] = 2; }},
      {"/cell_region", [](PolyMesh& m) { m.cell_region.clear(); }},
      {"/face_tag", [](PolyMesh& m) { m.face_tag[0] = -2; }},
      {"/face_fracture", [](PolyMesh& m) { m.face_fracture[0] = 0; }},
      {"/fracture_length", [](PolyMesh& m) { m.fracture_length[0] = 0; }},
      {"/face_tip_distance", [](PolyMesh& m) { m.face_tip_distance[4] = std::nan(""); }},
  };
  for (const auto& [dataset, change] : changes) {
    SCOPED_TRACE(dataset);
    PolyMesh mesh = grid(3, {2, 2, 2}, [](const Vec3&, int axis) { return axis == 0; });
    change(mesh);
    write_native(mesh, at("bad.h5"));
    expect_contains(refusal(at("bad.h5")), {"bad.h5", "dataset " + dataset});
  }
}

TEST_F(Readers, native_files_that_are_cut_or_of_another_kind_are_refused) {
  write_native(grid(2, {4, 4, 0}), at("whole.h5"));
  std::ifstream in(at("whole.h5"), std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(in), {});
  for (const std::size_t size : {std::size_t{0}, bytes.size() / 3, bytes.size() - 100}) {
    expect_contains(refusal(text_file("cut.h5", bytes.substr(0, size))), {"cut.h5"});
  }
  const hid_t other = H5Fcreate(at("other.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  H5Fclose(other);
  expect_contains(refusal(at("other.h5")), {"other.h5", "polyslip_mesh_version"});
  expect_contains(refusal(at("absent.h5")), {"absent.h5", "no such file"});
  EXPECT_THROW(write_native(grid(2, {2, 2, 0}), at("no_folder") / "mesh.h5"), InputError);
}

// ---- Gmsh

/// Unit square of two triangles and, to its right, one quadrilateral; the edge between is group 7, the left side group 8.
const std::string square_22 = R"($MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
1 7 "the fault"
2 3 "soft rock"
$EndPhysicalNames
$Nodes
6
1 0 0 0
2 1 0 0
13 1 1 0
4 0 1 0
5 2 0 0
6 2 1 0
$EndNodes
$Elements
5
1 1 2 7 1 2 13
2 1 2 8 2 4 1
3 2 2 3 1 1 2 13
4 2 2 3 1 13 1 4
5 3 2 0 2 2 5 6 13
$EndElements
)";

TEST_F(Readers, gmsh_22_gives_groups_by_name_or_number_and_mixed_cells) {
  const PolyMesh mesh = read_mesh(text_file("square.msh", square_22));
  EXPECT_EQ(mesh.dim, 2);
  EXPECT_EQ(mesh.n_nodes(), 6);
  EXPECT_EQ(mesh.n_faces(), 8);
  EXPECT_EQ(in_regions(mesh), (std::map<std::string, int>{{"soft rock", 2}, {"rock", 1}}));
  EXPECT_EQ(tagged(mesh), (std::map<std::string, int>{{"the fault", 1}, {"1:8", 1}, {"right", 1}, {"bottom", 2}, {"top", 2}}));
  for (Index face = 0; face < mesh.n_faces(); ++face) {
    const Index tag = mesh.face_tag[face];
    EXPECT_TRUE(tag < 0 || mesh.tag_names[tag] != "the fault" || !mesh.on_boundary(face));
  }
}

/// A pyramid on a hexahedron, a prism and a tetrahedron beside it: every shape, conforming.
const std::string mixed_41 = R"($MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
2 1 "fracture"
3 5 "block"
$EndPhysicalNames
$Entities
0 0 1 2
1 0 0 1 1 1 1 1 1 0
1 0 0 0 1 1 2 1 5 0
2 1 0 0 2 1 2 0 0
$EndEntities
$Nodes
1 12 1 12
3 1 0 12
1
2
3
4
5
6
7
8
9
10
11
12
0 0 0
1 0 0
1 1 0
0 1 0
0 0 1
1 0 1
1 1 1
0 1 1
0.5 0.5 2
2 0 0
2 0 1
2 1 2
$EndNodes
$Elements
5 5 1 5
2 1 3 1
1 5 6 7 8
3 1 5 1
2 1 2 3 4 5 6 7 8
3 1 7 1
3 5 6 7 8 9
3 2 6 1
4 2 10 3 6 11 7
3 2 4 1
5 6 11 7 12
$EndElements
)";

TEST_F(Readers, gmsh_41_gives_every_shape_with_closed_cells) {
  const PolyMesh mesh = read_mesh(text_file("mixed.msh", mixed_41));
  EXPECT_EQ(mesh.dim, 3);
  EXPECT_EQ(mesh.n_cells(), 4);
  std::multiset<Index> faces;
  for (Index cell = 0; cell < 4; ++cell) faces.insert(mesh.cell_faces.row_size(cell));
  EXPECT_EQ(faces, (std::multiset<Index>{4, 5, 5, 6}));
  EXPECT_EQ(in_regions(mesh), (std::map<std::string, int>{{"block", 2}, {"rock", 2}}));
  EXPECT_EQ(tagged(mesh).at("fracture"), 1);
  EXPECT_EQ(std::count_if(mesh.face_cells.begin(), mesh.face_cells.end(), [](auto& sides) { return sides[1] >= 0; }), 3);
}

TEST_F(Readers, gmsh_cells_are_numbered_so_that_neighbours_are_near) {
  constexpr int n = 97;  // quadrilaterals in a row, which the file has in another order
  std::string text = fmt::format("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", 2 * (n + 1));
  for (int i = 0; i <= n; ++i) text += fmt::format("{} {} 0 0\n{} {} 1 0\n", 2 * i + 1, i, 2 * i + 2, i);
  text += fmt::format("$EndNodes\n$Elements\n{}\n", n);
  for (int k = 0; k < n; ++k) {
    const int first = 2 * (31 * k % n) + 1;
    text += fmt::format("{} 3 2 0 1 {} {} {} {}\n", k + 1, first, first + 2, first + 3, first + 1);
  }
  const PolyMesh mesh = read_mesh(text_file("row.msh", text + "$EndElements\n"));
  ASSERT_EQ(mesh.n_cells(), n);
  for (const auto& [first, second] : mesh.face_cells) {
    if (second < 0) continue;
    EXPECT_EQ(std::abs(first - second), 1);
  }
  for (Index cell = 0; cell < n; ++cell)
    for (const Index face : mesh.cell_faces[cell])
      for (const Index node : mesh.face_nodes[face]) EXPECT_LE(std::abs(node - 2 * cell), 4);
}

TEST_F(Readers, gmsh_periodic_nodes_stay_apart) {
  const auto file = text_file("periodic.msh", square_22 + "$Periodic\n1\n0 4 1\n1\n4 1\n$EndPeriodic\n");
  EXPECT_EQ(read_mesh(file).n_nodes(), 6);
}

std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const auto at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), by);
}

TEST_F(Readers, gmsh_files_that_make_no_mesh_are_refused) {
  expect_contains(refusal(text_file("cut.msh", square_22.substr(0, 200))), {"cut.msh", "section $Elements"});
  expect_contains(refusal(text_file("empty.msh", "")), {"empty.msh"});
  expect_contains(refusal(text_file("words.msh", "this is\nnot a mesh\n")), {"words.msh", "$MeshFormat"});
  expect_contains(refusal(text_file("up.msh", replaced(square_22, "2 0 0\n", "2 0 0.5\n"))), {"up.msh", "z = 0.5"});
  expect_contains(refusal(text_file("nan.msh", replaced(square_22, "2 0 0\n", "nan 0 0\n"))), {"nan.msh: node 4 is at (nan, 0, 0)"});
  expect_contains(refusal(text_file("flat.msh", replaced(square_22, "4 0 1 0\n", "4 0.5 0.5 0\n"))), {"flat.msh", "volume"});
  expect_contains(refusal(text_file("mesh.vtk", "x")), {"mesh.vtk", ".msh"});
}

struct Change {
  std::string what, by, words;  ///< Replace `what` by `by` and the refusal has these words.
};

TEST_F(Readers, gmsh_22_files_with_wrong_numbers_are_refused) {
  const std::string quadrilateral = "5 3 2 0 2 2 5 6 13";
  const std::vector<Change> changes{
      {quadrilateral, "5 3 2 0 2 2 5 6 14", "$Elements, element 5: node 14 does not exist"},
      {quadrilateral, "5 3 2 0 2 2 5 6 -1", "$Elements, element 5: node -1 does not exist"},
      {quadrilateral, "5 3 2 0 2 2 5 6 x", "$Elements, element 5: 'x' is not an integer"},
      {quadrilateral, "5 9 2 0 2 2 5 6 13", "$Elements, element 5: element type 9"},
      {quadrilateral, "5 3 9999 0 2 2 5 6 13", "$Elements, element 5: it announces 9999"},
      {"$Nodes\n6", "$Nodes\n-6", "$Nodes: it announces -6"},
      {"$Nodes\n6", "$Nodes\n2000000000", "$Nodes: it announces 2000000000"},
      {"$Elements\n5", "$Elements\n4", "$Elements, element 4: '5' stands where $EndElements should"},
      {"\n13 1 1 0", "\n2 1 1 0", "$Nodes: the number 2 is given twice"},
      {"\n13 1 1 0", "\n1999999999 1 1 0", "$Nodes: the numbers run from 1 to 1999999999"},
  };
  for (const auto& [what, by, words] : changes) {
    SCOPED_TRACE(by);
    expect_contains(refusal(text_file("wrong.msh", replaced(square_22, what, by))), {"wrong.msh", words});
  }
}

TEST_F(Readers, gmsh_41_files_with_wrong_numbers_are_refused) {
  const std::vector<Change> changes{
      {"4 2 10 3 6 11 7", "4 2 10 3 6 11 13", "$Elements, element 4: node 13 does not exist"},
      {"1 12 1 12", "1 12 1 5", "$Nodes: node 6 is outside the range 1 to 5"},
      {"1 12 1 12", "1 11 1 12", "$Nodes: 11 nodes are announced and 12 given"},
      {"5 5 1 5", "5 6 1 5", "6 elements are announced and 5 given"},
      {"3 2 6 1", "3 2 6 1000000", "it announces 1000000"},
      {"3 2 6 1", "7 2 6 1", "entity 2 of dimension 7 is not in $Entities"},
      {"3 2 6 1", "3 9 6 1", "entity 9 of dimension 3 is not in $Entities"},
      {"0 0 1 2\n1", "0 0 1 -2\n1", "$Entities: it announces -2"},
      {"$Entities", "$Entity", "$Entities: it is missing"},
  };
  for (const auto& [what, by, words] : changes) {
    SCOPED_TRACE(by);
    expect_contains(refusal(text_file("wrong.msh", replaced(mixed_41, what, by))), {"wrong.msh", words});
  }
}

// ---- real files, where they are at hand

fs::path data_folder() {
  const char* given = std::getenv("POLYSLIP_DATA");
  return given != nullptr ? fs::path(given) : fs::path(__FILE__).parent_path() / "../../../../shared/data";
}

TEST_F(Readers, gmsh_benchmark_files_are_read) {
  struct Expected {
    const char* file;
    int dim;
    Index nodes, cells;
    std::map<std::string, int> regions, tags;  ///< Tags: those worth checking.
  };
  const std::vector<Expected> files{
      {"fractures_2d/flemisch2018/case1_regular/geiger.msh", 2, 713, 1348, {{"rock", 1348}}, {{"left", 20}, {"right", 19}}},
      {"fractures_2d/flemisch2018/case3_complex/complex.msh", 2, 707, 1332, {{"rock", 1332}}, {{"1:1", 62}, {"1:2", 26}}},
      {"fractures_3d/case1_single/gmsh.msh", 3, 1331, 1000, {{"3:1", 400}, {"3:2", 600}}, {{"2:3", 100}}},
      {"fractures_3d/case1_single/gmsh_pointbased.msh", 3, 357, 1326, {{"3:1", 261}, {"3:2", 1065}}, {{"FRACTURE_0", 134}}},
      {"fractures_3d/case3_small_features/gmsh.msh",
       3,
       5928,
       31812,
       {{"DOMAIN", 31812}},
       {{"FRACTURE_0", 1512}, {"AUXILIARY_8", 600}}},
  };
  for (const auto& expected : files) {
    const fs::path file = data_folder() / expected.file;
    if (!fs::exists(file)) {
      std::printf("not at hand, skipped: %s\n", file.c_str());
      continue;
    }
    SCOPED_TRACE(file);
    const PolyMesh mesh = read_mesh(file);
    EXPECT_EQ(mesh.dim, expected.dim);
    EXPECT_EQ(mesh.n_nodes(), expected.nodes);
    EXPECT_EQ(mesh.n_cells(), expected.cells);
    EXPECT_EQ(in_regions(mesh), expected.regions);
    for (const auto& [name, count] : expected.tags) EXPECT_EQ(tagged(mesh)[name], count) << name;
  }
}

}  // namespace
}  // namespace polyslip::mesh
