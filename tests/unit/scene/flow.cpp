// Flow in scenes: what is read, what is refused, and that resolved scenes say the same.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "polyslip/mesh/poly_mesh.hpp"
#include "scene_support.hpp"

namespace polyslip::scene {
namespace {

using physics::FlowSource;

/// The properties of a cell by the rules, as a mesh would find them.
std::array<double, 6> permeability_at(const physics::HydraulicRule& rule, const Vec3& x) {
  std::array<double, 6> values{};
  for (std::size_t i = 0; i < 6; ++i) values[i] = (*rule.permeability)[i]({.x = x});
  return values;
}

TEST(flow_scenes, give_materials_hydraulic_keys_beside_elastic_ones) {
  const Scene scene = parse(coupled);
  ASSERT_TRUE(scene.has_mechanics);
  EXPECT_EQ(scene.mechanics.materials.size(), 1U) << "a rule without moduli is none for mechanics";
  const auto& rules = scene.flow->materials;
  ASSERT_EQ(rules.size(), 3U);
  const Vec3 x(0.5, 0, 0);
  EXPECT_EQ(permeability_at(rules[0], x), (std::array{1e-15, 0.5e-15, 0.0, 0.0, 0.0, 0.0}));
  EXPECT_EQ(permeability_at(rules[1], x), (std::array{2e-15, 1e-15, 0.0, 0.1 * 1e-15, 0.0, 0.0}));
  EXPECT_FALSE(rules[2].permeability);
  EXPECT_EQ((*rules[0].biot)({}), 0.8);
  EXPECT_FALSE(rules[1].biot);
  EXPECT_DOUBLE_EQ((*rules[0].inverse_modulus)({}), 1e-10);
  EXPECT_TRUE(rules[1].inverse_modulus->is_zero()) << "the infinite modulus of a later rule wins";
  EXPECT_DOUBLE_EQ((*rules[2].inverse_modulus)({.x = x}), 1.5e-10);
  EXPECT_EQ(rules[1].region, "rock");
  EXPECT_EQ((*rules[1].where)({.x = {0, 0.75, 0}}), 0);
  EXPECT_FALSE(rules[0].where);
  EXPECT_EQ(rules[2].place, "dir/scene.yaml:10 (materials[2])");
}

TEST(flow_scenes, take_permeability_as_scalar_diagonal_or_matrix) {
  const auto met = [](const std::string& text, const std::string& value) {
    return permeability_at(parse(text, {"materials[0].permeability=" + value}).flow->materials[0], Vec3::Zero());
  };
  const std::string solid = with(
      with(rigid, "min: [0, 0], max: [1, 1], cells: [4, 4]", "min: [0, 0, 0], max: [1, 1, 1], cells: [1, 1, 1]"), "left", "front");
  EXPECT_EQ(met(rigid, "3"), (std::array{3.0, 3.0, 3.0, 0.0, 0.0, 0.0}));
  EXPECT_EQ(met(rigid, "x < 1 ? 2 : 1")[1], 2);
  EXPECT_EQ(met(solid, "[3, 4, 5]"), (std::array{3.0, 4.0, 5.0, 0.0, 0.0, 0.0}));
  EXPECT_EQ(met(solid, "[[3, -1, 0.5], [-1, 4, 0.25], [0.5, 1/4, 5]]"), (std::array{3.0, 4.0, 5.0, -1.0, 0.25, 0.5}));
  EXPECT_EQ(parse(solid, {"materials[0].permeability=[[3, 0, 0], [0, 4, 0], [0, 0, 5]]", "materials[0].permeability[1][1]=7"})
                .flow->materials[0]
                .permeability->at(1)({}),
            7);
}

TEST(flow_scenes, take_an_infinite_biot_modulus) {
  for (const char* text : {"infinity", ".inf"}) {
    const Scene scene = parse(rigid, {fmt::format("materials[0].biot_modulus={}", text)});
    EXPECT_TRUE(scene.flow->materials[0].inverse_modulus->is_zero());
    EXPECT_TRUE(parse(resolved_yaml(scene)).flow->materials[0].inverse_modulus->is_zero());
  }
}

TEST(flow_scenes, fill_the_flow_problem) {
  const Scene scene = parse(coupled);
  const physics::FlowProblem& flow = *scene.flow;
  const EvalPoint at{.x = {2, 0.5, 0}, .t = 3, .tip_distance = 4, .fracture_length = 16};
  EXPECT_EQ(flow.viscosity, 2e-3);
  EXPECT_EQ(flow.fluid_compressibility, 4e-10);
  EXPECT_FALSE(flow.stationary);
  EXPECT_EQ(flow.conductivities, physics::ConductivityTime::current);
  EXPECT_EQ(flow.initial_pressure(at), 100002);
  EXPECT_EQ((*flow.reference_pressure)(at), 5e3);
  ASSERT_EQ(flow.boundary.size(), 3U) << "one rule a side";
  EXPECT_EQ(flow.boundary[1].tag, "top");
  EXPECT_EQ((*flow.boundary[1].pressure)(at), 3e5);
  EXPECT_FALSE(flow.boundary[1].flux);
  EXPECT_EQ(flow.boundary[2].tag, "right");
  EXPECT_EQ((*flow.boundary[2].flux)(at), -1e-6);
  EXPECT_EQ(flow.boundary[2].name, "inlet");
  EXPECT_EQ((*flow.boundary[2].where)(at), 0);
  EXPECT_FALSE(flow.boundary[1].where);
}

TEST(flow_scenes, list_sources_then_wells) {
  const std::vector<FlowSource> sources = parse(coupled).flow->sources;
  ASSERT_EQ(sources.size(), 4U);
  EXPECT_EQ(sources[0].kind, FlowSource::Kind::matrix);
  EXPECT_EQ(sources[0].name, "rock");
  EXPECT_EQ(sources[1].kind, FlowSource::Kind::fracture);
  EXPECT_EQ(sources[1].name, "") << "all fractures";
  EXPECT_EQ(sources[1].rate({.tip_distance = 5}), 5);
  EXPECT_EQ(sources[2].kind, FlowSource::Kind::well);
  EXPECT_EQ(sources[2].name, "injector");
  EXPECT_EQ(sources[2].at, Vec3(0.9, 0.5, 0));
  EXPECT_EQ(sources[2].on_fracture, "fault");
  EXPECT_EQ(sources[2].rate({.t = 2}), 2e-6);
  EXPECT_EQ(sources[3].on_fracture, "");
  EXPECT_EQ(sources[3].place, "dir/scene.yaml:28 (flow.wells[1])");
  EXPECT_EQ(parse(coupled, {"flow.sources[1].fracture=joint"}).flow->sources[1].name, "joint");
}

TEST(flow_scenes, let_single_fractures_differ) {
  const std::vector<physics::FractureFlowRule> rules = parse(coupled).flow->fractures;
  ASSERT_EQ(rules.size(), 2U);
  const EvalPoint at{.tip_distance = 4, .fracture_length = 16};
  EXPECT_EQ(rules[0].fracture, "");
  EXPECT_DOUBLE_EQ(rules[0].contact_aperture(at), 0.5e-4);
  EXPECT_DOUBLE_EQ(rules[0].dilation(at), std::tan(EIGEN_PI / 60));
  EXPECT_FALSE(rules[0].permeability);
  EXPECT_FALSE(rules[0].normal_permeability);
  EXPECT_EQ(rules[1].fracture, "joint");
  EXPECT_DOUBLE_EQ(rules[1].contact_aperture(at), 0.5e-4) << "keys not given are those of all fractures";
  EXPECT_TRUE(rules[1].dilation.is_zero());
  EXPECT_EQ((*rules[1].permeability)(at), 1e-9);
  EXPECT_EQ((*rules[1].normal_permeability)(at), 1e-12);
  EXPECT_FALSE(rules[0].barrier);
  EXPECT_TRUE(rules[1].barrier);
  EXPECT_TRUE(parse(coupled, {"flow.fractures=null", "flow.sources[1].fracture=null", "flow.sources[1].rate=1",
                              "flow.wells[0].fracture=null"})
                  .flow->fractures.empty())
      << "walls";
}

TEST(flow_scenes, need_no_common_aperture_where_each_fracture_has_its_own) {
  const auto rules = parse(coupled, {"flow.fractures={fractures: [{name: fault, contact_aperture: 1e-3}, {name: joint, "
                                     "contact_aperture: 1e-4}]}"})
                         .flow->fractures;
  ASSERT_EQ(rules.size(), 2U);
  EXPECT_EQ(rules[0].fracture, "fault");
  EXPECT_EQ(rules[1].contact_aperture({}), 1e-4);
}

TEST(flow_scenes, start_from_equilibrium_with_contact_unless_told) {
  EXPECT_TRUE(parse(coupled).initial.equilibrium);
  EXPECT_FALSE(parse(coupled, {"initial.equilibrium=false"}).initial.equilibrium);
  const std::string closed = smallest + "flow: {}\n";
  EXPECT_FALSE(parse(closed, {"materials[0].permeability=1"}).initial.equilibrium) << "there is no contact";
  EXPECT_FALSE(parse(smallest).initial.equilibrium);
}

TEST(flow_scenes, take_initial_stress_and_bubbles_on_all_faces) {
  const physics::MechanicsProblem problem = parse(coupled).mechanics;
  ASSERT_TRUE(problem.initial_stress);
  const auto& stress = *problem.initial_stress;
  EXPECT_EQ(stress[1]({.x = {0, 0.25, 0}}), -0.75e6);
  EXPECT_EQ(stress[3]({}), 2e5);
  for (std::size_t i : {0, 2, 4, 5}) EXPECT_TRUE(stress[i].is_zero());
  EXPECT_EQ(problem.bubbles, spaces::Bubbles::all);
  EXPECT_FALSE(parse(smallest).mechanics.initial_stress);
  const Scene without_flow = parse(smallest, {"initial.stress.zz=-1e6"});
  EXPECT_EQ((*without_flow.mechanics.initial_stress)[2]({}), -1e6);
  EXPECT_FALSE(without_flow.initial.equilibrium);
  EXPECT_EQ(parse(smallest).mechanics.bubbles, spaces::Bubbles::fracture);
}

TEST(flow_scenes, take_bounds_of_steps_and_times_to_meet) {
  const Scene scene = parse(coupled);
  EXPECT_EQ(scene.time.smallest_step, 0.1);
  EXPECT_EQ(scene.time.largest_step, 20);
  EXPECT_EQ(scene.time.outputs, (std::vector{25.0, 75.5}));
  EXPECT_EQ(scene.output.checkpoint_every, 3);
  const Scene plain = parse(smallest, {"time.end=4", "time.step=2"});
  EXPECT_EQ(plain.time.smallest_step, 2.0 / 1024);
  EXPECT_EQ(plain.time.largest_step, 2);
  EXPECT_TRUE(plain.time.outputs.empty());
  EXPECT_EQ(plain.output.checkpoint_every, 0);
}

TEST(flow_scenes, fill_the_exact_flow) {
  const Scene scene = parse(coupled);
  const EvalPoint at{.x = {1, 0, 0}, .t = 3};
  EXPECT_EQ((*scene.exact_flow->pressure)(at), 4);
  EXPECT_EQ((*scene.exact_flow->flux)[1](at), -3);
  EXPECT_TRUE(scene.exact->displacement);
  const Scene pressure = parse(coupled, {"exact.displacement=null", "exact.flux=null"});
  EXPECT_FALSE(pressure.exact) << "nothing mechanical is compared";
  EXPECT_FALSE(pressure.exact_flow->flux);
  EXPECT_FALSE(parse(smallest, {"exact.displacement=[0, 0]"}).exact_flow);
}

TEST(rigid_scenes, have_flow_alone_and_documented_defaults) {
  const Scene scene = parse(rigid);
  EXPECT_FALSE(scene.has_mechanics);
  EXPECT_TRUE(scene.mechanics.materials.empty());
  EXPECT_FALSE(scene.initial.equilibrium);
  const physics::FlowProblem& flow = *scene.flow;
  EXPECT_EQ(flow.viscosity, 1e-3);
  EXPECT_EQ(flow.fluid_compressibility, 0);
  EXPECT_FALSE(flow.stationary);
  EXPECT_EQ(flow.conductivities, physics::ConductivityTime::previous);
  EXPECT_TRUE(flow.initial_pressure.is_zero());
  EXPECT_FALSE(flow.reference_pressure);
  EXPECT_FALSE(flow.materials[0].biot);
  EXPECT_FALSE(flow.materials[0].inverse_modulus);
  EXPECT_TRUE(flow.fractures.empty());
  EXPECT_FALSE(contains(resolved_yaml(scene), "mechanics")) << "a resolved rigid scene stays rigid";
  EXPECT_TRUE(parse(rigid, {"flow.stationary=true"}).flow->stationary);
}

TEST(rigid_scenes, may_have_fractures_without_contact) {
  const Scene scene = parse(rigid, {"fractures=[{name: f, points: [[0, 0.5], [1, 0.5]]}]", "flow.fractures.contact_aperture=1e-3"});
  EXPECT_FALSE(scene.has_mechanics);
  EXPECT_TRUE(scene.mechanics.contact.empty());
  EXPECT_EQ(scene.flow->fractures.size(), 1U);
}

TEST(rigid_scenes, become_deforming_by_moduli_mechanics_or_contact) {
  EXPECT_TRUE(
      parse(rigid, {"materials[0].young=1", "materials[0].poisson=0", "mechanics.boundary=[{on: all, displacement: [0, 0]}]"})
          .has_mechanics);
  for (const char* section : {"mechanics={boundary: [{on: all, displacement: [0, 0]}]}", "contact={law: frictionless}"})
    EXPECT_TRUE(contains(refusal(rigid, {section}), "scene.yaml:3 (materials): no material gives elastic moduli")) << section;
}

TEST(resolved_flow_scenes, are_fixed_points_and_complete) {
  for (const std::string& text : {coupled, rigid}) {
    const Scene scene = parse(text);
    const std::string once = resolved_yaml(scene);
    const Scene again = parse_scene(once, "elsewhere/resolved.yaml");
    EXPECT_EQ(resolved_yaml(again), once);
    EXPECT_EQ(again.has_mechanics, scene.has_mechanics);
    EXPECT_EQ(again.initial.equilibrium, scene.initial.equilibrium);
    EXPECT_EQ(again.flow->materials.size(), scene.flow->materials.size());
    EXPECT_EQ(again.flow->sources.size(), scene.flow->sources.size());
    EXPECT_EQ(again.flow->fractures.size(), scene.flow->fractures.size());
    EXPECT_EQ(again.flow->boundary.size(), scene.flow->boundary.size());
    EXPECT_EQ(again.time.outputs, scene.time.outputs);
    EXPECT_EQ(again.time.smallest_step, scene.time.smallest_step);
    for (const char* key : {"viscosity:", "compressibility:", "stationary:", "conductivities:", "initial_pressure:",
                            "smallest_step:", "largest_step:", "checkpoint_every:"})
      EXPECT_TRUE(contains(once, key)) << key;
  }
  EXPECT_TRUE(contains(resolved_yaml(parse(coupled)), "equilibrium: true"));
}

TEST(flow_refusals, name_values_out_of_range) {
  expect_refusals(
      coupled,
      {{"[k, \"k/2\"]", "0", ":8 (materials[0].permeability)", "It must be > 0"},
       {"[k, \"k/2\"]", "[k, -k]", ":8 (materials[0].permeability[1])", "It must be > 0"},
       {"[2*k, \"0.1*k\"]", "[0, \"0.1*k\"]", ":9 (materials[1].permeability[0][0])", "It must be > 0"},
       {"biot: 0.8", "biot: 1.01", ":8 (materials[0].biot)", "It must be >= 0 and <= 1"},
       {"biot: 0.8", "biot: -0.1", ":8 (materials[0].biot)", "It must be >= 0 and <= 1"},
       {"biot_modulus: 1e10", "biot_modulus: 0", ":8 (materials[0].biot_modulus)", "It must be > 0"},
       {"biot_modulus: 1e10", "biot_modulus: inf", ":8 (materials[0].biot_modulus)", "unknown name \"inf\""},
       {"biot_modulus: 1e10", "biot_modulus: t", ":8 (materials[0].biot_modulus)", "depends on time"},
       {"\"1e-10*(1+x)\"", "-1", ":10 (materials[2].storage)", "It must be >= 0"},
       {"viscosity: 2e-3", "viscosity: 0", ":15 (fluid.viscosity)", "It must be > 0"},
       {"compressibility: 4e-10", "compressibility: -1", ":15 (fluid.compressibility)", "It must be >= 0"},
       {"conductivities: current", "conductivities: last", ":17 (flow.conductivities)", "Known: previous, current"},
       {"conductivities: current", "stationary: yes", ":17 (flow.stationary)", "Known: true, false"},
       {"1e5 + x", "1e5 + t", ":18 (flow.initial_pressure)", "depends on time"},
       {"1e4*(1 - y)", "tip_distance", ":19 (flow.reference_pressure)", "These have a meaning on fractures only"},
       {"1e-4*sqrt(tip_distance/fracture_length)", "0", ":30 (flow.fractures.contact_aperture)", "It must be > 0"},
       {"1e-4*sqrt(tip_distance/fracture_length)", "t", ":30 (flow.fractures.contact_aperture)", "depends on time"},
       {"dilation_angle: 3", "dilation_angle: 90", ":31 (flow.fractures.dilation_angle)", "It must be >= 0 and < 90"},
       {"dilation: 0", "dilation: -0.1", ":33 (flow.fractures.fractures[0].dilation)", "It must be >= 0"},
       {"permeability: 1e-9", "permeability: 0", ":33 (flow.fractures.fractures[0].permeability)", "It must be > 0"},
       {"normal_permeability: 1e-12", "normal_permeability: 0", ":33 (flow.fractures.fractures[0].normal_permeability)", "> 0"},
       {"checkpoint_every: 3", "checkpoint_every: -1", ":36 (output.checkpoint_every)", "It must be >= 0"}});
}

TEST(flow_refusals, name_missing_and_unknown_keys) {
  expect_refusals(coupled, {{"viscosity: 2e-3", "viscocity: 2e-3", ":15 (fluid.viscocity)", "Did you mean \"fluid.viscosity\"?"},
                            {"reference_pressure", "hydrostatic", ":19 (flow.hydrostatic)", "unknown key"},
                            {"on: right, ", "", ":22 (flow.boundary[1].on)", "is missing"},
                            {", rate: 1e-9", "", ":24 (flow.sources[0].rate)", "is missing"},
                            {"name: injector, ", "", ":27 (flow.wells[0].name)", "is missing"},
                            {"at: [1.9, 0.9], ", "", ":28 (flow.wells[1].at)", "is missing"},
                            {"name: joint, permeability", "permeability", ":33 (flow.fractures.fractures[0].name)", "is missing"},
                            {"    contact_aperture: 1e-4*sqrt(tip_distance/fracture_length)\n", "",
                             ":29 (flow.fractures.contact_aperture)", "Give the aperture of the closed fracture"}});
}

TEST(flow_refusals, of_permeability_ask_for_a_tensor) {
  const std::string matrix = "[[2*k, \"0.1*k\"], [\"0.1*k\", k]]";
  const std::string key = ":9 (materials[1].permeability";
  expect_refusals(coupled,
                  {{matrix, "[k, k, k]", key + ")", "a list of length 3 in a scene in 2D"},
                   {matrix, "[[k, 0], k]", key + "[1])", "where a list belongs"},
                   {matrix, "[[k, 0], [0]]", key + "[1])", "a list of length 1"},
                   {matrix, "[[k, 0], [0, ~]]", key + "[1][1])", "the component has no value"},
                   {matrix, "[k, ~]", key + "[1])", "the component has no value"},
                   {matrix, "{xx: k}", key + ")", "The key is: expression, diagonal or symmetric matrix of expressions"},
                   {matrix, "[[k, 0.1*k], [0.2*k, k]]", key + "[1][0])", "\"0.2*k\" differs from \"0.1*k\" across the diagonal"},
                   {matrix, "[[k, x], [y, k]]", key + "[1][0])", "Give a symmetric matrix"},
                   {matrix, "[[k, 2*k], [2*k, k]]", key + ")", "the matrix has the eigenvalue -1e-15"}});
}

TEST(flow_refusals, of_rules_that_exclude_each_other_name_one) {
  expect_refusals(
      coupled,
      {{"storage:", "biot_modulus: 1, storage:", ":10 (materials[2].storage)", "both biot_modulus and storage are given"},
       {"flux: -1e-6", "flux: -1e-6, pressure: 0", ":22 (flow.boundary[1].flux)", "both pressure and flux are given"},
       {", flux: -1e-6", "", ":22 (flow.boundary[1])", "neither pressure nor flux"},
       {"region: rock, rate", "region: rock, fracture: all, rate", ":24 (flow.sources[0].fracture)", "Make it two sources"},
       {"rate: 1e-9", "rate: tip_distance", ":24 (flow.sources[0].rate)", "Use position, or name a fracture"},
       {"dilation_angle: 3", "dilation_angle: 3\n    dilation: 0", ":31 (flow.fractures.dilation_angle)", "Remove one"},
       {"dilation: 0", "dilation: 0, dilation_angle: 0", ":33 (flow.fractures.fractures[0].dilation_angle)", "Remove one"},
       {"name: producer", "name: injector", ":28 (flow.wells[1].name)", "already taken"},
       {"{name: joint, permeability", "{name: joint}\n      - {name: joint, permeability", ":34 (flow.fractures.fractures[1].name)",
        "already taken"},
       {"conductivities: current", "stationary: true", ":17 (flow.stationary)", "flow beside mechanics is not stationary"},
       {"{friction: 0.6}", "{friction: 0.6, fracture_pressure: 1e5}", ":14 (contact.fracture_pressure)", "is computed"},
       {"{friction: 0.6}", "{friction: 0.6, fractures: [{name: joint, fracture_pressure: x}]}",
        ":14 (contact.fractures[0].fracture_pressure)", "is computed"}});
}

TEST(flow_refusals, of_keys_without_their_section_say_what_to_add) {
  const std::string no_flow = smallest + "exact: {displacement: [0, 0]}\ntime: {end: 1}\n";
  const std::string young = "young: 1e9", remedy = "Add the section (flow: {}), or remove the key";
  expect_refusals(no_flow,
                  {{young, "permeability: 1, " + young, ":4 (materials[0].permeability)", remedy},
                   {young, "biot: 1, " + young, ":4 (materials[0].biot)", remedy},
                   {young, "storage: 1, " + young, ":4 (materials[0].storage)", remedy},
                   {"time:", "fluid: {viscosity: 1}\ntime:", ":8 (fluid)", remedy},
                   {"exact: {", "exact: {pressure: 0, ", ":7 (exact.pressure)", remedy},
                   {"exact: {", "exact: {flux: [0, 0], ", ":7 (exact.flux)", remedy},
                   {"time:", "initial: {equilibrium: true}\ntime:", ":8 (initial.equilibrium)", "add the section flow"},
                   {"  - {young: 1e9, poisson: 0.25}", "  - {permeability: 1}", ":4 (materials[0].permeability)", remedy}});
  expect_refusals(with(rigid, "flow:", "time: {end: 1}\nflow:"),
                  {{"time:", "initial: {stress: {xx: 1}}\ntime:", ":5 (initial)", "with mechanics only"},
                   {"time:", "exact: {gradient: [[0, 0], [0, 0]]}\ntime:", ":5 (exact.gradient)", "there is nothing to compare"},
                   {"flow: {", "flow: {fractures: {contact_aperture: 1}, ", ":6 (flow.fractures)", "but no fracture"},
                   {"flow: {", "flow: {sources: [{fracture: all, rate: 1}], ", ":6 (flow.sources[0].fracture)", "hold no fluid"},
                   {"flow: {", "flow: {wells: [{name: w, at: [0, 0], rate: 1, fracture: f}], ", ":6 (flow.wells[0].fracture)",
                    "hold no fluid"}});
}

TEST(flow_refusals, of_materials_say_what_is_missing) {
  const std::string rule = "{young: 1e10, poisson: 0.2, permeability: [k, \"k/2\"], biot: 0.8, biot_modulus: 1e10}";
  expect_refusals(coupled, {{rule, "{permeability: 1}", ":7 (materials)", "no material gives elastic moduli"},
                            {rule, "{young: 1, permeability: 1}", ":8 (materials[0])", "the moduli are not a pair"},
                            {"{where: x > 1, storage: \"1e-10*(1+x)\"}", "{where: x > 1}", ":10 (materials[2])", "gives nothing"}});
  expect_refusals(rigid,
                  {{"permeability: 1e-14", "biot: 1", ":3 (materials)", "no material gives the permeability"},
                   {"- {permeability: 1e-14}", "- {permeability: 1}\n  - {region: rock}", ":5 (materials[1])", "gives nothing"}});
}

TEST(flow_refusals, of_pressures_known_up_to_a_constant_ask_for_one) {
  const std::string closed = "flux: 0", open = "pressure: 0";
  expect_refusals(rigid, {{open, closed, ":5 (flow.boundary)", "materials[].biot_modulus or storage"},
                          {open + "}]", closed + "}], stationary: true", ":5 (flow.boundary)", "Give the pressure on a side"}});
  const std::string shut = with(rigid, open, closed);
  EXPECT_EQ(refusal(shut, {"materials[0].storage=1e-10"}), "");
  EXPECT_EQ(refusal(shut, {"materials[0].biot_modulus=1e10"}), "");
  EXPECT_NE(refusal(shut, {"materials[0].biot_modulus=infinity"}), "");
  EXPECT_NE(refusal(shut, {"materials[0].storage=0"}), "");
  EXPECT_NE(refusal(shut, {"materials[0].storage=1e-10", "flow.stationary=true"}), "");
  const std::string crossed = shut + "fractures: [{name: f, points: [[0, 0.5], [1, 0.5]]}]\nfluid: {compressibility: 1e-9}\n";
  EXPECT_EQ(refusal(crossed, {"flow.fractures.contact_aperture=1e-3"}), "") << "the fluid in the fracture yields";
  EXPECT_NE(refusal(crossed), "");
}

TEST(flow_refusals, of_initial_states_and_times_name_them) {
  expect_refusals(coupled,
                  {{"xy: 2e5", "yz: 2e5", ":34 (initial.stress.yz)", "there is no component yz in plane strain"},
                   {"xy: 2e5", "xz: x", ":34 (initial.stress.xz)", "there is no component xz in plane strain"},
                   {"xy: 2e5", "xy: t", ":34 (initial.stress.xy)", "depends on time"},
                   {"smallest_step: 0.1", "smallest_step: 11", ":35 (time.smallest_step)", "it is larger than the step, 10 s"},
                   {"largest_step: 20", "largest_step: 9", ":35 (time.largest_step)", "it is smaller than the step, 10 s"},
                   {"smallest_step: 0.1", "smallest_step: 0", ":35 (time.smallest_step)", "It must be > 0"},
                   {"[25, 75.5]", "[25, 25]", ":35 (time.outputs[1])", "25 s does not lie after 25 s and in the run"},
                   {"[25, 75.5]", "[0]", ":35 (time.outputs[0])", "0 s does not lie after 0 s"},
                   {"[25, 75.5]", "[101]", ":35 (time.outputs[0])", "up to time.end"}});
}

TEST(flow_refusals, name_what_the_mesh_does_not_have) {
  expect_refusals(coupled, {{"[left, top]", "[left, topp]", ":21 (flow.boundary[0].on[1])", "Did you mean \"top\"?"},
                            {"region: rock, where", "region: rok, where", ":9 (materials[1])", "the mesh has no region \"rok\""},
                            {"region: rock, rate", "region: rok, rate", ":24 (flow.sources[0])", "Did you mean \"rock\"?"},
                            {"fracture: all", "fracture: faul", ":25 (flow.sources[1])", "Did you mean \"fault\"?"},
                            {"fracture: fault", "fracture: joi", ":27 (flow.wells[0])", "there is no fracture \"joi\""},
                            {"[1.9, 0.9]", "[1.9, 9]", ":28 (flow.wells[1])", "the well at (1.9, 9, 0) lies outside the mesh"},
                            {"name: joint, permeability", "name: jont, permeability", ":33 (flow.fractures.fractures[0])",
                             "Did you mean \"joint\"?"}});
}

/// The message of a scene whose mesh is a native file with these fractures.
std::string native_refusal(const std::string& fractures, const std::vector<std::string>& found) {
  const std::string text = R"(mesh: {file: network.h5}
materials: [{permeability: 1}]
flow: {boundary: [{on: west, pressure: 0}], wells: [{name: w, at: [0, 0], rate: 1}], fractures: )" +
                           fractures + "}\n";
  mesh::PolyMesh mesh;
  mesh.dim = 2;
  mesh.nodes = {{0, 0, 0}, {1, 1, 0}};
  mesh.tag_names = {"west"};
  mesh.fracture_names = found;
  try {
    check_against_mesh(parse(text), mesh);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(flow_refusals, of_fractures_in_native_files_come_with_the_mesh) {
  const std::string one = "{fractures: [{name: a, contact_aperture: 1}]}";
  EXPECT_EQ(native_refusal("{contact_aperture: 1}", {"a", "b"}), "");
  EXPECT_TRUE(
      contains(native_refusal("{contact_aperture: 1}", {}), "there is a section flow.fractures but the mesh has no fracture"));
  EXPECT_TRUE(contains(native_refusal(one, {"a", "b"}), "the fracture \"b\" has no aperture"));
}

}  // namespace
}  // namespace polyslip::scene
