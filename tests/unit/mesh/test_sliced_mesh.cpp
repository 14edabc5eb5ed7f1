// A native file read in slices gives each rank the very part that it would get of the mesh read whole.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numeric>
#include <random>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/mesh/cut.hpp"
#include "polyslip/mesh/flow_entities.hpp"
#include "polyslip/mesh/generators.hpp"
#include "polyslip/mesh/packing.hpp"
#include "polyslip/mesh/partition.hpp"
#include "polyslip/mesh/readers.hpp"
#include "polyslip/mesh/sliced_mesh.hpp"
#include "unit/mesh/part_cases.hpp"

namespace polyslip::mesh {
namespace {

namespace fs = std::filesystem;

/// A file that all ranks read, written anew by rank 0; gone at the end of the test.
class SlicedMeshes : public ::testing::Test {
 protected:
  SlicedMeshes() : file_(mpi::broadcast(world, fs::temp_directory_path() / ("polyslip_slices_" + std::to_string(getpid()) + ".h5"))) {}
  ~SlicedMeshes() override {
    mpi::on_root(world, [&] { fs::remove(file_); });
  }
  void write(const PolyMesh& mesh) const {
    mpi::on_root(world, [&] { write_native(mesh, file_); });
  }
  [[nodiscard]] const fs::path& file() const { return file_; }

 private:
  fs::path file_;
};

/// The part of this rank out of the whole mesh, as distribute() has rank 0 cut it.
DistributedMesh cut_out(const PolyMesh& whole, const std::vector<Index>& part, bool flow) {
  PartCutter cutter(whole, part, borders_come_early(whole, part, mpi::size(world)), flow ? flow_entities(whole) : FlowEntities());
  return cutter.cut(mpi::rank(world));
}

PolyMesh read_whole(const fs::path& file) {
  PolyMesh mesh = read_mesh(file);
  build_copies(mesh);
  return mesh;
}

/// Its fields, each as a list of numbers: what differs is told by its place in packing.hpp.
struct FieldList {
  template <class T>
  void operator()(const T& field) {
    Packer packer;
    packer(field);
    std::vector<std::byte>& bytes = fields.emplace_back(packer.bytes());
    for (const auto array : packer.arrays()) bytes.insert(bytes.end(), array.begin(), array.end());
  }
  std::vector<std::vector<std::byte>> fields;
};

void expect_equal(const DistributedMesh& actual, const DistributedMesh& expected) {
  FieldList a, b;
  visit_fields(a, actual);
  visit_fields(b, expected);
  ASSERT_EQ(a.fields.size(), b.fields.size());
  for (std::size_t i = 0; i < a.fields.size(); ++i) EXPECT_TRUE(a.fields[i] == b.fields[i]) << "field " << i << " in the order of visit_fields";
}

/// Cells, faces and nodes in another order, each face turned and begun anywhere.
PolyMesh shuffled(const PolyMesh& mesh) {
  std::mt19937 dice(7);
  const auto permutation = [&](Index n) {
    std::vector<Index> order(n);
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), dice);
    return order;
  };
  const std::vector<Index> nodes = permutation(mesh.n_nodes()), faces = permutation(mesh.n_faces()), cells = permutation(mesh.n_cells());
  const auto inverse = [](const std::vector<Index>& order) {
    std::vector<Index> place(order.size());
    for (std::size_t i = 0; i < order.size(); ++i) place[order[i]] = static_cast<Index>(i);
    return place;
  };
  const std::vector<Index> node = inverse(nodes), face = inverse(faces), cell = inverse(cells);
  PolyMesh result = mesh;
  result.face_nodes = result.cell_faces = {};
  for (std::size_t i = 0; i < nodes.size(); ++i) result.nodes[i] = mesh.nodes[nodes[i]];
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const Index old = faces[i];
    std::vector<Index> corners;
    for (const Index s : mesh.face_nodes[old]) corners.push_back(node[s]);
    std::rotate(corners.begin(), corners.begin() + dice() % corners.size(), corners.end());
    if (dice() % 2 == 0) std::reverse(corners.begin(), corners.end());
    result.face_nodes.push_row(corners);
    const auto& [first, second] = mesh.face_cells[old];
    result.face_cells[i] = {cell[first], second < 0 ? -1 : cell[second]};
    result.face_tag[i] = mesh.face_tag[old];
    if (mesh.face_fracture.empty()) continue;
    result.face_fracture[i] = mesh.face_fracture[old];
    result.face_tip_distance[i] = mesh.face_tip_distance[old];
  }
  for (std::size_t i = 0; i < cells.size(); ++i) {
    std::vector<Index> of_cell;
    for (const Index f : mesh.cell_faces[cells[i]]) of_cell.push_back(face[f]);
    result.cell_faces.push_row(of_cell);
    result.cell_region[i] = mesh.cell_region[cells[i]];
  }
  return result;
}

std::vector<std::pair<std::string, PolyMesh>> meshes() {
  const FractureMark all = [](const Vec3&, int) { return true; };
  const FractureMark some = [](const Vec3& x, int axis) { return static_cast<int>(1000 * (x[0] + 3 * x[1] + 7 * x[2])) % 3 == axis; };
  BoxSpec box;
  box.cells = {4, 3, 3};
  box.max = {1, 1, 1};
  box.shape = "polyhedra";
  std::vector<std::pair<std::string, PolyMesh>> result{{"2D, no fracture", grid(2, {7, 5, 0})},
                                                       {"2D, crossing", grid(2, {8, 6, 0}, crossing())},
                                                       {"2D, every face a fracture", grid(2, {6, 5, 0}, all)},
                                                       {"2D, fractures anywhere", grid(2, {9, 8, 0}, some)},
                                                       {"2D, one cell", grid(2, {1, 1, 0})},
                                                       {"2D, fractures without a face", grid(2, {4, 4, 0}, [](auto&, int) { return false; })},
                                                       {"3D, no fracture", grid(3, {5, 4, 4})},
                                                       {"3D, three planes that meet", grid(3, {6, 6, 4}, three_planes())},
                                                       {"3D, every face a fracture", grid(3, {4, 3, 3}, all)},
                                                       {"3D, fractures anywhere", grid(3, {6, 5, 5}, some)},
                                                       {"3D, polyhedra", make_box(box)}};
  for (std::size_t i = 0, n = result.size(); i < n; ++i) result.emplace_back(result[i].first + ", shuffled", shuffled(result[i].second));
  return result;
}

TEST_F(SlicedMeshes, give_each_rank_the_part_that_is_cut_out_of_the_whole) {
  for (const auto& [name, mesh] : meshes()) {
    write(mesh);
    const PolyMesh whole = read_whole(file());
    for (const bool flow : {false, true}) {
      SCOPED_TRACE(name + (flow ? ", flow" : ""));
      PartitionOptions options;
      options.flow = flow;
      expect_equal(distribute(read_sliced(world, file()), options),
                   cut_out(whole, partition_cells(whole, mpi::size(world), options), flow));
      for (const auto& [how, part] : splits(whole.n_cells(), mpi::size(world))) {
        SCOPED_TRACE(how);
        SlicedMesh slices = read_sliced(world, file());
        const RowRange mine = slices.slice().cells;
        const std::vector<Index> of_mine(part.begin() + mine.first, part.begin() + mine.first + mine.size);
        expect_equal(distribute(std::move(slices), of_mine, options), cut_out(whole, part, flow));
      }
    }
  }
}

/// Why the file is refused, or nothing.
template <class Read>
std::string refusal(Read&& read) {
  try {
    read();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

/// One number of one table becomes another.
void damage(PolyMesh& mesh, std::mt19937& dice) {
  const std::vector<Index> numbers{-1, -2, 0, 1, 7, 1000000, std::numeric_limits<Index>::max(), std::numeric_limits<Index>::min()};
  const std::vector<double> reals{std::nan(""), std::numeric_limits<double>::infinity(), 1e308, -1.0, 0.0, 0.4};
  const auto change = [&](auto& values, const auto& others) {
    values[dice() % values.size()] = dice() % 2 == 0 ? others[dice() % others.size()] : values[dice() % values.size()];
  };
  switch (dice() % 10) {
    case 0: return change(mesh.face_nodes.offsets, numbers);
    case 1: return change(mesh.face_nodes.values, numbers);
    case 2: return change(mesh.cell_faces.offsets, numbers);
    case 3: return change(mesh.cell_faces.values, numbers);
    case 4: return change(mesh.face_cells[dice() % mesh.face_cells.size()], numbers);
    case 5: return change(mesh.cell_region, numbers);
    case 6: return change(mesh.face_tag, numbers);
    case 7: return change(mesh.face_fracture, numbers);
    case 8: return change(mesh.face_tip_distance, reals);
    default: return change(mesh.nodes[dice() % mesh.nodes.size()], reals);
  }
}

TEST_F(SlicedMeshes, refuse_what_the_whole_is_refused_for_and_nothing_else_in_the_same_words_on_all_ranks) {
  std::mt19937 dice(1);
  int refused = 0;
  for (int i = 0; i < 300; ++i) {
    PolyMesh mesh = i % 2 == 0 ? grid(3, {3, 3, 2}, three_planes()) : grid(2, {6, 4, 0}, crossing());
    damage(mesh, dice);
    write(mesh);
    SCOPED_TRACE("case " + std::to_string(i));
    PolyMesh whole;
    DistributedMesh part;
    const std::string serial = refusal([&] { whole = read_whole(file()); });
    const std::string sliced = refusal([&] { part = distribute(read_sliced(world, file())); });
    EXPECT_EQ(sliced.empty(), serial.empty()) << serial << sliced;
    EXPECT_EQ(sliced, mpi::broadcast(world, sliced));
    if (serial.empty() && sliced.empty()) expect_equal(part, cut_out(whole, partition_cells(whole, mpi::size(world), {}), false));
    refused += sliced.empty() ? 0 : 1;
  }
  EXPECT_GT(refused, 100);
  EXPECT_LT(refused, 290);
}

}  // namespace
}  // namespace polyslip::mesh
