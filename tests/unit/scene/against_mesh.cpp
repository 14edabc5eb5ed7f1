// What only the mesh can tell.
#include <gtest/gtest.h>

#include "polyslip/mesh/poly_mesh.hpp"
#include "scene_support.hpp"

namespace polyslip::scene {
namespace {

const std::string filed = R"(mesh: {file: crack.msh}
fractures: [{name: f1, group: FRACTURE_1}]
materials: [{young: 1, poisson: 0.25}, {region: clay, young: 2, poisson: 0.25}]
mechanics: {boundary: [{on: [west, east], displacement: [0, 0]}]}
contact: {law: frictionless, fractures: [{name: f1, fracture_pressure: 1}]}
output: {probes: [{name: a, at: [1, 1]}], lines: [{name: a, from: [0, 0], to: [1, 1.5], points: 3}]}
)";

mesh::PolyMesh cracked_mesh() {
  mesh::PolyMesh mesh;
  mesh.dim = 2;
  mesh.nodes = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
  mesh.region_names = {"sand", "clay"};
  mesh.tag_names = {"west", "east", "FRACTURE_1"};
  return mesh;
}

std::string mesh_refusal(const std::string& text, const mesh::PolyMesh& mesh) {
  const Scene scene = parse(text);
  try {
    check_against_mesh(scene, mesh);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(against_mesh, a_scene_that_fits_passes) {
  EXPECT_EQ(parse(filed).dim, 2);
  EXPECT_EQ(mesh_refusal(filed, cracked_mesh()), "");
}

TEST(against_mesh, unknown_names_are_refused_with_the_nearest) {
  const auto expect = [](const std::string& from, const std::string& to, const std::string& message) {
    const std::string met = mesh_refusal(with(filed, from, to), cracked_mesh());
    EXPECT_TRUE(contains(met, message)) << met;
  };
  expect("east]", "esat]",
         "dir/scene.yaml:4 (mechanics.boundary[0].on[1]): the mesh has no side or group \"esat\". Did you mean \"east\"?");
  expect("region: clay", "region: cley",
         "dir/scene.yaml:3 (materials[1]): the mesh has no region \"cley\". Did you mean \"clay\"?");
  expect("FRACTURE_1", "FRACTURE_2",
         "dir/scene.yaml:2 (fractures[0]): the mesh has no group \"FRACTURE_2\". Did you mean \"FRACTURE_1\"?");
  expect("[{name: f1, fracture", "[{name: f2, fracture", "dir/scene.yaml:5 (contact.fractures[0]): there is no fracture \"f2\"");
  expect("at: [1, 1]", "at: [1, 3]", "dir/scene.yaml:6 (output.probes[0]): the probe at (1, 3, 0) lies outside the mesh");
  expect("to: [1, 1.5]", "to: [1, 3]", "dir/scene.yaml:6 (output.lines[0]): the end of the line at (1, 3, 0) lies outside the mesh");
}

TEST(against_mesh, the_dimension_must_be_the_same) {
  mesh::PolyMesh mesh = cracked_mesh();
  mesh.dim = 3;
  EXPECT_TRUE(contains(mesh_refusal(filed, mesh),
                       "dir/scene.yaml:4 (mechanics.boundary[0].displacement): the mesh is 3D and the scene 2D"));
}

TEST(against_mesh, fractures_of_native_files_need_contact) {
  const std::string native = with(with(filed, "crack.msh", "crack.h5"), "fractures: [{name: f1, group: FRACTURE_1}]\n", "");
  const std::string without = native.substr(0, native.find("contact"));
  mesh::PolyMesh mesh = cracked_mesh();
  EXPECT_TRUE(contains(mesh_refusal(native, mesh), "there is a section contact but the mesh has no fracture"));
  EXPECT_EQ(mesh_refusal(without, mesh), "");
  mesh.fracture_names = {"f1"};
  EXPECT_EQ(mesh_refusal(native, mesh), "");
  EXPECT_TRUE(contains(mesh_refusal(without, mesh), "the key \"contact.friction\" is missing, and the mesh has fractures"));
}

}  // namespace
}  // namespace polyslip::scene
