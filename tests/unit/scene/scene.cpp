#include "polyslip/scene/scene.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "scene_support.hpp"

namespace polyslip::scene {
namespace {

using physics::ElasticRule, physics::FrictionLaw;

const std::string full = R"YAML(name: everything
description: each key once
study: {n: 20, half: n/2}
define: {P: "x < 0 ? z^4 : 2*z^4", ramp: "min(1, t/half)"}
mesh:
  box:
    min: [-1, -1, -1]
    max: [1, 1, 1]
    cells: [n, 4, "n/5"]
    shape: warped
    grading: {y: {core: [-0.5, 0.5], size: 2/n, growth: 1.15}}
    shake: 0.1
    seed: 7
  write: mesh.h5
fractures:
  - {name: crack, points: [[0, -1, -1], [0, 1, -1], [0, 1, 1], [0, -1, 1]]}
  - {name: tilted, points: [[0.1, 0, 0], [0.9, 0, 0.1], [0.9, 0.5, 0.1], [0.1, 0.5, 0]]}
materials:
  - {lame_mu: 1, lame_lambda: "1 + 0*x"}
  - {region: rock, where: y > 0, young: 25e9, poisson: 0.25}
mechanics:
  stabilisation: 2mu+lambda
  bubbles: fracture
  body_force: [P, "-P", 0]
  boundary:
    - {on: all, displacement: [0, 0, 0]}
    - {on: [left, top], traction: [null, -1e6*ramp, ~]}
    - {on: right, pressure: 1e6}
contact:
  law: coulomb
  friction: 0.5*(1 + 10*exp(-200*tip_distance^2))
  fracture_pressure: 1e5
  fractures:
    - {name: tilted, law: tresca, friction: 1e4}
  formulation: saddle
  beta_scale: 10
time: {start: 1, end: 5, step: 0.5}
output:
  every: 2
  probes: [{name: middle, at: [0, 0.5, 0]}]
  lines: [{name: up, from: [0, 0, 0], to: [0, 1, 0]}]
  windows: [{name: whole}, {name: part, fracture: tilted, where: z > 0.5}]
exact:
  displacement: [x, y, P]
  gradient: [[1, 0, 0], [0, 1, 0], [0, 0, "4*z^3"]]
  multiplier_normal: z^2
  multiplier_tangential: [0, 0, 0]
  jump_normal: "z < 0 ? -z^4 : 0"
  jump_tangential: [0, 0, t]
  faces: abs(y) < 0.95
)YAML";

TEST(scenes, fill_every_struct) {
  const Scene scene = parse(full);
  EXPECT_EQ(scene.name, "everything");
  EXPECT_EQ(scene.dim, 3);
  EXPECT_EQ(scene.study.at("half"), 10);
  EXPECT_EQ(scene.mesh.write, "mesh.h5");
  ASSERT_EQ(scene.fractures.size(), 2U);
  EXPECT_EQ(scene.fractures[1].points[2], Vec3(0.9, 0.5, 0.1));
  EXPECT_EQ(scene.fractures[0].where, "dir/scene.yaml:16 (fractures[0])");
  EXPECT_EQ(scene.time.start, 1);
  EXPECT_EQ(scene.time.end, 5);
  EXPECT_EQ(scene.time.step, 0.5);
  EXPECT_EQ(scene.output.every, 2);
  ASSERT_EQ(scene.output.probes.size(), 1U);
  EXPECT_EQ(scene.output.probes[0].at, Vec3(0, 0.5, 0));
  ASSERT_EQ(scene.output.windows.size(), 2U);
  EXPECT_EQ(scene.output.windows[0].name, "whole");
  EXPECT_EQ(scene.output.windows[0].rule.fracture, "");
  EXPECT_FALSE(scene.output.windows[0].rule.where);
  EXPECT_EQ(scene.output.windows[1].rule.fracture, "tilted");
  EXPECT_EQ((*scene.output.windows[1].rule.where)({.x = Vec3(0, 0, 1)}), 1);
  ASSERT_EQ(scene.output.lines.size(), 1U);
  EXPECT_EQ(scene.output.lines[0].name, "up");
  EXPECT_EQ(scene.output.lines[0].to, Vec3(0, 1, 0));
  EXPECT_EQ(scene.output.lines[0].points, 101) << "by default";
}

TEST(scenes, fill_the_box) {
  const Scene scene = parse(full);
  ASSERT_TRUE(scene.mesh.box);
  const mesh::BoxSpec& box = *scene.mesh.box;
  EXPECT_EQ(box.dim, 3);
  EXPECT_EQ(box.min, (std::array<double, 3>{-1, -1, -1}));
  EXPECT_EQ(box.max, (std::array<double, 3>{1, 1, 1}));
  EXPECT_EQ(box.cells, (std::array<Index, 3>{20, 4, 4}));
  EXPECT_EQ(box.shape, "warped");
  EXPECT_EQ(box.shake, 0.1);
  EXPECT_EQ(box.seed, 7U);
  EXPECT_FALSE(box.grading[0]);
  ASSERT_TRUE(box.grading[1]);
  EXPECT_EQ(box.grading[1]->from, -0.5);
  EXPECT_EQ(box.grading[1]->to, 0.5);
  EXPECT_DOUBLE_EQ(box.grading[1]->size, 0.1);
  EXPECT_EQ(box.grading[1]->growth, 1.15);
  EXPECT_EQ(box.grading[1]->inner_growth, 1.0);
  EXPECT_EQ(box.where, "dir/scene.yaml:6, mesh.box");
}

TEST(scenes, fill_the_mechanics_problem) {
  const Scene scene = parse(full);
  const physics::MechanicsProblem& problem = scene.mechanics;
  const EvalPoint at{.x = {1, 0, 2}, .t = 5};
  ASSERT_EQ(problem.materials.size(), 2U);
  EXPECT_EQ(problem.materials[0].pair, ElasticRule::Pair::lame);
  EXPECT_EQ(problem.materials[0].second(at), 1);
  EXPECT_EQ(problem.materials[1].pair, ElasticRule::Pair::young_poisson);
  EXPECT_EQ(problem.materials[1].region, "rock");
  EXPECT_EQ(problem.materials[1].first(at), 25e9);
  EXPECT_EQ((*problem.materials[1].where)(at), 0);
  EXPECT_EQ(problem.body_force[0](at), 32);
  EXPECT_EQ(problem.body_force[1](at), -32);
  EXPECT_TRUE(problem.body_force[2].is_zero());
  EXPECT_EQ(problem.stabilisation, physics::Stabilisation::two_mu_lambda);
  EXPECT_EQ(problem.formulation, physics::Formulation::saddle);
  EXPECT_EQ(problem.beta_scale, 10);
}

TEST(scenes, give_each_tag_its_boundary_rule) {
  const std::vector<physics::BoundaryRule> rules = parse(full).mechanics.boundary;
  ASSERT_EQ(rules.size(), 4U);
  EXPECT_EQ(rules[0].tag, "all");
  EXPECT_TRUE(rules[0].displacement[2]->is_zero());
  EXPECT_FALSE(rules[0].traction[0]);
  EXPECT_EQ(rules[1].tag, "left");
  EXPECT_EQ(rules[2].tag, "top");
  EXPECT_FALSE(rules[2].traction[0]);
  EXPECT_EQ((*rules[2].traction[1])({.t = 5}), -5e5);
  EXPECT_TRUE(rules[2].traction[1]->depends_on_time());
  EXPECT_FALSE(rules[2].traction[2]);
  EXPECT_EQ((*rules[3].pressure)({}), 1e6);
}

TEST(scenes, let_single_fractures_differ_in_contact) {
  const std::vector<physics::ContactRule> rules = parse(full).mechanics.contact;
  ASSERT_EQ(rules.size(), 2U);
  EvalPoint tip;
  EXPECT_EQ(rules[0].fracture, "");
  EXPECT_EQ(rules[0].law, FrictionLaw::coulomb);
  EXPECT_DOUBLE_EQ(rules[0].friction(tip), 5.5);
  EXPECT_EQ(rules[1].fracture, "tilted");
  EXPECT_EQ(rules[1].law, FrictionLaw::tresca);
  EXPECT_EQ(rules[1].friction(tip), 1e4);
  EXPECT_EQ(rules[1].fracture_pressure(tip), 1e5) << "keys not given are those of all fractures";
}

TEST(scenes, fill_the_exact_solution) {
  const Scene scene = parse(full);
  ASSERT_TRUE(scene.exact);
  const EvalPoint at{.x = {1, 0, -2}, .t = 3};
  EXPECT_EQ((*scene.exact->displacement)[2](at), 32);
  EXPECT_EQ((*scene.exact->gradient)[2][2](at), -32);
  EXPECT_EQ((*scene.exact->multiplier_normal)(at), 4);
  EXPECT_EQ((*scene.exact->jump_normal)(at), -16);
  EXPECT_EQ((*scene.exact->jump_tangential)[2](at), 3);
  EXPECT_EQ((*scene.exact->faces)(at), 1);
  EXPECT_FALSE(parse(smallest).exact);
}

TEST(scenes, keep_the_planes_of_axis_aligned_fractures_and_of_their_ends) {
  using Planes = std::vector<std::pair<int, double>>;
  const auto planes = [](const std::string& fractures) {
    return parse(smallest + "fractures: [" + fractures + "]\ncontact: {law: frictionless}\n").mesh.box->kept_planes;
  };
  EXPECT_EQ(parse(full).mesh.box->kept_planes, (Planes{{0, 0.0}})) << "an oblique fracture keeps nothing";
  EXPECT_EQ(planes("{name: flat, points: [[0.8, 0.5], [0.2, 0.5]]}"), (Planes{{0, 0.2}, {0, 0.8}, {1, 0.5}}));
  EXPECT_EQ(planes("{name: bent, points: [[0.2, 0], [0.2, 0.5], [0.6, 0.5], [0.8, 0.9]]}"), (Planes{{0, 0.2}, {1, 0.5}, {0, 0.6}}));
  EXPECT_EQ(planes("{name: a, points: [[0, 0.5], [1, 0.5]]}, {name: b, points: [[0.5, 0.5], [1, 0.5]]}, {name: c, points: [[1, 0], "
                   "[1, 1]]}"),
            (Planes{{1, 0.5}, {0, 0.5}}))
      << "each once, and none on the boundary";
}

TEST(scenes, have_documented_defaults) {
  const Scene scene = parse(smallest);
  EXPECT_EQ(scene.name, "dir");
  EXPECT_EQ(scene.dim, 2);
  EXPECT_EQ(scene.mesh.box->shape, "quads");
  EXPECT_EQ(scene.mesh.box->shake, 0.2);
  EXPECT_EQ(scene.mesh.box->seed, 1U);
  EXPECT_EQ(scene.mechanics.stabilisation, physics::Stabilisation::two_mu);
  EXPECT_EQ(scene.mechanics.formulation, physics::Formulation::condensed);
  EXPECT_EQ(scene.mechanics.beta_scale, 0.02);
  for (const Expression& component : scene.mechanics.body_force) EXPECT_TRUE(component.is_zero());
  EXPECT_TRUE(scene.mechanics.contact.empty());
  EXPECT_EQ(scene.time.start, 0);
  EXPECT_EQ(scene.time.end, 1);
  EXPECT_EQ(scene.time.step, 1);
  EXPECT_EQ(scene.output.every, 1);
}

TEST(scenes, take_one_step_unless_told) { EXPECT_EQ(parse(smallest + "time: {start: 10, end: 12.5}\n").time.step, 2.5); }

TEST(resolved_scenes, are_fixed_points_and_complete) {
  for (const std::string& text : {full, smallest}) {
    const Scene scene = parse(text);
    const std::string once = resolved_yaml(scene);
    const Scene again = parse_scene(once, "elsewhere/resolved.yaml");
    EXPECT_EQ(resolved_yaml(again), once);
    EXPECT_EQ(again.name, scene.name);
    EXPECT_EQ(again.study, scene.study);
    EXPECT_EQ(again.mesh.box->cells, scene.mesh.box->cells);
    EXPECT_EQ(again.mechanics.boundary.size(), scene.mechanics.boundary.size());
    EXPECT_EQ(again.mechanics.beta_scale, scene.mechanics.beta_scale);
    EXPECT_EQ(again.time.step, scene.time.step);
    for (const char* key : {"shape:", "stabilisation:", "bubbles:", "body_force:", "every:", "step:", "seed:"})
      EXPECT_TRUE(contains(once, key)) << key;
  }
}

TEST(resolved_scenes, keep_study_numbers_and_overrides) {
  const Scene scene = parse(full, {"study.n=40", "time.step=0.25"});
  const Scene again = parse_scene(resolved_yaml(scene), "scene.yaml", {"study.n=80"});
  EXPECT_EQ(scene.mesh.box->cells[0], 40);
  EXPECT_EQ(again.mesh.box->cells[0], 80);
  EXPECT_EQ(again.time.step, 0.25);
}

TEST(resolved_scenes, name_files_absolutely) {
  const std::string rest = smallest.substr(smallest.find("materials"));
  const Scene scene = parse("mesh: {file: ../grids/a.msh}\n" + rest);
  EXPECT_TRUE(scene.mesh.file.is_absolute());
  EXPECT_TRUE(scene.mesh.file.string().ends_with("/grids/a.msh"));
  EXPECT_FALSE(contains(scene.mesh.file.string(), ".."));
  EXPECT_EQ(parse_scene(resolved_yaml(scene), "/elsewhere/scene.yaml").mesh.file, scene.mesh.file);
}

TEST(overrides, replace_values_lists_and_single_entries) {
  EXPECT_EQ(parse(full, {"mesh.box.cells=[16, 8, n]"}).mesh.box->cells, (std::array<Index, 3>{16, 8, 20}));
  EXPECT_EQ(parse(full, {"mesh.box.cells[1]=9"}).mesh.box->cells[1], 9);
  EXPECT_EQ(parse(full, {"materials[1].young=1e9"}).mechanics.materials[1].first({}), 1e9);
  EXPECT_EQ(parse(full, {"materials.1.young = 2e9 "}).mechanics.materials[1].first({}), 2e9);
  EXPECT_EQ(parse(full, {"fractures[1].points[0][2]=-0.5"}).fractures[1].points[0][2], -0.5);
  EXPECT_EQ(parse(full, {"mesh.box.grading.y.size=0.25"}).mesh.box->grading[1]->size, 0.25);
  EXPECT_EQ(parse(full, {"time.step=2", "time.step=3"}).time.step, 3) << "the last one wins";
}

TEST(overrides, make_sections_that_are_missing) {
  EXPECT_EQ(parse(smallest, {"time.end=10"}).time.end, 10);
  EXPECT_EQ(parse(smallest, {"mesh.box.grading.x={core: [0.25, 0.75], size: 0.1, growth: 1.2}"}).mesh.box->grading[0]->growth, 1.2);
  EXPECT_EQ(parse(full, {"mesh.box.grading.y.inner_growth=1.1"}).mesh.box->grading[1]->inner_growth, 1.1);
  EXPECT_EQ(parse(smallest, {"output.probes=[{name: a, at: [1, 1]}]"}).output.probes.size(), 1U);
}

TEST(overrides, take_formulas_as_they_stand) {
  const Scene scene = parse(full, {"contact.friction=x < 0 ? 1 : 2", "define.P=\"y\""});
  EXPECT_EQ(scene.mechanics.contact[0].friction({}), 2);
  EXPECT_EQ(scene.mechanics.body_force[0]({.x = {0, 3, 0}}), 3);
}

TEST(overrides, remove_keys_by_null) {
  const Scene scene = parse(full, {"contact.friction=null", "contact.law=frictionless", "exact=~",
                                   "mechanics.boundary[1].traction[2]=4", "mechanics.boundary[1].traction[1]=null"});
  EXPECT_EQ(scene.mechanics.contact[0].law, FrictionLaw::frictionless);
  EXPECT_FALSE(scene.exact);
  EXPECT_FALSE(scene.mechanics.boundary[1].traction[1]);
  EXPECT_EQ((*scene.mechanics.boundary[1].traction[2])({}), 4);
  EXPECT_EQ(resolved_yaml(parse(smallest, {"contact.friction=null", "exact.faces=null"})), resolved_yaml(parse(smallest)));
}

TEST(scene, warns_of_values_that_are_possible_and_unusual) {
  EXPECT_TRUE(parse(smallest).warnings.empty());
  const std::string slip = with(smallest, "young: 1e9", "young: 10");
  ASSERT_EQ(parse(slip).warnings.size(), 1U);
  EXPECT_EQ(parse(slip).warnings[0],
            "dir/scene.yaml:4 (materials[0].young): 10 Pa is unusual: check the unit, which is SI. Usual are 100000 to 1e+13");
  EXPECT_TRUE(parse(slip + "exact: {displacement: [x, y]}\n").warnings.empty()) << "a made-up problem may be in any unit";
  EXPECT_EQ(parse(with(rigid, "1e-14", "1")).warnings.size(), 1U);
}

}  // namespace
}  // namespace polyslip::scene
