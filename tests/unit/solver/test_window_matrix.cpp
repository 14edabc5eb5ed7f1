// Rows and columns of the exact condensed operator against PETSc's of the matrix that holds it.
#include <gtest/gtest.h>
#include <petsc/private/petscimpl.h>  // PetscObjectStateGet

#include <cmath>

#include "polyslip/la/vec_access.hpp"
#include "polyslip/solver/window_matrix.hpp"
#include "support/contact_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;
using Content = assembly::MechanicsSystem::MatrixContent;

struct window_matrix : testing::TestWithParam<std::tuple<Shape, spaces::Bubbles>> {
  const int dim = std::get<0>(GetParam()).dim;
  ContactScene scene{[] { return fractured_box(std::get<0>(GetParam()), std::get<0>(GetParam()).dim == 2 ? 8 : 4, 0, 1); },
                     [this] {
                       auto problem = mixed_contact(dim, 0.6, std::get<1>(GetParam()));
                       problem.boundary.push_back(hold("bottom", {"", "0.1*x"}));  // at + cells, too
                       return problem;
                     }()};
  assembly::MechanicsSystem& system = *scene.system;

  window_matrix() { put(0.3); }
  /// Multipliers and displacements of no order: faces of all states.
  void put(double seed) {
    const la::VecWrite x(scene.x);
    for (Index i = 0; i < system.layout().size(); ++i) x[i] = 0.1 * std::sin(seed + 5.0 * i);
  }
  [[nodiscard]] std::vector<Index> entities(Index first, Index step) const {
    std::vector<Index> chosen;
    for (Index i = first; i < system.layout().owned_entities(); i += step) chosen.push_back(i);
    return chosen;
  }
  void expect_rows_of_the_matrix(Mat found, const std::vector<Index>& chosen) const {
    std::vector<PetscInt> rows;
    for (const Index entity : chosen)
      for (int a = 0; a < system.layout().width(entity); ++a) rows.push_back(system.layout().global(system.layout().first_displacement(entity) + a));
    la::Handle<IS> in_matrix;
    la::Handle<Mat> expected;
    POLYSLIP_PETSC(ISCreateGeneral(PETSC_COMM_WORLD, static_cast<PetscInt>(rows.size()), rows.data(), PETSC_COPY_VALUES, in_matrix.put()));
    POLYSLIP_PETSC(MatCreateSubMatrix(system.matrix(), in_matrix, in_matrix, MAT_INITIAL_MATRIX, expected.put()));
    la::Handle<Vec> x, y, z;
    PetscInt begin = 0;
    POLYSLIP_PETSC(MatCreateVecs(found, x.put(), y.put()));
    POLYSLIP_PETSC(VecDuplicate(y, z.put()));
    POLYSLIP_PETSC(VecGetOwnershipRange(x, &begin, nullptr));
    {
      const la::VecWrite values(x);
      for (std::size_t k = 0; k < rows.size(); ++k) values[static_cast<Index>(k)] = std::cos(1.0 + 3.0 * (static_cast<double>(k) + begin));
    }
    for (const bool is_product : {true, false}) {
      for (const auto& [matrix, to] : {std::pair(expected.get(), y.get()), std::pair(found, z.get())}) {
        if (is_product)
          POLYSLIP_PETSC(MatMult(matrix, x, to));
        else
          POLYSLIP_PETSC(MatGetDiagonal(matrix, to));
      }
      PetscReal size = 0, difference = 0;
      POLYSLIP_PETSC(VecNorm(y, NORM_2, &size));
      POLYSLIP_PETSC(VecAXPY(z, -1, y));
      POLYSLIP_PETSC(VecNorm(z, NORM_2, &difference));
      EXPECT_GT(size, 0);
      EXPECT_LT(difference, 1e-13 * size) << is_product;
    }
  }
};

TEST_P(window_matrix, is_that_of_petsc_for_one_choice_after_the_other_and_follows_the_contact_law) {
  system.hold_all_rows();
  solver::WindowMatrix window(system);
  for (const auto& chosen : {entities(1, 2), entities(0, 1), entities(2, 3), entities(mpi::rank(PETSC_COMM_WORLD) == 0 ? 0 : 1000000, 1)}) {
    put(0.3);
    system.linearise(scene.x, Content::exact);
    window.choose(chosen);
    expect_rows_of_the_matrix(window.get(), chosen);
    PetscObjectState before = 0, after = 0;
    POLYSLIP_PETSC(PetscObjectStateGet(reinterpret_cast<PetscObject>(window.get()), &before));
    put(0.9);
    system.condense_contact(scene.x);
    window.follow();
    POLYSLIP_PETSC(PetscObjectStateGet(reinterpret_cast<PetscObject>(window.get()), &after));
    EXPECT_GT(after, before) << "solvers would keep what they have set up";
    system.linearise(scene.x, Content::exact);
    expect_rows_of_the_matrix(window.get(), chosen);
  }
}

TEST_P(window_matrix, of_all_entities_does_what_the_matrix_does_by_its_own_products) {
  system.hold_all_rows();
  system.linearise(scene.x, Content::exact);
  expect_rows_of_the_matrix(system.matrix(), entities(0, 1));
}

INSTANTIATE_TEST_SUITE_P(every_shape, window_matrix,
                         testing::Combine(testing::ValuesIn(all_shapes()), testing::Values(spaces::Bubbles::fracture, spaces::Bubbles::all)),
                         ShapeAndBubblesName());

}  // namespace
}  // namespace polyslip
