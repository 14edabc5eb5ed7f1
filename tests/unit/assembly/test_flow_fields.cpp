// What is shown of a flow state: probes and extremes.
#include "polyslip/assembly/flow_fields.hpp"

#include "support/flow_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;

class flow_fields : public testing::TestWithParam<Shape> {
 protected:
  const int dim_ = GetParam().dim;
  const Vec3 gradient_ = dim_ == 2 ? Vec3(3, -1, 0) : Vec3(3, -1, 2);
  physics::FlowProblem problem_ = [this] {
    physics::FlowProblem problem = flow_problem(dim_);
    problem.boundary = {given_pressure("left", "0")};
    problem.initial_pressure = expression(linear(7, gradient_));
    problem.reference_pressure = expression("0.5*x - y");
    return problem;
  }();
  FlowScene scene_{[this] { return crossed_box(GetParam(), 4); }, problem_};
};

TEST_P(flow_fields, probes_read_linear_pressures_exactly) {
  la::Handle<Vec> q = scene_.interpolate([&](const Vec3& x, int) { return 7 + gradient_.dot(x) - 0.5 * x.x() + x.y(); });
  std::vector<Vec3> points{{0.1, 0.2, 0.3}, {0.5, 0.5, 0.5}, {0.99, 0.013, 0.4}, {1.25, 0.5, 0.75}};  // the last lies outside
  for (Vec3& x : points)
    if (dim_ == 2) x.z() = 0;
  const std::vector<double> found = assembly::PressureProbes(scene_.mesh, points).pressures(*scene_.system, q);
  for (std::size_t k = 0; k < points.size(); ++k) EXPECT_NEAR(found[k], 7 + gradient_.dot(points[k]), 1e-12);
}

TEST_P(flow_fields, extremes_are_those_of_the_cells_of_all_ranks) {
  const auto found = assembly::pressure_extremes(*scene_.system, scene_.q);
  double low = 1e300, high = -1e300;
  for (const double p : assembly::cell_pressures(*scene_.system, scene_.q)) {
    low = std::min(low, p);
    high = std::max(high, p);
  }
  EXPECT_EQ(found.min, mpi::min(PETSC_COMM_WORLD, low));
  EXPECT_EQ(found.max, mpi::max(PETSC_COMM_WORLD, high));
  EXPECT_NEAR(found.mean, 7 + gradient_.dot(Vec3(0.5, 0.5, 0.5)), 1e-12) << "the mean of a linear pressure is that of the centre";
}

INSTANTIATE_TEST_SUITE_P(every_planar_shape, flow_fields, testing::ValuesIn(planar_shapes()), ShapeName());

}  // namespace
}  // namespace polyslip
