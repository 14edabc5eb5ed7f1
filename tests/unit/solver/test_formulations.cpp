#include <gtest/gtest.h>

#include "support/contact_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;
using physics::Formulation;

class formulations : public testing::TestWithParam<Shape> {
 protected:
  static physics::MechanicsProblem problem(Formulation formulation) {
    auto problem = mixed_contact(GetParam().dim);
    problem.formulation = formulation;
    return problem;
  }
};

double distance(std::vector<double> a, const std::vector<double>& b) {
  for (std::size_t i = 0; i < a.size(); ++i) a[i] -= b[i];
  return largest(a);
}

TEST_P(formulations, condensed_and_saddle_give_the_same_mixed_contact) {
  const auto box = [] { return fractured_box(GetParam(), GetParam().dim == 2 ? 10 : 4, 0, 1); };
  ContactScene condensed(box, problem(Formulation::condensed)), saddle(box, problem(Formulation::saddle));
  for (ContactScene* scene : {&condensed, &saddle}) {
    const auto result = scene->solve();
    ASSERT_TRUE(result.converged) << result.message;
  }
  EXPECT_EQ(condensed.counts(), saddle.counts());
  for (long long n : condensed.counts()) EXPECT_GT(n, 0) << "a contact state is missing";
  const Parts a(condensed.system->layout(), condensed.x), b(saddle.system->layout(), saddle.x);
  EXPECT_LT(distance(a.nodal, b.nodal), 1e-10 * largest(b.nodal));
  EXPECT_LT(distance(a.bubble, b.bubble), 1e-10 * largest(b.nodal));
  EXPECT_LT(distance(a.multiplier, b.multiplier), 1e-10 * largest(b.multiplier));
  EXPECT_GT(largest(b.bubble), 1e-4 * largest(b.nodal)) << "the scene leaves the bubbles idle";
}

INSTANTIATE_TEST_SUITE_P(every_shape, formulations, testing::ValuesIn(all_shapes()), ShapeName());

}  // namespace
}  // namespace polyslip
