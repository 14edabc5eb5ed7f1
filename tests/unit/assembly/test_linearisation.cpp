// The Jacobian in its several guises: saddle-point matrix, linear momentum rows, condensed blocks, the line of the line search.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "polyslip/assembly/saddle_matrix.hpp"
#include "polyslip/la/vec_access.hpp"
#include "polyslip/physics/elasticity.hpp"
#include "polyslip/spaces/vem_cell.hpp"
#include "support/contact_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;
using assembly::MechanicsSystem;
using la::VecRead;
using physics::ContactState;
using Content = MechanicsSystem::MatrixContent;

/// A box cut through at x = 1/2, at a random state near which all three contact states occur and no face lies on a kink.
class linearisation : public testing::TestWithParam<std::tuple<Shape, spaces::Bubbles>> {
 protected:
  static constexpr double friction = 0.6;
  Shape shape_ = std::get<0>(GetParam());
  int dim_ = shape_.dim;
  ContactScene scene_{[this] { return fractured_box(shape_, dim_ == 2 ? 6 : 4, 0, 1); },
                      mixed_contact(dim_, friction, std::get<1>(GetParam()))};
  MechanicsSystem& system_ = *scene_.system;

  void SetUp() override {
    const la::Handle<Vec> disturbance = random_vector(system_, 1, 0.1);
    POLYSLIP_PETSC(VecAXPY(scene_.x, 1.0, disturbance));
    system_.set_previous_jumps(random_vector(system_, 2, 0.01));
    choose_states();
    for (long long n : scene_.counts()) ASSERT_GT(n, 0) << "a contact state is missing";
  }
  /// Gives the faces the three states in turn, by multipliers that bring lam + beta (J - J^{n-1}) where it must be.
  void choose_states() {
    assembly::MechanicalState state = system_.layout().create_state();
    system_.layout().gather(scene_.x, state);
    const la::VecWrite a(scene_.x);
    for (Index f = 0; f < scene_.mesh.fractures.owned; ++f) {
      const auto turn = scene_.mesh.fractures.global(f) % 3;
      Vec3 z(turn == 0 ? -0.3 : 0.3, 0.1, -0.05);
      if (turn == 2) z.tail<2>() *= 4 * friction;
      const Vec3 previous(0, system_.previous_jumps()[f][1], system_.previous_jumps()[f][2]);
      const double beta = system_.beta_scale() * system_.contact_cells().faces()[f].stiffness;
      const Vec3 lam = z - beta * (system_.contact_cells().jump(f, state) - previous);
      for (int i = 0; i < dim_; ++i) a[system_.layout().multiplier_start() + dim_ * f + i] = lam[i];
    }
  }
  [[nodiscard]] la::Handle<Vec> vector() const { return system_.layout().create_vector(); }
  [[nodiscard]] la::Handle<Vec> residual(Vec x) const {
    la::Handle<Vec> f = vector();
    system_.residual(x, f);
    return f;
  }
  /// x + s y
  [[nodiscard]] la::Handle<Vec> along(double s, Vec y) const {
    la::Handle<Vec> v = vector();
    POLYSLIP_PETSC(VecWAXPY(v, s, y, scene_.x));
    return v;
  }
  /// |a - b| over the entries from `first` on, relative to those of b.
  [[nodiscard]] double distance(Vec a, Vec b, Index first, Index end) const {
    const VecRead va(a), vb(b);
    std::array<double, 2> squares{};
    for (Index i = first; i < end; ++i) {
      squares[0] += std::pow(va[i] - vb[i], 2);
      squares[1] += vb[i] * vb[i];
    }
    mpi::sum_in_place(PETSC_COMM_WORLD, squares);
    return std::sqrt(squares[0] / squares[1]);
  }
};

TEST_P(linearisation, saddle_matrix_agrees_with_differences_of_the_residual) {
  la::Handle<Mat> jacobian = assembly::create_saddle_matrix(system_);
  system_.linearise(scene_.x, Content::bulk);
  assembly::fill_saddle_matrix(system_, jacobian);
  for (unsigned seed : {11U, 12U, 13U}) {
    const la::Handle<Vec> y = random_vector(system_, seed);
    la::Handle<Vec> product = vector();
    POLYSLIP_PETSC(MatMult(jacobian, y, product));
    constexpr double h = 1e-6;
    la::Handle<Vec> difference = residual(along(h, y));
    POLYSLIP_PETSC(VecAXPY(difference, -1.0, residual(along(-h, y))));
    POLYSLIP_PETSC(VecScale(difference, 0.5 / h));
    const assembly::Layout& l = system_.layout();
    EXPECT_LT(distance(product, difference, 0, l.bubble_start()), 1e-8) << "nodal rows";
    EXPECT_LT(distance(product, difference, l.bubble_start(), l.multiplier_start()), 1e-8) << "bubble rows";
    EXPECT_LT(distance(product, difference, l.multiplier_start(), l.size()), 1e-7) << "contact rows";
  }
}

TEST_P(linearisation, momentum_action_is_linear_and_the_difference_of_residuals) {
  for (Content content : {Content::bulk, Content::symmetric, Content::exact}) {
    system_.linearise(scene_.x, content);
    const la::Handle<Vec> y = random_vector(system_, 21);
    la::Handle<Vec> action = vector(), twice = vector(), difference = residual(along(1.0, y));
    system_.momentum_action(y, action);
    POLYSLIP_PETSC(VecAXPY(difference, -1.0, residual(scene_.x)));
    EXPECT_LT(distance(action, difference, 0, system_.layout().multiplier_start()), 1e-13);
    la::Handle<Vec> z = random_vector(system_, 22), action_of_z = vector();
    system_.momentum_action(z, action_of_z);
    POLYSLIP_PETSC(VecAYPX(z, -3.0, y));  // y - 3 z
    system_.momentum_action(z, twice);
    POLYSLIP_PETSC(VecAXPY(action, -3.0, action_of_z));
    EXPECT_LT(distance(twice, action, 0, system_.layout().multiplier_start()), 1e-13);
    const VecRead rows(action);
    for (Index i = system_.layout().multiplier_start(); i < system_.layout().size(); ++i) EXPECT_EQ(rows[i], 0);
  }
}

TEST_P(linearisation, residual_does_not_depend_on_what_the_matrix_holds) {
  system_.linearise(scene_.x, Content::bulk);
  const la::Handle<Vec> expected = residual(scene_.x);
  for (Content content : {Content::symmetric, Content::exact}) {
    system_.linearise(scene_.x, content);
    EXPECT_LT(distance(residual(scene_.x), expected, 0, system_.layout().size()), 1e-13);
  }
}

TEST_P(linearisation, writes_again_only_what_has_changed_and_comes_to_the_matrix_of_a_new_system) {
  const assembly::ContactCells& cells = system_.contact_cells();
  const auto expect_as_new = [&](Content content) {
    MechanicsSystem fresh(scene_.mesh, scene_.problem);
    fresh.set_previous_jumps(system_.previous_jumps());
    fresh.linearise(scene_.x, content);
    PetscBool same = PETSC_FALSE;
    POLYSLIP_PETSC(MatEqual(system_.matrix(), fresh.matrix(), &same));
    EXPECT_TRUE(same);
  };
  system_.linearise(scene_.x, Content::exact);
  for (Content content : {Content::exact, Content::symmetric, Content::symmetric, Content::bulk, Content::exact, Content::symmetric}) {
    const std::vector<ContactState> states = system_.states(scene_.x);
    const auto closed = std::find_if(states.begin(), states.end(), [](ContactState state) { return state != ContactState::open; });
    const auto opened = closed == states.end() ? Index(-1) : static_cast<Index>(closed - states.begin());
    if (opened >= 0) {
      const la::VecWrite a(scene_.x);
      a[system_.layout().multiplier_start() + dim_ * opened] = -10;
    }
    system_.linearise(scene_.x, content);
    for (Index p = 0; p < cells.size(); ++p) {
      const auto faces = cells.faces_of(p);
      if (std::any_of(faces.begin(), faces.end(), [&](Index f) { return f >= scene_.mesh.fractures.owned; })) continue;
      EXPECT_EQ(cells.has_changed(p), std::find(faces.begin(), faces.end(), opened) != faces.end());
    }
    expect_as_new(content);
  }
}

TEST_P(linearisation, writes_what_was_condensed_before_without_being_written) {
  system_.linearise(scene_.x, Content::exact);
  {
    const la::VecWrite a(scene_.x);
    for (Index i = 0; i < system_.layout().fracture_size(); ++i) a[system_.layout().multiplier_start() + i] -= 10;
  }
  system_.condense_contact(scene_.x);
  system_.linearise(scene_.x, Content::exact);
  MechanicsSystem fresh(scene_.mesh, scene_.problem);
  fresh.set_previous_jumps(system_.previous_jumps());
  fresh.linearise(scene_.x, Content::exact);
  PetscBool same = PETSC_FALSE;
  POLYSLIP_PETSC(MatEqual(system_.matrix(), fresh.matrix(), &same));
  EXPECT_TRUE(same);
}

TEST_P(linearisation, jump_is_the_face_mean_of_the_difference_of_sides_plus_the_bubble) {
  // Another affine field on each side; its face means are its values at face centres.
  const AffineField left(dim_);
  const auto right = [](const Vec3& x) { return Vec3(0.1 * x.y(), 0.4 - x.x(), 0); };
  const Vec3 bubble(0.2, -0.3, dim_ == 3 ? 0.5 : 0);
  assembly::MechanicalState state = system_.layout().create_state();
  for (Index copy = 0; copy < scene_.mesh.copies.local(); ++copy) {
    const Vec3& x = scene_.node_of(copy);
    for (int a = 0; a < dim_; ++a)
      state.displacement[system_.layout().of_copy(copy) + a] = (scene_.is_right(copy) ? right(x) : left(x))[a];
  }
  for (std::size_t i = 0; i < state.bubble.size(); ++i) state.bubble[i] = bubble[static_cast<Eigen::Index>(i) % dim_];
  for (Index f = 0; f < scene_.mesh.fractures.owned; ++f) {
    const auto& face = system_.contact_cells().faces()[f];
    const Vec3 expected = face.frame * (left(face.centre) - right(face.centre) + bubble);
    EXPECT_LT((system_.contact_cells().jump(f, state) - expected).norm(), 1e-13);
  }
}

TEST_P(linearisation, condensed_direction_solves_the_saddle_system) {
  // recover(f, nodal) for any nodal part zeroes the bubble and contact rows, and leaves the condensed residual in the nodal rows.
  la::Handle<Mat> jacobian = assembly::create_saddle_matrix(system_);
  system_.linearise(scene_.x, Content::bulk);
  assembly::fill_saddle_matrix(system_, jacobian);
  for (Content content : {Content::symmetric, Content::exact}) {
    system_.linearise(scene_.x, content);
    const la::Handle<Vec> f = residual(scene_.x), y = random_vector(system_, 31);
    la::Handle<Vec> nodal = system_.layout().create_displacement_vector(), direction = vector(), product = vector();
    {
      const VecRead a(y);
      const la::VecWrite b(nodal);
      std::copy_n(a.data(), system_.layout().displacement_size(), b.data());
    }
    system_.recover(f, nodal, direction);
    POLYSLIP_PETSC(MatMult(jacobian, direction, product));
    const assembly::Layout& l = system_.layout();
    EXPECT_LT(distance(product, f, l.bubble_start(), l.size()), 1e-11);

    // Nodal rows: J direction - f = C nodal - (condensed residual)
    la::Handle<Vec> condensed = system_.layout().create_displacement_vector(), rhs = system_.layout().create_displacement_vector();
    system_.apply_condensed(nodal, condensed);
    system_.condense_residual(f, rhs);
    POLYSLIP_PETSC(VecAXPY(condensed, -1.0, rhs));
    POLYSLIP_PETSC(VecAXPY(product, -1.0, f));
    const VecRead a(condensed), b(product);
    std::vector<double> error, size;
    for (Index i = 0; i < l.displacement_size(); ++i) {
      if (system_.fixed()[i]) continue;
      error.push_back(a[i] - b[i]);
      size.push_back(a[i]);
    }
    EXPECT_LT(largest(error), 1e-11 * largest(size));
  }
}

TEST_P(linearisation, residual_follows_where_displacements_move) {
  la::Handle<Vec> d = random_vector(system_, 43, 0.05), x = along(0, d), f = residual(x);
  std::vector<Index> moved;
  {
    const la::VecWrite a(d);
    const assembly::Layout& l = system_.layout();
    for (Index i = 0; i < l.displacement_size(); ++i) {
      const bool moves = l.entity_of(i) < l.owned_entities() / 6;  // and most rows are not near these
      if (!moves || system_.fixed()[i]) a[i] = 0;
      if (moves && (moved.empty() || moved.back() != l.entity_of(i))) moved.push_back(l.entity_of(i));
    }
  }
  system_.move(x, d, moved, f);
  EXPECT_LT(distance(f, residual(along(-1, d)), 0, system_.layout().size()), 1e-13);
  EXPECT_LT(distance(x, along(-1, d), 0, system_.layout().size()), 1e-15);
}

TEST_P(linearisation, products_are_those_of_the_entries_of_the_matrix) {
  la::Handle<Vec> x = system_.layout().create_displacement_vector(), product = system_.layout().create_displacement_vector(),
                  of_entries = system_.layout().create_displacement_vector();
  {
    const la::Handle<Vec> y = random_vector(system_, 37);
    const VecRead a(y);
    const la::VecWrite b(x);
    std::copy_n(a.data(), system_.layout().displacement_size(), b.data());
  }
  system_.hold_all_rows();
  for (bool by_halves : {true, false}) {
    if (!by_halves) system_.multiply_whole_rows();
    for (Content content : {Content::bulk, Content::symmetric, Content::exact}) {
      system_.linearise(scene_.x, content);
      const auto expect_same = [&] { EXPECT_LT(distance(product, of_entries, 0, system_.layout().displacement_size()), 1e-14) << by_halves; };
      la::Handle<Mat> entries;
      POLYSLIP_PETSC(MatDuplicate(system_.matrix(), MAT_COPY_VALUES, entries.put()));  // with the operations of PETSc
      POLYSLIP_PETSC(MatMult(entries, x, of_entries));
      POLYSLIP_PETSC(MatMult(system_.matrix(), x, product));
      expect_same();
      POLYSLIP_PETSC(MatMultAdd(entries, x, x, of_entries));
      POLYSLIP_PETSC(MatMultAdd(system_.matrix(), x, x, product));
      expect_same();
      POLYSLIP_PETSC(MatGetDiagonal(entries, of_entries));
      POLYSLIP_PETSC(MatGetDiagonal(system_.matrix(), product));
      expect_same();
    }
  }
}

TEST_P(linearisation, holds_the_rows_of_plus_cells_and_all_of_them_when_told_whatever_it_is_linearised_at) {
  const auto rows_with_entries = [&] {
    const la::AijRows rows(la::AijParts(system_.matrix()).own);
    std::vector<PetscInt> filled;
    for (PetscInt row = 0; row < rows.rows(); ++row)
      if (rows.offsets()[row + 1] > rows.offsets()[row]) filled.push_back(row);
    return filled;
  };
  EXPECT_EQ(rows_with_entries(), system_.changing_rows());
  MechanicsSystem other(scene_.mesh, scene_.problem);
  other.set_previous_jumps(system_.previous_jumps());
  for (MechanicsSystem* system : {&system_, &other}) {
    system->linearise(scene_.x, Content::exact);
    system->hold_all_rows();  // of the other one before it is linearised again
  }
  other.linearise(scene_.x, Content::bulk);
  other.linearise(scene_.x, Content::exact);
  EXPECT_EQ(static_cast<Index>(rows_with_entries().size()), system_.layout().displacement_size());
  PetscBool same = PETSC_FALSE;
  POLYSLIP_PETSC(MatEqual(system_.matrix(), other.matrix(), &same));
  EXPECT_TRUE(same);
}

TEST_P(linearisation, contact_line_follows_the_full_residual) {
  system_.linearise(scene_.x, Content::symmetric);
  const la::Handle<Vec> y = random_vector(system_, 41, 0.1);
  const auto line = system_.contact_line(scene_.x, y);
  const assembly::Layout& l = system_.layout();
  for (double alpha : {0.0, 0.25, 1.0}) {
    la::Handle<Vec> full = residual(along(-alpha, y)), rows = vector();
    double squares = 0;
    {
      const VecRead f(full);
      for (Index i = l.multiplier_start(); i < l.size(); ++i) squares += f[i] * f[i];
    }
    squares = mpi::sum(PETSC_COMM_WORLD, squares);
    EXPECT_NEAR(system_.contact_merit(line, alpha), squares, 1e-12 * squares);
    system_.set_contact_rows(line, alpha, rows);
    EXPECT_LT(distance(rows, full, l.multiplier_start(), l.size()), 1e-13);
  }
}

INSTANTIATE_TEST_SUITE_P(every_shape, linearisation,
                         testing::Combine(testing::ValuesIn(all_shapes()), testing::Values(spaces::Bubbles::fracture, spaces::Bubbles::all)),
                         ShapeAndBubblesName());

/// Condensed blocks with one contact state on all faces, against the formulas of scheme.md section 6.
class condensed_blocks : public testing::TestWithParam<Shape> {
 protected:
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  ContactScene scene_{[] { return fractured_box(GetParam(), 4, 0.25, 0.75); }, mixed_contact(GetParam().dim)};
  MechanicsSystem& system_ = *scene_.system;
  int dim_ = GetParam().dim;

  /// Multipliers and jumps that put every face in this state.
  void put(ContactState state) {
    const la::VecWrite a(scene_.x);
    const assembly::Layout& l = system_.layout();
    std::fill_n(a.data(), l.size(), 0.0);
    for (Index f = 0; f < l.fracture_size(); f += dim_) {
      a[l.multiplier_start() + f] = state == ContactState::open ? -1 : 1;
      a[l.multiplier_start() + f + 1] = state == ContactState::slip ? 0.8 : 0.1;
    }
  }
  /// The nodal part of a random vector.
  [[nodiscard]] la::Handle<Vec> nodal(unsigned seed) const {
    la::Handle<Vec> v = system_.layout().create_displacement_vector();
    const la::Handle<Vec> all = random_vector(system_, seed);
    const VecRead a(all);
    const la::VecWrite b(v);
    std::copy_n(a.data(), system_.layout().displacement_size(), b.data());
    return v;
  }
  /// What the bulk holds of a + cell, over all n of its external unknowns.
  [[nodiscard]] Eigen::MatrixXd k_ee(Index p, Eigen::Index n) const {
    const Index cell = system_.contact_cells().mesh_cell(p);
    const physics::Lame& lame = system_.moduli()[cell];
    spaces::VemCell vem(scene_.mesh.mesh, spaces::Bubbles::fracture);
    vem.build(cell);
    const Eigen::Index k = vem.components(), own = dim_ * vem.n_nodes();
    std::vector<double> matrix(static_cast<std::size_t>(k * k));
    physics::local_stiffness(dim_, vem, lame, physics::stabilisation_factor(lame, system_.problem().stabilisation), matrix);
    Eigen::MatrixXd result = Eigen::MatrixXd::Zero(n, n);
    result.topLeftCorner(own, own) = Eigen::Map<const RowMajor>(matrix.data(), k, k).topLeftCorner(own, own);
    return result;
  }
  template <class Body>
  void for_each_cell(ContactState state, Body&& body) {
    put(state);
    system_.linearise(scene_.x, Content::exact);
    const auto& cells = system_.contact_cells();
    std::vector<double> block;
    for (Index p = 0; p < cells.size(); ++p) {
      auto blocks = cells.saddle_blocks(p, system_.linearised_law());
      const Eigen::Index n = blocks.ee.rows();
      blocks.ee += k_ee(p, n);
      cells.write_block(p, assembly::ContactCells::Friction::moving, block);
      const Eigen::MatrixXd c = k_ee(p, n) + Eigen::Map<const RowMajor>(block.data(), n, n);
      body(blocks, c);
    }
  }
};

TEST_P(condensed_blocks, agree_with_dense_elimination_in_every_state) {
  for (ContactState state : {ContactState::open, ContactState::stick, ContactState::slip})
    for_each_cell(state, [&](const auto& m, const Eigen::MatrixXd& c) {
      const Eigen::MatrixXd expected = m.ee - m.ei * m.ii.fullPivLu().solve(m.ie);
      EXPECT_LT((c - expected).norm(), 1e-12 * expected.norm());
    });
}

TEST_P(condensed_blocks, are_elasticity_glued_across_the_face_where_it_sticks) {
  for_each_cell(ContactState::stick, [&](const auto& m, const Eigen::MatrixXd& c) {
    // W^T A W with W = [I; -J]; J from the momentum coupling |sigma| j_e R^T and |sigma| R^T.
    const Eigen::Index nb = m.ii.rows() / 2, ne = m.ee.rows();
    const Eigen::MatrixXd j = (m.ei.rightCols(nb) * m.ii.topRightCorner(nb, nb).inverse()).transpose();
    Eigen::MatrixXd a(ne + nb, ne + nb), w(ne + nb, ne);
    a << m.ee, m.ei.leftCols(nb), m.ie.topRows(nb), m.ii.topLeftCorner(nb, nb);
    w << Eigen::MatrixXd::Identity(ne, ne), -j;
    const Eigen::MatrixXd expected = w.transpose() * a * w;
    EXPECT_LT((c - expected).norm(), 1e-12 * expected.norm());
    EXPECT_LT((c - c.transpose()).norm(), 1e-13 * c.norm());
  });
}

TEST_P(condensed_blocks, are_the_schur_complement_of_the_bubbles_where_the_face_is_open) {
  for_each_cell(ContactState::open, [&](const auto& m, const Eigen::MatrixXd& c) {
    const Eigen::Index nb = m.ii.rows() / 2;
    const Eigen::MatrixXd expected = m.ee - m.ei.leftCols(nb) * m.ii.topLeftCorner(nb, nb).ldlt().solve(m.ie.topRows(nb));
    EXPECT_LT((c - expected).norm(), 1e-12 * expected.norm());
    EXPECT_LT((c - c.transpose()).norm(), 1e-13 * c.norm());
  });
}

TEST_P(condensed_blocks, are_symmetric_only_without_frictional_slip) {
  const auto asymmetry = [&] {  // |y.Px - x.Py| / |y.Px|, on free components
    la::Handle<Vec> x = nodal(51), y = nodal(52), product = system_.layout().create_displacement_vector();
    PetscScalar yx = 0, xy = 0;
    POLYSLIP_PETSC(MatMult(system_.matrix(), x, product));
    POLYSLIP_PETSC(VecDot(product, y, &yx));
    POLYSLIP_PETSC(MatMult(system_.matrix(), y, product));
    POLYSLIP_PETSC(VecDot(product, x, &xy));
    return std::abs(yx - xy) / std::abs(yx);
  };
  put(ContactState::stick);
  system_.linearise(scene_.x, Content::symmetric);
  EXPECT_TRUE(system_.is_symmetric());
  EXPECT_TRUE(system_.matrix_is_exact());
  EXPECT_LT(asymmetry(), 1e-12);
  put(ContactState::slip);
  system_.linearise(scene_.x, Content::symmetric);
  EXPECT_FALSE(system_.is_symmetric());
  EXPECT_FALSE(system_.matrix_is_exact());
  EXPECT_LT(asymmetry(), 1e-12) << "P holds the friction bounds";
  system_.linearise(scene_.x, Content::exact);
  EXPECT_TRUE(system_.matrix_is_exact());
  EXPECT_GT(asymmetry(), 1e-4);
}

TEST_P(condensed_blocks, made_symmetric_are_those_of_a_friction_bound_that_is_held) {
  ContactScene held([] { return fractured_box(GetParam(), 4, 0.25, 0.75); }, mixed_contact(dim_));
  put(ContactState::slip);
  system_.linearise(scene_.x, Content::symmetric);
  held.system->update_lagged_friction(scene_.x, 1);
  held.system->use_lagged_friction(true);
  held.system->linearise(scene_.x, Content::symmetric);
  EXPECT_TRUE(held.system->is_symmetric());
  la::Handle<Vec> x = nodal(61), with = system_.layout().create_displacement_vector(), without = system_.layout().create_displacement_vector();
  POLYSLIP_PETSC(MatMult(system_.matrix(), x, with));
  POLYSLIP_PETSC(MatMult(held.system->matrix(), x, without));
  POLYSLIP_PETSC(VecAXPY(with, -1.0, without));
  PetscReal difference = 0, size = 0;
  POLYSLIP_PETSC(VecNorm(with, NORM_2, &difference));
  POLYSLIP_PETSC(VecNorm(without, NORM_2, &size));
  EXPECT_LT(difference, 1e-13 * size);
}

INSTANTIATE_TEST_SUITE_P(every_shape, condensed_blocks, testing::ValuesIn(all_shapes()), ShapeName());

}  // namespace
}  // namespace polyslip
