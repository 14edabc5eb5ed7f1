#include <gtest/gtest.h>

#include "polyslip/common/error.hpp"
#include "polyslip/physics/fracture_flow.hpp"
#include "support/boxes.hpp"

namespace polyslip::physics {
namespace {

constexpr double eta = 2e-3;

/// Central differences of both conductivities.
void expect_derivatives(const FractureHydraulics& face, double d) {
  const double h = 1e-5 * d;
  const auto c = fracture_conductivity(face, d, eta), up = fracture_conductivity(face, d + h, eta),
             down = fracture_conductivity(face, d - h, eta);
  EXPECT_NEAR(c.d_along, (up.along - down.along) / (2 * h), 1e-8 * std::abs(c.d_along));
  EXPECT_NEAR(c.d_through, (up.through - down.through) / (2 * h), 1e-8 * std::abs(c.d_through));
}

TEST(fracture_conductivity, follows_the_cubic_law) {
  const FractureHydraulics face{1e-3, 0, {}, {}};
  const auto c = fracture_conductivity(face, 4e-4, eta);
  EXPECT_DOUBLE_EQ(c.along, std::pow(4e-4, 3) / 12 / eta);
  EXPECT_DOUBLE_EQ(c.through, 2 * (std::pow(4e-4, 2) / 12) / (eta * 4e-4));
  expect_derivatives(face, 4e-4);
}

TEST(fracture_conductivity, takes_given_permeabilities) {
  const FractureHydraulics face{1e-3, 0, 3e-9, 5e-12};
  const auto c = fracture_conductivity(face, 4e-4, eta);
  EXPECT_DOUBLE_EQ(c.along, 3e-9 * 4e-4 / eta);
  EXPECT_DOUBLE_EQ(c.through, 2 * 5e-12 / (eta * 4e-4));
  expect_derivatives(face, 4e-4);
}

class fracture_rules : public testing::Test {
 protected:
  mesh::PolyMesh mesh_ = tests::fractured_box({2, "quads"}, 4, 0.25, 0.75);
  std::vector<Index> faces_;
  FractureFlowRule all_;

  void SetUp() override {
    for (Index face = 0; face < mesh_.n_faces(); ++face)
      if (mesh_.on_fracture(face)) faces_.push_back(face);
    ASSERT_FALSE(faces_.empty());
    all_.contact_aperture = Expression("1e-3*y + tip_distance/fracture_length", {}, "test");
    all_.place = "scene.yaml:12 (fractures[0])";
  }
  [[nodiscard]] std::string refusal(const std::vector<FractureFlowRule>& rules) const {
    try {
      fracture_hydraulics(mesh_, faces_, rules);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }
};

TEST_F(fracture_rules, are_evaluated_at_face_centres_with_the_tip_distance) {
  const auto values = fracture_hydraulics(mesh_, faces_, {all_});
  ASSERT_EQ(values.size(), faces_.size());
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    const auto nodes = mesh_.face_nodes[faces_[i]];
    const double y = (mesh_.nodes[nodes[0]].y() + mesh_.nodes[nodes[1]].y()) / 2;
    EXPECT_NEAR(values[i].contact_aperture, 1e-3 * y + std::min(y - 0.25, 0.75 - y) / 0.5, 1e-14);
    EXPECT_FALSE(values[i].permeability);
  }
}

TEST_F(fracture_rules, are_won_by_the_later_one) {
  FractureFlowRule named = all_, other = all_;
  named.fracture = "upright";
  named.permeability = Expression(2e-9);
  other.fracture = "another";
  other.permeability = Expression(3e-9);
  for (const auto& face : fracture_hydraulics(mesh_, faces_, {all_, named, other})) EXPECT_EQ(face.permeability, 2e-9);
}

TEST_F(fracture_rules, name_place_point_and_remedy_where_nothing_is_positive) {
  FractureFlowRule closed = all_, tight = all_;
  closed.contact_aperture = Expression("y < 0.5 ? 1e-3 : 0", {}, "test");
  const std::string text = refusal({closed});
  EXPECT_NE(text.find("scene.yaml:12 (fractures[0])"), std::string::npos) << text;
  EXPECT_NE(text.find("contact aperture 0 m at (0.5, 0.625, 0)"), std::string::npos) << text;
  tight.normal_permeability = Expression(0.0);
  EXPECT_NE(refusal({tight}).find("normal permeability"), std::string::npos);
  closed.fracture = "another";
  EXPECT_NE(refusal({closed}).find("'upright'"), std::string::npos);
}

}  // namespace
}  // namespace polyslip::physics
