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
      const Index faces = system->layout().fracture_size() / system->layout().dim();
      if (faces > 0) disturb(faces / 2);  // on each rank that has some
    }
    void disturb(Index face) {
      const la::VecWrite a(x);
      const int dim = system->layout().dim();
      for (Index k = 0; k < dim; ++k) a[system->layout().multiplier_start() + dim * face + k] += 0.05 * (1 + k);
    }
    double contact_rows() {
      system->residual(x, f);
      return system->norms(x, f).contact;
    }
    /// Nodal unknowns that are not as they were.
    [[nodiscard]] long long moved_here_since(const Parts& was) const {
      const Parts is(system->layout(), x);
      long long moved = 0;
      for (std::size_t i = 0; i < is.nodal.size(); ++i) moved += is.nodal[i] != was.nodal[i] ? 1 : 0;
      return moved;
    }
    [[nodiscard]] long long moved_since(const Parts& was) const { return mpi::sum(PETSC_COMM_WORLD, moved_here_since(was)); }
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
  EXPECT_TRUE(elimination.improve(scene.x, scene.f));
  EXPECT_GT(elimination.steps(), 0);

  la::Handle<Vec> fresh = scene.system->create_vector();
  scene.system->residual(scene.x, fresh);
  POLYSLIP_PETSC(VecAXPY(fresh, -1.0, scene.f));
  EXPECT_LT(norm(fresh), 1e-12 * norm(scene.f)) << "f is not F(x)";
  EXPECT_LT(scene.contact_rows(), (mpi::size(PETSC_COMM_WORLD) == 1 ? 0.02 : 0.05) * before) << "on several ranks several faces are wrong";

  EXPECT_GT(scene.moved_since(was), 0);
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
  EXPECT_GT(near, 0);
  if (mpi::size(PETSC_COMM_WORLD) > 1) return;  // near several faces is most of the rock
  EXPECT_GT(static_cast<double>(far), 1.3 * static_cast<double>(near));
}

TEST_P(nonlinear_elimination, reaches_across_the_borders_of_ranks) {
  if (mpi::size(PETSC_COMM_WORLD) == 1) return;
  const ScopedOption all("-elimination_share", "1");
  Disturbed scene;
  ASSERT_TRUE(scene.solve().converged);
  const Index faces = scene.system->layout().fracture_size() / scene.system->layout().dim();
  const int first = faces > 0 ? mpi::rank(PETSC_COMM_WORLD) : mpi::size(PETSC_COMM_WORLD);
  const bool is_here = -mpi::max(PETSC_COMM_WORLD, -static_cast<double>(first)) == mpi::rank(PETSC_COMM_WORLD);
  for (Index face = 0; is_here && face < faces; ++face) scene.disturb(face);
  const Parts was(scene.system->layout(), scene.x);
  (void)scene.contact_rows();
  EXPECT_TRUE(solver::NonlinearElimination(*scene.system).improve(scene.x, scene.f));
  EXPECT_GT(mpi::sum(PETSC_COMM_WORLD, is_here ? 0LL : scene.moved_here_since(was)), 0) << "windows must not end at borders";
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
