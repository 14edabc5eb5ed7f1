// The semi-smooth contact and friction equations of one fracture face (scheme.md section 3), in its frame (n, t_1, t_2).
//
// With z = theta lam + beta (J_n, J_t - J_t^{n-1}):
//   normal       R_n = lam_n - max(0, z_n)
//   tangential   R_t = lam_t - P_a(z_t),   a = F max(0, z_n) (Coulomb), a = g (Tresca), a = 0 (no friction)
// P_a is the projection on the ball of radius a. Contact at z_n >= 0; open below. Stick at |z_t| <= a with a law that has friction.
// R is in Pa. theta = 1 is the law itself, and its solution does not depend on beta. theta = 0 replaces contact by springs of stiffness beta
// (a penalty, Moreau-Yosida regularisation): soft springs let the active set move over many faces in one Newton step.
#pragma once

#include <cmath>

#include "polyslip/common/types.hpp"
#include "polyslip/physics/problem.hpp"

namespace polyslip::physics {

enum class ContactState : char { open = 0, stick = 1, slip = 2 };

/// The law on one face.
struct ContactLaw {
  FrictionLaw kind = FrictionLaw::frictionless;
  double friction = 0;  ///< F [-] or g [Pa]
};

/// Values on one face, in its frame; in 2D the third entry is 0.
struct ContactPoint {
  Vec3 lam;       ///< Multiplier [Pa], lam_n > 0 in compression.
  Vec3 jump;      ///< J_sigma u [m], J_n < 0 where open.
  Vec3 previous;  ///< J_sigma u at the previous time [m]; only its tangential part matters.
};

/// How multiplier and jump are added up in z.
struct Augmentation {
  double beta;       ///< [Pa/m]
  double theta = 1;  ///< 1: the contact law; 0: springs.
};

struct ContactLinearisation {
  Vec3 residual;            ///< R [Pa]
  Eigen::Matrix3d d_lam;    ///< dR/dlam [-]
  Eigen::Matrix3d d_jump;   ///< dR/dJ [Pa/m]
  ContactState state;

  /// Whether it leaves the same entries in a matrix.
  [[nodiscard]] bool has_derivatives_of(const ContactLinearisation& other) const {
    return state == other.state && d_lam == other.d_lam && d_jump == other.d_jump;
  }
};

/// A face this close to its bound (relative) counts as slipping: at the start of a step |z_t| = a up to rounding where it slipped in the
/// last, and its state must not be left to rounding.
inline constexpr double slip_tie = 1e-8;

namespace detail {

struct Augmented {
  Vec3 z;
  double radius;
  double length;  ///< |z_t|
  ContactState state;
};

inline Augmented augment(const ContactLaw& law, const ContactPoint& p, const Augmentation& by) {
  const double beta = by.beta;
  Augmented a;
  a.z = by.theta * p.lam + beta * p.jump;
  a.z[1] -= beta * p.previous[1];
  a.z[2] -= beta * p.previous[2];
  a.length = std::hypot(a.z[1], a.z[2]);
  const double pressing = std::max(0.0, a.z[0]);
  a.radius = law.kind == FrictionLaw::coulomb ? law.friction * pressing : law.kind == FrictionLaw::tresca ? law.friction : 0.0;
  const bool sticks = law.kind != FrictionLaw::frictionless && law.friction > 0 && (a.length <= (1 - slip_tie) * a.radius || a.length == 0);
  a.state = a.z[0] < 0 ? ContactState::open : sticks ? ContactState::stick : ContactState::slip;
  return a;
}

}  // namespace detail

/// R alone.
inline Vec3 contact_residual(const ContactLaw& law, const ContactPoint& p, const Augmentation& by) {
  const auto a = detail::augment(law, p, by);
  Vec3 r = p.lam;
  r[0] -= std::max(0.0, a.z[0]);
  const double shrink = a.length > a.radius ? a.radius / a.length : 1.0;
  r[1] -= shrink * a.z[1];
  r[2] -= shrink * a.z[2];
  return r;
}

/// R and its derivatives; exact away from the kinks z_n = 0 and |z_t| = a, one of the two sides on them.
inline ContactLinearisation linearise_contact(const ContactLaw& law, const ContactPoint& p, const Augmentation& by) {
  const auto a = detail::augment(law, p, by);
  ContactLinearisation l;
  l.state = a.state;
  l.residual = contact_residual(law, p, by);
  Eigen::Matrix3d d_z = Eigen::Matrix3d::Zero();  // derivative of (max(0, z_n), P_a(z_t)) with respect to z
  if (a.z[0] >= 0) d_z(0, 0) = 1;
  if (a.state == ContactState::stick && a.radius > 0) {
    d_z(1, 1) = d_z(2, 2) = 1;
  } else if (a.length == 0 && a.state == ContactState::stick) {
    d_z(1, 1) = d_z(2, 2) = 1;  // z = 0: the stick side of the kink, so that a start from zero glues the faces
  } else if (a.length > 0 && a.radius > 0) {
    const Eigen::Vector2d e(a.z[1] / a.length, a.z[2] / a.length);
    d_z.bottomRightCorner<2, 2>() = std::min(1.0, a.radius / a.length) * (Eigen::Matrix2d::Identity() - e * e.transpose());
    if (law.kind == FrictionLaw::coulomb) d_z.block<2, 1>(1, 0) = law.friction * e;
  }
  l.d_lam = Eigen::Matrix3d::Identity() - by.theta * d_z;
  l.d_jump = -by.beta * d_z;
  return l;
}

/// The state that linearise_contact would use.
inline ContactState contact_state(const ContactLaw& law, const ContactPoint& p, const Augmentation& by) {
  return detail::augment(law, p, by).state;
}

}  // namespace polyslip::physics
