// Sources, wells and conditions as vectors; what is refused.
#include <gtest/gtest.h>

#include "polyslip/common/error.hpp"
#include "polyslip/la/vec_access.hpp"
#include "support/flow_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;
using physics::FlowProblem;
using physics::FlowSource;

double total(const std::vector<double>& values) {
  double sum = 0;
  for (double v : values) sum += v;
  return mpi::sum(PETSC_COMM_WORLD, sum);
}

/// Places (and the amounts) of all sources, known on all ranks: sum of Q x and of Q.
Vec3 centre_of_sources(const FlowScene& scene) {
  std::array<double, 4> sums{};
  const auto& sources = scene.system->loads().sources;
  for (std::size_t i = 0; i < sources.size(); ++i)
    for (int a = 0; a < 4; ++a) sums[a] += sources[i] * (a < 3 ? scene.point(static_cast<Index>(i))[a] : 1.0);
  mpi::sum_in_place(PETSC_COMM_WORLD, sums);
  return Vec3(sums[0], sums[1], sums[2]) / sums[3];
}

FlowProblem with_source(int dim, FlowSource s) {
  FlowProblem problem = flow_problem(dim);
  problem.boundary = {given_pressure("left", "0")};
  problem.fractures = {fracture("0.05")};
  s.place = "scene.yaml:20 (flow.sources[0])";
  problem.sources = {s};
  return problem;
}

class flow_loads : public testing::TestWithParam<Shape> {
 protected:
  int dim_ = GetParam().dim;
  [[nodiscard]] auto box() const {
    return [shape = GetParam()] { return crossed_box(shape, 4); };
  }
};

TEST_P(flow_loads, sources_in_rock_and_fractures_sum_to_their_integrals) {
  FlowScene rock_source(box(), with_source(dim_, source(FlowSource::Kind::matrix, "x*y")));
  EXPECT_NEAR(total(rock_source.system->loads().sources), 0.25, 1e-13);
  FlowSource s = source(FlowSource::Kind::fracture, "2 + y");
  s.name = "across_x";
  FlowScene fracture_source(box(), with_source(dim_, s));
  EXPECT_NEAR(total(fracture_source.system->loads().sources), 2.5 * (dim_ == 2 ? 0.5 : 0.25), 1e-13);
  EXPECT_NEAR(centre_of_sources(fracture_source).x(), 0.5, 1e-14);
}

TEST_P(flow_loads, flux_through_a_side_sums_to_its_integral) {
  FlowProblem problem = flow_problem(dim_);
  problem.boundary = {given_pressure("all", "0"), given_flux("right", "3*y")};
  FlowScene scene(box(), problem);
  EXPECT_NEAR(total(scene.system->loads().sources), -1.5, 1e-13);
  EXPECT_NEAR(centre_of_sources(scene).x(), 1, 1e-14);
}

TEST_P(flow_loads, rules_hold_where_they_say) {
  FlowProblem problem = flow_problem(dim_);
  problem.boundary = {given_pressure("left", "0"), given_flux("all", "4")};
  problem.boundary[1].where = expression("x > 1 - 1e-9 && y < 0.5");
  FlowScene scene(box(), problem);
  EXPECT_NEAR(total(scene.system->loads().sources), -2, 1e-13);
  EXPECT_NEAR(centre_of_sources(scene).y(), 0.25, 1e-14);
  EXPECT_GT(scene.system->load_assembler().fixed_total(), 0);
}

TEST_P(flow_loads, wells_feed_one_cell_or_one_face_of_their_fracture) {
  FlowSource well = source(FlowSource::Kind::well, "7");
  well.at = {0.31, 0.62, dim_ == 3 ? 0.13 : 0.0};
  FlowScene in_rock(box(), with_source(dim_, well));
  EXPECT_DOUBLE_EQ(total(in_rock.system->loads().sources), 7);
  EXPECT_LT((centre_of_sources(in_rock) - well.at).norm(), 0.4);
  well.on_fracture = "across_y";
  FlowScene in_fracture(box(), with_source(dim_, well));
  EXPECT_DOUBLE_EQ(total(in_fracture.system->loads().sources), 7);
  const Vec3 at = centre_of_sources(in_fracture);
  EXPECT_NEAR(at.y(), 0.5, 1e-14);
  EXPECT_LT(Vec3(at - well.at).cwiseProduct(Vec3(1, 0, 1)).norm(), 0.25) << "of all faces the nearest";
}

TEST_P(flow_loads, wells_on_a_corner_of_cells_feed_the_same_cell_on_any_number_of_ranks) {
  FlowSource well = source(FlowSource::Kind::well, "7");
  well.at = {0.25, 0.25, dim_ == 3 ? 0.25 : 0.0};
  FlowScene scene(box(), with_source(dim_, well)), alone(box(), with_source(dim_, well), PETSC_COMM_SELF);
  const auto& sources = alone.system->loads().sources;
  const auto fed = std::find(sources.begin(), sources.end(), 7.0) - sources.begin();
  EXPECT_LT((centre_of_sources(scene) - alone.point(static_cast<Index>(fed))).norm(), 1e-14);
}

INSTANTIATE_TEST_SUITE_P(every_planar_shape, flow_loads, testing::ValuesIn(planar_shapes()), ShapeName());

TEST(flow_conditions, ridges_take_the_pressure_of_the_boundary_that_they_touch) {
  FlowProblem problem = flow_problem(2);
  problem.fractures = {fracture("0.05")};
  problem.boundary = {given_pressure("left", "3 + y"), given_pressure("top", "5")};
  FlowScene scene([] { return fractured_box({2, "quads"}, 4, 0, 1); }, problem);
  double on_top = 0, ridges = 0;
  for (Index r = 0; r < scene.mesh.flow.ridges.owned; ++r) {
    const Index i = scene.system->layout().ridge(r);
    if (!scene.system->fixed()[i]) continue;
    ++ridges;
    on_top += scene.point(i).y() == 1 && scene.system->loads().imposed[i] == 5;
  }
  EXPECT_EQ(mpi::sum(PETSC_COMM_WORLD, ridges), 1) << "the lower end touches a closed side";
  EXPECT_EQ(mpi::sum(PETSC_COMM_WORLD, on_top), 1);
}

TEST(flow_conditions, imposed_values_are_relative_to_the_reference_pressure_and_follow_time) {
  FlowProblem problem = flow_problem(2);
  problem.reference_pressure = expression("100 - 10*y");
  problem.initial_pressure = expression("101 - 10*y");
  problem.boundary = {given_pressure("all", "102 - 10*y + t")};
  problem.fractures = {fracture("9")};
  FlowScene scene([] { return crossed_box({2, "polygons"}, 4); }, problem);
  EXPECT_TRUE(scene.system->load_assembler().depends_on_time());
  const auto loads = scene.system->load_assembler().at(4);
  la::Handle<Vec> initial = scene.system->layout().create_vector();
  scene.system->set_initial(0, initial);
  const la::VecRead q(initial);
  for (Index i = 0; i < scene.system->layout().size(); ++i) {
    EXPECT_NEAR(q[i], scene.system->fluxes().is_drop(i) ? 0 : 1, 1e-13) << "drops start from 0";
    EXPECT_NEAR(loads.imposed[i], scene.system->fixed()[i] ? 6 : 0, 1e-13);
  }
}

TEST(flow_conditions, ranks_agree_on_what_is_prescribed) {
  FlowProblem problem = flow_problem(3);
  problem.fractures = {fracture("0.05")};
  problem.boundary = {given_pressure("left", "1"), given_pressure("top", "2")};
  FlowScene scene([] { return crossed_box({3, "tets"}, 4); }, problem);
  std::vector<double> owners(scene.system->fixed().begin(), scene.system->fixed().end());
  scene.system->layout().halo().owner_to_ghost(owners);
  for (Index i = 0; i < scene.system->layout().local_size(); ++i) EXPECT_EQ(scene.system->fixed()[i], owners[i]);
}

/// What is said on this rank when the problem is refused; "" if it is not.
std::string refusal(const FlowProblem& problem) {
  try {
    FlowScene scene([] { return crossed_box({2, "quads"}, 4); }, problem);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

void expect_refusal(const FlowProblem& problem, const std::string& what) {
  const std::string text = refusal(problem);
  EXPECT_NE(text.find(what), std::string::npos) << "[" << text << "] does not say [" << what << "]";
}

TEST(flow_conditions, refusals_name_what_is_wrong_on_all_ranks) {
  FlowSource well = source(FlowSource::Kind::well, "7");
  well.at = {1.5, 0.5, 0};
  expect_refusal(with_source(2, well), "0.5 m outside of the rock");
  expect_refusal(with_source(2, well), "scene.yaml:20");
  well.on_fracture = "nowhere";
  expect_refusal(with_source(2, well), "Fractures are across_x, across_y");
  FlowSource rock_source = source(FlowSource::Kind::matrix, "1");
  rock_source.name = "sand";
  expect_refusal(with_source(2, rock_source), "Regions are rock");
  FlowProblem walls = with_source(2, source(FlowSource::Kind::fracture, "1"));
  walls.fractures.clear();
  expect_refusal(walls, "carry no fluid");
  FlowProblem tag = flow_problem(2);
  tag.boundary = {given_pressure("lid", "0")};
  expect_refusal(tag, "'lid'");
  tag.boundary = {given_pressure("left", "0")};
  tag.boundary[0].where = expression("x > 0.5");
  expect_refusal(tag, "boundary face of 'left'");
  // Wrong in one corner only, which one rank alone may own.
  FlowProblem rock_rule = flow_problem(2);
  rock_rule.materials[0].biot = expression("x + y < 0.3 ? 2 : 1");
  expect_refusal(rock_rule, "Biot coefficient 2 at (0.125, 0.125, 0)");
  FlowProblem closed = flow_problem(2);
  closed.fractures = {fracture("y < 0.4 ? 0 : 1e-3")};
  expect_refusal(closed, "contact aperture 0 m");
}

TEST(flow_conditions, warped_cells_are_refused_on_all_ranks) {
  EXPECT_THROW(FlowScene(
                   [] {
                     mesh::PolyMesh mesh = mesh::make_box(unit_box({3, "warped"}, 3));
                     mesh::build_copies(mesh);
                     return mesh;
                   },
                   flow_problem(3)),
               InputError);
}

}  // namespace
}  // namespace polyslip
