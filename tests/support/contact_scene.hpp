// A mechanical problem with fractures on all ranks of PETSC_COMM_WORLD, ready to be assembled and solved; and the words to state
// one.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "polyslip/assembly/mechanics_fields.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/la/vec_access.hpp"
#include "polyslip/solver/contact_newton.hpp"
#include "polyslip/solver/registration.hpp"
#include "support/boxes.hpp"

namespace polyslip::tests {

inline constexpr double mu = 1.3, lambda = 2.1;  ///< Of `rock` [Pa].

inline physics::ElasticRule rock() {
  physics::ElasticRule rule;
  rule.pair = physics::ElasticRule::Pair::lame;
  rule.first = Expression(mu);
  rule.second = Expression(lambda);
  return rule;
}

/// Displacements on a tag, by component; an empty text leaves the component free.
inline physics::BoundaryRule hold(const std::string& tag, const std::vector<std::string>& displacement) {
  physics::BoundaryRule rule;
  rule.tag = tag;
  for (std::size_t a = 0; a < displacement.size(); ++a)
    if (!displacement[a].empty()) rule.displacement[a] = Expression(displacement[a], {}, "test");
  return rule;
}

inline physics::ContactRule contact(physics::FrictionLaw law, double friction, double pressure = 0) {
  physics::ContactRule rule;
  rule.law = law;
  rule.friction = Expression(friction);
  rule.fracture_pressure = Expression(pressure);
  return rule;
}

/// An affine field as texts of its components.
inline std::vector<std::string> as_text(int dim, const Vec3& constant, const Eigen::Matrix3d& gradient) {
  std::vector<std::string> text;
  for (int a = 0; a < dim; ++a)
    text.push_back(
        fmt::format("{:.17g} + {:.17g}*x + {:.17g}*y + {:.17g}*z", constant[a], gradient(a, 0), gradient(a, 1), gradient(a, 2)));
  return text;
}

/// Sets a PETSc option for the life of the object.
class ScopedOption {
 public:
  ScopedOption(std::string name, const char* value) : name_(std::move(name)) {
    POLYSLIP_PETSC(PetscOptionsSetValue(nullptr, name_.c_str(), value));
  }
  ~ScopedOption() { (void)PetscOptionsClearValue(nullptr, name_.c_str()); }
  ScopedOption(const ScopedOption&) = delete;
  ScopedOption& operator=(const ScopedOption&) = delete;

 private:
  std::string name_;
};

/// Newton's direction at x, to 1e-9.
inline la::Handle<Vec> direction_at(assembly::MechanicsSystem& system, solver::DirectionSolver& linear, Vec x) {
  la::Handle<Vec> f = system.create_vector(), direction = system.create_vector();
  system.residual(x, f);
  system.linearise(x, linear.content());
  linear.matrix_changed(system.states(x), false);
  POLYSLIP_PETSC(linear.solve(f, direction, system.norms(x, f), 1e-9, false, {}));
  return direction;
}

/// Two solvers, whatever they have served before, find the same direction at x: to the bit on up to two ranks, as more add up what they send
/// in the order in which it comes.
inline void expect_same_direction(assembly::MechanicsSystem& system, solver::DirectionSolver& old, solver::DirectionSolver& fresh, Vec x) {
  const la::Handle<Vec> by_old = direction_at(system, old, x), by_fresh = direction_at(system, fresh, x);
  EXPECT_GT(old.last_iterations(), 1);
  EXPECT_EQ(old.last_iterations(), fresh.last_iterations());
  PetscReal difference = 0, size = 0;
  POLYSLIP_PETSC(VecAXPY(by_old, -1.0, by_fresh));
  POLYSLIP_PETSC(VecNorm(by_old, NORM_2, &difference));
  POLYSLIP_PETSC(VecNorm(by_fresh, NORM_2, &size));
  EXPECT_LE(difference, mpi::size(PETSC_COMM_WORLD) > 2 ? 1e-12 * size : 0);
}

class ContactScene {
 public:
  /// `make_mesh` runs on rank 0.
  template <class MakeMesh>
  ContactScene(MakeMesh&& make_mesh, physics::MechanicsProblem stated) : problem(std::move(stated)) {
    mesh::PolyMesh serial;
    mpi::on_root(PETSC_COMM_WORLD, [&] { serial = make_mesh(); });
    mesh::PartitionOptions partition;
    partition.flow = problem.bubbles == spaces::Bubbles::all;
    mesh = mesh::distribute(PETSC_COMM_WORLD, std::move(serial), partition);
    if (problem.materials.empty()) problem.materials = {rock()};
    system = std::make_unique<assembly::MechanicsSystem>(mesh, problem);
    x = system->layout().create_vector();
    system->set_loads(system->load_assembler().at(1.0));
    system->impose_dirichlet(x);
    find_right();
    static const PetscErrorCode registered = solver::register_types();
    POLYSLIP_PETSC(registered);
  }
  ContactScene(const ContactScene&) = delete;
  ContactScene& operator=(const ContactScene&) = delete;

  /// Newton from zero to round-off.
  solver::NewtonResult solve() {
    const ScopedOption tight("-snes_rtol", "1e-13");
    solver::ContactNewton newton(*system);
    return newton.solve(x);
  }
  [[nodiscard]] std::array<long long, 3> counts() const { return system->count(system->states(x)).faces; }
  [[nodiscard]] const Vec3& node_of(Index copy) const { return mesh.mesh.nodes[mesh.mesh.copy_node[copy]]; }
  /// Whether a copy belongs to cells at x > 1/2.
  [[nodiscard]] bool is_right(Index copy) const { return right_[copy] != 0; }

  mesh::DistributedMesh mesh;
  physics::MechanicsProblem problem;
  std::unique_ptr<assembly::MechanicsSystem> system;
  la::Handle<Vec> x;

 private:
  void find_right() {
    right_.assign(static_cast<std::size_t>(mesh.mesh.n_copies()), 0);
    for (Index cell = 0; cell < mesh.mesh.n_cells(); ++cell) {
      double centre = 0;
      for (Index s : mesh.mesh.cell_nodes[cell]) centre += mesh.mesh.nodes[s].x() / mesh.mesh.cell_nodes.row_size(cell);
      for (Index copy : mesh.mesh.copies_of(cell))
        if (centre > 0.5) right_[copy] = 1;
    }
  }
  std::vector<char> right_;
};

/// Largest |v| over all ranks.
inline double largest(std::span<const double> v) {
  double m = 0;
  for (double a : v) m = std::max(m, std::isnan(a) ? INFINITY : std::abs(a));
  return mpi::max(PETSC_COMM_WORLD, m);
}

/// The parts of a vector of unknowns.
struct Parts {
  std::vector<double> nodal, normal_bubble, bubble, multiplier;

  Parts(const assembly::Layout& layout, Vec x) {
    const la::VecRead a(x);
    nodal.assign(a.data(), a.data() + layout.nodal_size());
    normal_bubble.assign(a.data() + layout.nodal_size(), a.data() + layout.displacement_size());
    bubble.assign(a.data() + layout.bubble_start(), a.data() + layout.multiplier_start());
    multiplier.assign(a.data() + layout.multiplier_start(), a.data() + layout.size());
  }
};

/// Uniform numbers in [-1, 1] times `size` in every free unknown, other ones on each rank; prescribed components stay 0.
inline la::Handle<Vec> random_vector(const assembly::MechanicsSystem& system, unsigned seed, double size = 1) {
  la::Handle<Vec> v = system.layout().create_vector();
  std::mt19937 random(seed + 1000 * static_cast<unsigned>(mpi::rank(PETSC_COMM_WORLD)));
  std::uniform_real_distribution<double> value(-size, size);
  const la::VecWrite a(v);
  for (Index i = 0; i < system.layout().size(); ++i)
    a[i] = i < system.layout().displacement_size() && system.fixed()[i] ? 0.0 : value(random);
  return v;
}

/// A box cut through at x = 1/2 whose right end is pressed, turned and sheared so that faces are open, stuck and slipping.
inline physics::MechanicsProblem mixed_contact(int dim, double friction = 0.6, spaces::Bubbles bubbles = spaces::Bubbles::fracture) {
  physics::MechanicsProblem problem;
  problem.bubbles = bubbles;
  problem.boundary = {hold("left", {"0", "0", "0"}), hold("right", {"0.05*(0.35 - y)", "0.006", "0.002*y"})};
  for (auto& rule : problem.boundary)
    if (dim == 2) rule.displacement[2].reset();
  problem.contact = {contact(physics::FrictionLaw::coulomb, friction, 0.001)};
  return problem;
}

}  // namespace polyslip::tests
