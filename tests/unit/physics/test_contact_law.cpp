#include <gtest/gtest.h>

#include "polyslip/physics/contact_law.hpp"

namespace polyslip::physics {
namespace {

const ContactLaw coulomb{FrictionLaw::coulomb, 0.5}, tresca{FrictionLaw::tresca, 3}, smooth{FrictionLaw::frictionless, 0};
constexpr Augmentation beta{10};

void expect_equal(const Vec3& a, const Vec3& b) { EXPECT_LT((a - b).norm(), 1e-14) << a.transpose() << " and " << b.transpose(); }

// z = lam + 10 (J_n, J_t - J_t^{n-1}) by hand in each case; only the tangential part of the previous jump counts.

TEST(contact_law, sticks_inside_the_friction_cone_whatever_the_augmentation_adds) {
  const ContactPoint p{{8, 1, 0}, {0, 0.2, 0.1}, {99, 0, 0}};  // z = (8, 3, 1), |z_t| = 3.16 < 4
  EXPECT_EQ(contact_state(coulomb, p, beta), ContactState::stick);
  expect_equal(contact_residual(coulomb, p, beta), {0, -2, -1});  // lam_t - z_t = -beta dJ_t
}

TEST(contact_law, projects_on_the_friction_cone_when_it_slips) {
  const ContactPoint p{{6, 1, 0}, {0.2, 0.4, 0.7}, {0, 0.2, 0.3}};  // z = (8, 3, 4), |z_t| = 5 > 4: P = (2.4, 3.2)
  EXPECT_EQ(contact_state(coulomb, p, beta), ContactState::slip);
  expect_equal(contact_residual(coulomb, p, beta), {-2, -1.4, -3.2});
}

TEST(contact_law, has_no_traction_where_it_is_open) {
  const ContactPoint p{{1, 2, -1}, {-0.3, 0.5, 0}, Vec3::Zero()};  // z_n = -2
  EXPECT_EQ(contact_state(coulomb, p, beta), ContactState::open);
  expect_equal(contact_residual(coulomb, p, beta), p.lam);
}

TEST(contact_law, bounds_tresca_friction_by_the_given_traction) {
  const ContactPoint p{{100, 0, 0}, {0, 0.3, 0.4}, Vec3::Zero()};  // |z_t| = 5 > 3: P = (1.8, 2.4)
  EXPECT_EQ(contact_state(tresca, p, beta), ContactState::slip);
  expect_equal(contact_residual(tresca, p, beta), {0, -1.8, -2.4});
  EXPECT_EQ(contact_state(tresca, {{100, 1, 0}, {0, 0.1, 0.1}, Vec3::Zero()}, beta), ContactState::stick);
}

TEST(contact_law, carries_no_shear_without_friction) {
  const ContactPoint p{{4, 1, 2}, {-0.1, 3, -5}, Vec3::Zero()};  // z_n = 3
  EXPECT_EQ(contact_state(smooth, p, beta), ContactState::slip);
  expect_equal(contact_residual(smooth, p, beta), {1, 1, 2});
}

TEST(contact_law, vanishes_exactly_at_admissible_states) {
  const std::vector<ContactPoint> solutions{{{4, 1, 1}, {0, 0.3, 0.1}, {0, 0.3, 0.1}},      // stick
                                            {{10, 3, 4}, {0, 0.6, 0.8}, Vec3::Zero()},      // slip along the traction
                                            {Vec3::Zero(), {-0.2, 0.4, 0}, Vec3::Zero()}};  // open
  for (const ContactPoint& p : solutions)
    for (double b : {1e-3, 1.0, 1e5}) EXPECT_LT(contact_residual(coulomb, p, {b}).norm(), 1e-9) << b;
}

TEST(contact_law, glues_faces_that_start_from_zero) {
  const ContactPoint zero{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()};
  EXPECT_EQ(contact_state(coulomb, zero, beta), ContactState::stick);
  const auto l = linearise_contact(coulomb, zero, beta);
  EXPECT_EQ(l.state, ContactState::stick);
  EXPECT_EQ(l.d_jump, Eigen::Matrix3d(-10 * Eigen::Matrix3d::Identity()));
  EXPECT_EQ(l.d_lam, Eigen::Matrix3d(Eigen::Matrix3d::Zero()));
}

TEST(contact_law, springs_forget_the_multiplier) {
  const Augmentation springs{10, 0};
  const ContactPoint a{{5, 7, -3}, {0.3, 0.1, 0.05}, Vec3::Zero()};
  expect_equal(contact_residual(coulomb, a, springs), a.lam - 10 * a.jump);  // stick: |J_t| < F J_n
  const auto l = linearise_contact(coulomb, a, springs);
  EXPECT_EQ(l.d_lam, Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
}

struct DerivativeCase {
  const char* name;
  ContactLaw law;
  ContactPoint at;
  double theta;
  ContactState state;
};
void PrintTo(const DerivativeCase& c, std::ostream* out) { *out << c.name; }

class contact_derivatives : public testing::TestWithParam<DerivativeCase> {};

TEST_P(contact_derivatives, agree_with_differences) {
  const DerivativeCase& c = GetParam();
  const Augmentation by{10, c.theta};
  const auto l = linearise_contact(c.law, c.at, by);
  EXPECT_EQ(l.state, c.state);
  EXPECT_EQ(l.state, contact_state(c.law, c.at, by));
  expect_equal(l.residual, contact_residual(c.law, c.at, by));
  constexpr double h = 1e-6;
  for (int k = 0; k < 3; ++k) {
    ContactPoint more = c.at, less = c.at;
    more.lam[k] += h;
    less.lam[k] -= h;
    const Vec3 by_lam = (contact_residual(c.law, more, by) - contact_residual(c.law, less, by)) / (2 * h);
    EXPECT_LT((by_lam - l.d_lam.col(k)).norm(), 1e-8) << "lam " << k;
    more = less = c.at;
    more.jump[k] += h;
    less.jump[k] -= h;
    const Vec3 by_jump = (contact_residual(c.law, more, by) - contact_residual(c.law, less, by)) / (2 * h);
    EXPECT_LT((by_jump - l.d_jump.col(k)).norm(), 1e-7) << "jump " << k;
  }
}

const ContactPoint stick_point{{8, 1, 0.5}, {0.1, 0.12, 0.1}, {0, 0.05, 0}}, slip_point{{6, 2, -1}, {0.2, 0.4, 0.7}, {0, 0.2, 0.3}},
    open_point{{1, 2, -1}, {-0.3, 0.5, 0.2}, {0, 0.1, 0}};

INSTANTIATE_TEST_SUITE_P(
    away_from_kinks, contact_derivatives,
    testing::Values(DerivativeCase{"coulomb_stick", coulomb, stick_point, 1, ContactState::stick},
                    DerivativeCase{"coulomb_slip", coulomb, slip_point, 1, ContactState::slip},
                    DerivativeCase{"coulomb_open", coulomb, open_point, 1, ContactState::open},
                    DerivativeCase{"tresca_stick", tresca, stick_point, 1, ContactState::stick},
                    DerivativeCase{"tresca_slip", tresca, slip_point, 1, ContactState::slip},
                    DerivativeCase{"tresca_open", tresca, open_point, 1, ContactState::open},
                    DerivativeCase{"frictionless_closed", smooth, slip_point, 1, ContactState::slip},
                    DerivativeCase{"frictionless_open", smooth, open_point, 1, ContactState::open},
                    DerivativeCase{"springs_stick", coulomb, {{1, 0, 0}, {0.9, 0.1, 0.2}, Vec3::Zero()}, 0, ContactState::stick},
                    DerivativeCase{"springs_slip", coulomb, slip_point, 0, ContactState::slip},
                    DerivativeCase{"springs_open", coulomb, open_point, 0, ContactState::open},
                    DerivativeCase{"half_springs_slip", coulomb, slip_point, 0.5, ContactState::slip}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace polyslip::physics
