// Every way in which a scene can be wrong: the message names place, key and remedy.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <random>

#include "polyslip/scene/schema.hpp"
#include "scene_support.hpp"

namespace polyslip::scene {
namespace {

const std::string cracked = smallest + R"(fractures:
  - {name: crack, points: [[0.2, 0.5], [0.8, 0.5]]}
contact: {friction: 0.5}
time: {end: 1}
output: {every: 1, probes: [{name: a, at: [0, 0]}]}
study: {n: 4, m: n}
define: {P: x, Q: P}
exact: {gradient: [[x, y], [0, 0]]}
)";

TEST(refusals, propose_the_nearest_key) {
  expect_refusals(cracked,
                  {{"young", "yong", ":4 (materials[0].yong)", "unknown key \"yong\". Did you mean \"materials[0].young\"?"},
                   {"materials", "material", ":3 (material)", "Did you mean \"materials\"?"},
                   {"cells", "cell", ":2 (mesh.box.cell)", "Did you mean \"mesh.box.cells\"?"},
                   {"time: {", "cells: [1, 1]\ntime: {", ":10 (cells)", "Did you mean \"mesh.box.cells\"?"},
                   {"time: {", "gravity: {", ":10 (gravity)", "Known here: name, description, study"},
                   {"every", "evry", ":11 (output.evry)", "Did you mean \"output.every\"?"}});
}

TEST(refusals, name_missing_keys) {
  expect_refusals(
      cracked,
      {{"mesh:\n  box: {min: [0, 0], max: [1, 1], cells: [4, 4]}\n", "", ":1 (mesh)", "the key \"mesh\" is missing"},
       {"materials:\n  - {young: 1e9, poisson: 0.25}\n", "", ":1 (materials)", "is missing. It is: list of maps"},
       {"min: [0, 0], ", "", ":2 (mesh.box.min)", "is missing"},
       {", cells: [4, 4]", "", ":2 (mesh.box.cells)", "only graded axes need none"},
       {"name: crack, ", "", ":8 (fractures[0].name)", "is missing"},
       {"on: bottom, ", "", ":6 (mechanics.boundary[0].on)", "is missing"},
       {"contact: {friction: 0.5}\n", "", " (contact.friction)", "Give the friction coefficient, or set contact.law: frictionless"},
       {"friction: 0.5", "law: tresca", ":9 (contact.friction)", "Give the friction bound [Pa]"},
       {", at: [0, 0]", "", ":11 (output.probes[0].at)", "is missing"}});
}

TEST(refusals, name_wrong_types_and_lengths) {
  expect_refusals(cracked, {{"[4, 4]", "4", ":2 (mesh.box.cells)", "\"4\" where a list belongs"},
                            {"[4, 4]", "[4, [4]]", ":2 (mesh.box.cells[1])", "a list of length 1 where one value belongs"},
                            {"[4, 4]", "{x: 4}", ":2 (mesh.box.cells)", "a map where a list belongs"},
                            {"[4, 4]", "[4, 4, 4]", ":2 (mesh.box.cells)",
                             "Give 2 components; the dimension is told by dir/scene.yaml:2 (mesh.box.min)"},
                            {"[4, 4]", "[4, ~]", ":2 (mesh.box.cells[1])", "the component has no value"},
                            {"[0, 0]", "[0]", ":2 (mesh.box.min)", "a list of length 1"},
                            {"time: {end: 1}", "time: 1", ":10 (time)", "\"1\" where a map of keys belongs"},
                            {"time: {end: 1}", "time:", ":10 (time)", "the key has no value"},
                            {"study: {n: 4, m: n}", "study: [4]", ":12 (study)", "where a map of names belongs"},
                            {"[[x, y], [0, 0]]", "[[x, y], [0]]", ":14 (exact.gradient[1])", "a list of length 1"},
                            {"[[0.2, 0.5], [0.8, 0.5]]", "[[0.2, 0.5]]", ":8 (fractures[0].points)", "at least two points"},
                            {"  - {young: 1e9, poisson: 0.25}", "  []", ":3 (materials)", "an empty list"},
                            {"name: crack", "name: the crack", ":8 (fractures[0].name)", "\"the crack\" is not a word"},
                            {"  - {young", "  - 3\n  - {young", ":4 (materials[0])", "\"3\" where a map of keys belongs"}});
}

TEST(refusals, name_values_out_of_range) {
  expect_refusals(cracked, {{"[4, 4]", "[4, 0]", ":2 (mesh.box.cells[1])", "0 is out of range. It must be >= 1"},
                            {"[4, 4]", "[4, n/8]", ":2 (mesh.box.cells[1])", "0.5 is not a whole number"},
                            {"[4, 4]", "[1e6, 1e6]", ":2 (mesh.box.cells)", "more than cell numbers can count"},
                            {"[4, 4]", "[4, 1e300]", ":2 (mesh.box.cells[1])", "out of range"},
                            {"[4, 4]}", "[4, 4], shake: 0.5}", ":2 (mesh.box.shake)", "It must be >= 0 and < 0.5"},
                            {"1e9", "0", ":4 (materials[0].young)", "It must be > 0"},
                            {"0.25", "0.5", ":4 (materials[0].poisson)", "It must be > -1 and < 0.5"},
                            {"0.25", "-1", ":4 (materials[0].poisson)", "It must be > -1 and < 0.5"},
                            {"friction: 0.5", "friction: -0.1", ":9 (contact.friction)", "It must be >= 0"},
                            {"friction: 0.5", "friction: 0.5, beta_scale: 0", ":9 (contact.beta_scale)", "It must be > 0"},
                            {"end: 1", "end: 1, step: 0", ":10 (time.step)", "It must be > 0"},
                            {"end: 1", "end: 1e999", ":10 (time.end)", "unexpected token \"1e999\""},
                            {"end: 1", "end: .inf", ":10 (time.end)", "unknown name \"inf\""},
                            {"every: 1", "every: 0", ":11 (output.every)", "It must be >= 1"}});
}

TEST(refusals, name_unknown_choices) {
  expect_refusals(cracked,
                  {{"[4, 4]}", "[4, 4], shape: quad}", ":2 (mesh.box.shape)", "unknown value \"quad\". Did you mean \"quads\"?"},
                   {"[4, 4]}", "[4, 4], shape: tets}", ":2 (mesh.box.shape)", "Choose one of quads, triangles, polygons, warped"},
                   {"friction: 0.5", "friction: 0.5, law: coulom", ":9 (contact.law)", "Did you mean \"coulomb\"?"},
                   {"friction: 0.5", "friction: 0.5, formulation: full", ":9 (contact.formulation)", "Known: condensed, saddle"},
                   {"mechanics:\n", "mechanics:\n  bubbles: none\n", ":6 (mechanics.bubbles)", "Known: fracture, all"},
                   {"mechanics:\n", "mechanics:\n  stabilisation: 2mu + lambda\n", ":6 (mechanics.stabilisation)",
                    "Did you mean \"2mu+lambda\"?"}});
}

TEST(refusals, of_expressions_name_key_and_column) {
  expect_refusals(cracked, {{"displacement: [0, 0]", "displacement: [0, 1+]", ":6 (mechanics.boundary[0].displacement[1])",
                             "at column 3 of the expression \"1+\""},
                            {"friction: 0.5", "friction: R", ":9 (contact.friction)", "unknown name \"R\" at column 1"},
                            {"n: 4", "n: m", ":12 (study.n)", "unknown name \"m\""},
                            {"n: 4", "n: x", ":12 (study.n)", "\"x\" varies"},
                            {"n: 4", "x: 4", ":12 (study.x)", "already means something in expressions"},
                            {"n: 4", "2n: 4", ":12 (study.2n)", "cannot be a name"},
                            {"P: x", "P: Q", ":13 (define.P)", "\"Q\" used before it is defined"},
                            {"P: x", "P: P", ":13 (define.P)", "\"P\" used before it is defined"},
                            {"P: x", "n: x", ":13 (define.n)", "\"n\" is already a study number"},
                            {"P: x", "sin: x", ":13 (define.sin)", "already means something"},
                            {"1e9", "1e9 + t", ":4 (materials[0].young)", "depends on time"},
                            {"friction: 0.5", "friction: 0.5*t", ":9 (contact.friction)", "depends on time"},
                            {"1e9", "tip_distance", ":4 (materials[0].young)", "These have a meaning on fractures only"},
                            {"end: 1", "end: P", ":10 (time.end)", "unknown name \"P\""}});
}

TEST(refusals, of_boxes_name_the_axis) {
  const std::string box = "cells: [4, 4]";
  const std::string graded = box + ", grading: ";
  expect_refusals(
      cracked,
      {{"max: [1, 1]", "max: [1, 0]", ":2 (mesh.box.max[1])", "the box ends at 0 where it starts at 0"},
       {box, graded + "{w: {}}", ":2 (mesh.box.grading.w)", "unknown name \"w\". Known: x, y, z"},
       {box, graded + "{z: {core: [0, 1], size: 0.1, growth: 2}}", ":2 (mesh.box.grading.z)", "there is no z axis in 2D"},
       {box, graded + "{x: {core: [0, 2], size: 0.1, growth: 2}}", ":2 (mesh.box.grading.x.core)",
        "is not an interval inside [0, 1]"},
       {box, graded + "{x: {core: [1, 0], size: 0.1, growth: 2}}", ":2 (mesh.box.grading.x.core)", "is not an interval"},
       {box, graded + "{x: {core: [1], size: 0.1, growth: 2}}", ":2 (mesh.box.grading.x.core)", "Give two: [FROM, TO]"},
       {box, graded + "{x: {core: [0, 1], size: 2, growth: 2}}", ":2 (mesh.box.grading.x.size)", "do not fit into the core"},
       {box, graded + "{x: {core: [0, 1], size: 0.1, growth: 1}}", ":2 (mesh.box.grading.x.growth)", "It must be > 1"},
       {box, graded + "{x: {core: [0, 1], size: 0.1, growth: 2, inner_growth: 0.5}}", ":2 (mesh.box.grading.x.inner_growth)",
        "It must be >= 1"},
       {"  box:", "  file: a.msh\n  box:", ":2 (mesh.file)", "both mesh.box and mesh.file are given"},
       {"  box: {min: [0, 0], max: [1, 1], cells: [4, 4]}", "  write: a.h5", ":1 (mesh)", "neither mesh.box nor mesh.file"}});
}

TEST(refusals, of_fractures_name_them) {
  const std::string points = "points: [[0.2, 0.5], [0.8, 0.5]]";
  expect_refusals(cracked,
                  {{points, "group: a", ":8 (fractures[0].group)", "a box has no physical groups"},
                   {points, points + ", group: a", ":8 (fractures[0].group)", "both points and group are given"},
                   {", " + points, "", ":8 (fractures[0])", "neither points nor group"},
                   {points, "points: [[0, 1], [0, 1]]", ":8 (fractures[0].points[1])", "the same as the one before"},
                   {points, "points: [[0, 1, 0], [0, 1, 1]]", ":8 (fractures[0].points[0])", "a list of length 3 in a scene in 2D"},
                   {"  - {name: crack", "  - {name: crack, " + points + "}\n  - {name: crack", ":9 (fractures[1].name)",
                    "already taken at dir/scene.yaml:8"}});
}

TEST(refusals, of_polygons_ask_for_three_corners) {
  const std::string solid = R"(mesh: {box: {min: [0, 0, 0], max: [1, 1, 1], cells: [2, 2, 2]}}
materials: [{young: 1, poisson: 0}]
mechanics: {boundary: [{on: all, displacement: [0, 0, 0]}]}
contact: {law: frictionless}
fractures: [{name: f, points: [[0, 0, 0], [1, 0, 0], [1, 1, 0]]}]
)";
  expect_refusals(solid, {{", [1, 1, 0]", "", ":5 (fractures[0].points)", "Give a polygon of three or more"}});
}

TEST(refusals, of_contact_say_what_to_remove) {
  const std::string fractures = "fractures:\n  - {name: crack, points: [[0.2, 0.5], [0.8, 0.5]]}\n";
  expect_refusals(
      cracked,
      {{fractures, "", ":7 (contact)", "Remove the section, or give fractures"},
       {"friction: 0.5", "friction: 0.5, law: frictionless", ":9 (contact.friction)", "a frictionless fracture has no friction"},
       {"friction: 0.5", "friction: 0.5, fractures: [{name: crck}]", ":9 (contact.fractures[0])", "Did you mean \"crack\"?"},
       {"friction: 0.5", "friction: 0.5, fractures: [{name: crack}, {name: crack}]", ":9 (contact.fractures[1].name)",
        "already taken"},
       {"friction: 0.5", "friction: 0.5, fractures: [{name: crack, law: tresca}]", ":9 (contact.fractures[0].friction)",
        "Give the friction bound [Pa]"},
       {"friction: 0.5", "fractures: [{name: crack}]", ":9 (contact.fractures[0].friction)", "Give the friction coefficient"}});
  EXPECT_EQ(refusal(with(cracked, "friction: 0.5", "fractures: [{name: crack, friction: 0.2}]")), "")
      << "all have their own friction";
}

TEST(refusals, of_materials_ask_for_a_pair) {
  const std::string pair = "young: 1e9, poisson: 0.25";
  expect_refusals(
      cracked, {{pair, "young: 1e9", ":4 (materials[0])", "Give young and poisson, or lame_mu and lame_lambda"},
                {pair, "young: 1e9, lame_mu: 1", ":4 (materials[0])", "not a pair"},
                {pair, pair + ", lame_mu: 1", ":4 (materials[0])", "not a pair"},
                {pair, "lame_mu: 3, lame_lambda: -2", ":4 (materials[0].lame_lambda)", "It must be > -2/3 lame_mu"},
                {pair, pair + ", region: rocks", ":4 (materials[0])", "the mesh has no region \"rocks\". Did you mean \"rock\"?"}});
}

TEST(refusals, of_boundary_rules_name_the_conflict) {
  const std::string rule = "displacement: [0, 0]";
  expect_refusals(cracked,
                  {{"on: bottom", "on: botom", ":6 (mechanics.boundary[0].on)", "Did you mean \"bottom\"?"},
                   {"on: bottom", "on: [top, front]", ":6 (mechanics.boundary[0].on[1])", "Known: left, right, bottom, top"},
                   {", " + rule, "", ":6 (mechanics.boundary[0])", "the rule gives nothing"},
                   {rule, "displacement: [~, ~]", ":6 (mechanics.boundary[0])", "the rule gives nothing"},
                   {rule, rule + ", traction: [~, 1]", ":6 (mechanics.boundary[0].traction)", "both give component y"},
                   {rule, rule + ", pressure: 1", ":6 (mechanics.boundary[0].pressure)", "Give it a rule of its own"},
                   {rule, "displacement: [0, ~]", ":6 (mechanics.boundary)", "no side has its displacement in y given"},
                   {rule, "pressure: 1", ":6 (mechanics.boundary)", "no side has its displacement in x given"},
                   {"boundary: [{on: bottom, displacement: [0, 0]}]", "bubbles: fracture", ":5 (mechanics.boundary)",
                    "the body is free to move"}});
}

TEST(refusals, of_times_and_probes_name_them) {
  expect_refusals(cracked, {{"end: 1", "end: 1, step: 1e-15", ":10 (time.step)", "does not advance a time of up to 1 s"},
                            {"end: 1", "end: 1, smallest_step: 1e-300", ":10 (time.smallest_step)", "Give more than 1e-14"},
                            {"max: [1, 1]", "max: [1, 1e200]", ":2 (mesh.box.max[1])", "It must be > -1000000000000000 and < 1000000000000000"},
                            {"end: 1", "end: 0", ":10 (time.end)", "the run ends at 0 s where it starts at 0 s"},
                            {"end: 1", "start: 2", ", default (time.end)", "the run ends at 1 s where it starts at 2 s"},
                            {"at: [0, 0]", "at: [0, 2]", ":11 (output.probes[0])",
                             "lies outside the mesh. Choose a point between (0, 0, 0) and (1, 1, 0)"},
                            {"at: [0, 0]}", "at: [0, 0]}, {name: a, at: [1, 1]}", ":11 (output.probes[1].name)", "already taken"},
                            {"probes: [{name: a, at: [0, 0]}]", "windows: [{name: a}, {name: a}]", ":11 (output.windows[1].name)",
                             "already taken"},
                            {"probes: [{name: a, at: [0, 0]}]", "windows: [{name: a, fracture: carck}]", ":11 (output.windows[0])",
                             "there is no fracture \"carck\". Did you mean \"crack\"?"},
                            {"probes: [{name: a, at: [0, 0]}]", "windows: [{name: a, where: t}]", ":11 (output.windows[0].where)", "t"}});
  expect_refusals(smallest + "output: {every: 1}\n",
                  {{"every: 1", "windows: [{name: a}]", ":7 (output.windows)", "there is no contact to record"}});
}

TEST(refusals, of_yaml_name_the_line) {
  expect_refusals(cracked, {{"time: {", "mesh: {", ":10", "the key \"mesh\" is given twice, first at dir/scene.yaml:1"},
                            {"end: 1", "end: 1, end: 2", ":10", "the key \"end\" is given twice"},
                            {"  box:", "\tbox:", ":2", "Indent with blanks instead of tabs"},
                            {"P: x", "P: x < 0 ? 1 : 2", ":13", "quote expressions with \"?\" and \":\""},
                            {"time: {end: 1}", "time: {end: 1\n", ":12", "this is not YAML"},
                            {"time:", "---\ntime:", ":11", "a second document starts"},
                            {"time:", "? [a, b]\n:", ":10", "a key is not a name"},
                            {"time: {end: 1}", "time: *later", ":10", "the referenced anchor is not defined"},
                            {"time: {end: 1}", "time: &all {end: *all}", ":10", "the nesting is too deep"},
                            {"end: 1", "end: \x01", ":10 (time.end)", "at column 1"}});
  EXPECT_TRUE(contains(refusal(std::string("name: \0", 7)), "dir/scene.yaml:1: a null character"));
  EXPECT_TRUE(contains(refusal(""), "the key \"mesh\" is missing"));
  EXPECT_TRUE(contains(refusal("- 1\n"), "dir/scene.yaml:1: a list of length 1 where a map of keys belongs"));
}

TEST(refusals, of_yaml_bombs_come_soon) {
  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 12; ++i) {
    bomb += fmt::format("a{0}: &a{0} [", i);
    for (int j = 0; j < 10; ++j) bomb += fmt::format("*a{}{}", i - 1, j < 9 ? ", " : "]\n");
  }
  EXPECT_TRUE(contains(refusal(bomb), "the text holds more than"));
  EXPECT_TRUE(contains(refusal("a: " + std::string(100000, '[')), "the nesting is too deep"));
}

TEST(refusals, of_overrides_name_the_argument) {
  const std::vector<std::array<std::string, 2>> cases{
      {"time.stp=1", "unknown key \"time.stp\". Did you mean \"time.step\"?"},
      {"cells=[1, 2]", "Did you mean \"mesh.box.cells\"?"},
      {"materials[0].yong=1", "Did you mean \"materials[0].young\"?"},
      {"materials.young=1", "Name an entry: materials[0].young"},
      {"materials[1].young=1", "there is no entry materials[1]"},
      {"mesh.box.cells[2]=1", "there is no entry mesh.box.cells[2]"},
      {"study.k=1", "the scene has no \"study.k\""},
      {"study.*=1", "the scene has no \"study.*\""},
      {"mesh.box.grading.q.size=1", "Known: x, y, z"},
      {"name.x=1", "unknown key \"name.x\""},
      {"time.step", "an override is KEY=VALUE"},
      {"time.step=", "an override is KEY=VALUE"},
      {"=1", "an override is KEY=VALUE"},
      {"time={step: 1", "this is not YAML"},
      {"time.step=0", " (time.step): 0 is out of range"},
      {"time.step=[1, 2]", " (time.step): a list of length 2 where one value belongs"},
      {"mesh.box.cells=16", " (mesh.box.cells): \"16\" where a list belongs"},
      {"mesh.box.shape=hexahedra", " (mesh.box.shape): hexahedra do not mesh a box in 2D"},
      {"contact.friction=1/0", " (contact.friction): the expression \"1/0\" gives inf"},
  };
  for (const auto& [argument, expected] : cases) {
    const std::string message = refusal(cracked, {argument});
    EXPECT_TRUE(message.starts_with("-set " + argument + ":") || message.starts_with("-set " + argument + " (")) << message;
    EXPECT_TRUE(contains(message, expected)) << argument << "\n  gives " << message;
  }
}

/// Damages the scene 1000 times.
void expect_refusals_at_worst(const std::string& whole) {
  std::mt19937 random(20);
  const auto below = [&](std::size_t n) { return std::uniform_int_distribution<std::size_t>(0, n - 1)(random); };
  const std::vector<std::string> shards{"\n",   " ", "  ", "[",     "]",    "{",  "}", ":",   ": ",  ",",  "- ",    "~",
                                        "null", "0", "-1", "1e308", "'",    "\"", "#", "&a ", "*a",  "x",  "t",     "?",
                                        "! ",   "|", ">",  "\t",    "\xff", "%",  "=", "1/0", "nan", "..", "[[[]]]"};
  int accepted = 0;
  for (std::size_t i = 0; i < 1000; ++i) {
    std::string text = whole;
    for (std::size_t edits = 1 + i % 2; edits > 0; --edits) {
      const std::size_t at = below(text.size());
      text.replace(at, below(4), shards[below(shards.size())]);
    }
    try {
      const Scene scene = parse(text);
      EXPECT_EQ(resolved_yaml(parse(resolved_yaml(scene))), resolved_yaml(scene)) << text;
      ++accepted;
    } catch (const InputError& error) {
      EXPECT_GT(std::string(error.what()).size(), 20U);
    }
  }
  EXPECT_GT(accepted, 20) << "damage too heavy to test anything";
}

TEST(refusals, are_the_worst_that_damaged_scenes_cause) {
  expect_refusals_at_worst(cracked);
  expect_refusals_at_worst(coupled);
}

TEST(scene_files, that_cannot_be_read_are_named) {
  EXPECT_THROW(load_scene("no/such/scene.yaml"), InputError);
  try {
    load_scene("/tmp");
    FAIL() << "a folder was read";
  } catch (const InputError& error) {
    EXPECT_TRUE(contains(error.what(), "Name the scene: /tmp/scene.yaml")) << error.what();
  }
}

}  // namespace
}  // namespace polyslip::scene
