#include <gtest/gtest.h>

#include "polyslip/la/vec_access.hpp"
#include "polyslip/solver/nonlinear_elimination.hpp"
#include "support/contact_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;

struct nonlinear_elimination : testing::TestWithParam<Shape> {
  [[nodiscard]] static mesh::PolyMesh box() { return fractured_box(GetParam(), GetParam().dim == 2 ? 10 : 4, 0, 1); }

  [[nodiscard]] static double norm(Vec v) {
    PetscReal size = 0;
    POLYSLIP_PETSC(VecNorm(v, NORM_2, &size));
    return size;
  }

  /// A solved scene of which the jump, the traction and the surroundings of one face are wrong afterwards.
  struct Disturbed : ContactScene {
    Disturbed() : ContactScene(box, mixed_contact(GetParam().dim)), f(system->create_vector()) {
      converged = solve().converged;
      solved_rows = contact_rows();
      const la::VecWrite a(x);
      const Index face = system->layout().fracture_size() / (2 * system->layout().dim());  // on each rank that has fracture faces
      for (Index k = 0; k < system->layout().dim() && system->layout().fracture_size() > 0; ++k)
        a[system->layout().multiplier_start() + system->layout().dim() * face + k] += 0.05 * (1 + k);
    }
    double contact_rows() {
      system->residual(x, f);
      return system->norms(x, f).contact;
    }
    /// Nodal unknowns that are not as they were.
    [[nodiscard]] long long moved_since(const Parts& was) const {
      const Parts is(system->layout(), x);
      long long moved = 0;
      for (std::size_t i = 0; i < is.nodal.size(); ++i) moved += is.nodal[i] != was.nodal[i] ? 1 : 0;
      return mpi::sum(PETSC_COMM_WORLD, moved);
    }
    [[nodiscard]] long long nodal_unknowns() const { return mpi::sum(PETSC_COMM_WORLD, static_cast<long long>(system->layout().nodal_size())); }

    la::Handle<Vec> f;
    bool converged = false;
    double solved_rows = 0;
  };
};

/// In 3D one ring is most of so few cells.
struct nonlinear_elimination_in_2d : nonlinear_elimination {};

TEST_P(nonlinear_elimination, solves_the_contact_rows_of_a_face_and_moves_only_what_is_near) {
  const ScopedOption all("-elimination_share", "1");
  Disturbed scene;
  ASSERT_TRUE(scene.converged);
  const double before = scene.contact_rows();
  ASSERT_GT(before, 1e3 * scene.solved_rows);
  const Parts was(scene.system->layout(), scene.x);
  solver::NonlinearElimination elimination(*scene.system);
  // At the border of ranks windows end, and may be too small to help.
  const bool is_whole = mpi::size(PETSC_COMM_WORLD) == 1, improved = elimination.improve(scene.x, scene.f);
  EXPECT_TRUE(improved || !is_whole);

  la::Handle<Vec> fresh = scene.system->create_vector();
  scene.system->residual(scene.x, fresh);
  POLYSLIP_PETSC(VecAXPY(fresh, -1.0, scene.f));
  EXPECT_LT(norm(fresh), 1e-12 * norm(scene.f)) << "f is not F(x)";
  EXPECT_LT(scene.contact_rows(), is_whole ? 0.02 * before : improved ? before : (1 + 1e-12) * before);

  EXPECT_EQ(scene.moved_since(was) > 0, improved);
  EXPECT_LT(scene.moved_since(was), scene.nodal_unknowns());
}

TEST_P(nonlinear_elimination_in_2d, takes_rings_as_long_as_the_window_stays_small) {
  const ScopedOption most("-elimination_share", "0.5");
  const auto moved = [](const char* rings) {
    const ScopedOption option("-elimination_rings", rings);
    Disturbed scene;
    const Parts was(scene.system->layout(), scene.x);
    (void)scene.contact_rows();
    (void)solver::NonlinearElimination(*scene.system).improve(scene.x, scene.f);
    EXPECT_LE(static_cast<double>(scene.moved_since(was)), 0.5 * static_cast<double>(scene.nodal_unknowns()));
    return scene.moved_since(was);
  };
  const long long near = moved("1"), far = moved("100");
  if (mpi::size(PETSC_COMM_WORLD) > 1) return;  // windows end at the borders of ranks
  EXPECT_GT(near, 0);
  EXPECT_GT(static_cast<double>(far), 1.3 * static_cast<double>(near));
}

TEST_P(nonlinear_elimination, leaves_x_alone_where_the_window_would_be_too_large) {
  const ScopedOption few("-elimination_share", "1e-3");
  Disturbed scene;
  la::Handle<Vec> before;
  POLYSLIP_PETSC(VecDuplicate(scene.x, before.put()));
  POLYSLIP_PETSC(VecCopy(scene.x, before));
  const double rows = scene.contact_rows();
  EXPECT_FALSE(solver::NonlinearElimination(*scene.system).improve(scene.x, scene.f));
  EXPECT_EQ(scene.contact_rows(), rows);
  POLYSLIP_PETSC(VecAXPY(before, -1.0, scene.x));
  EXPECT_EQ(norm(before), 0);
}

TEST_P(nonlinear_elimination, changes_the_way_and_not_the_solution) {
  ContactScene with(box, mixed_contact(GetParam().dim)), without(box, mixed_contact(GetParam().dim));
  const auto solve = [](ContactScene& scene, const char* share) {
    const ScopedOption option("-elimination_share", share);
    return scene.solve();
  };
  const solver::NewtonResult a = solve(with, "1"), b = solve(without, "0");
  ASSERT_TRUE(a.converged) << a.message;
  ASSERT_TRUE(b.converged) << b.message;
  EXPECT_LE(a.iterations, b.iterations);
  POLYSLIP_PETSC(VecAXPY(with.x, -1.0, without.x));
  EXPECT_LT(norm(with.x), 1e-10 * norm(without.x));
}

std::vector<Shape> shapes_in_2d() {
  std::vector<Shape> shapes = all_shapes();
  std::erase_if(shapes, [](const Shape& shape) { return shape.dim != 2; });
  return shapes;
}

INSTANTIATE_TEST_SUITE_P(every_shape, nonlinear_elimination, testing::ValuesIn(all_shapes()), ShapeName());
INSTANTIATE_TEST_SUITE_P(every_shape, nonlinear_elimination_in_2d, testing::ValuesIn(shapes_in_2d()), ShapeName());

}  // namespace
}  // namespace polyslip
