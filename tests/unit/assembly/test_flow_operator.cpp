// Properties of the flux matrix H and of the step matrix S that hold whatever is solved.
#include <gtest/gtest.h>

#include <random>

#include "polyslip/la/vec_access.hpp"
#include "support/flow_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;
using la::VecRead;
using la::VecWrite;

double frobenius(Mat m) {
  PetscReal norm = 0;
  POLYSLIP_PETSC(MatNorm(m, NORM_FROBENIUS, &norm));
  return norm;
}

double distance(Mat a, Mat b) {
  la::Handle<Mat> difference;
  POLYSLIP_PETSC(MatDuplicate(a, MAT_COPY_VALUES, difference.put()));
  POLYSLIP_PETSC(MatAXPY(difference, -1.0, b, DIFFERENT_NONZERO_PATTERN));
  return frobenius(difference);
}

la::Handle<Mat> transpose(Mat a) {
  la::Handle<Mat> t;
  POLYSLIP_PETSC(MatTranspose(a, MAT_INITIAL_MATRIX, t.put()));
  return t;
}

/// A number that depends on the place and kind of an unknown, not on the ranks.
double wavy(const Vec3& x, int kind) { return std::sin(5 * x.x() + 3 * x.y() - 4 * x.z() + kind); }

/// a.Hb and a.Sb of two wavy vectors: tell operators apart whose unknowns lie on other ranks.
std::array<double, 2> forms(const FlowScene& scene) {
  la::Handle<Vec> a = scene.interpolate(wavy),
                  b = scene.interpolate([](const Vec3&x, int kind) { return wavy(2 * x, kind) + x.x() * x.y(); });
  la::Handle<Vec> y = scene.system->layout().create_vector();
  std::array<double, 2> values{};
  POLYSLIP_PETSC(MatMult(scene.system->fluxes().matrix(), b, y));
  POLYSLIP_PETSC(VecDot(a, y, &values[0]));
  POLYSLIP_PETSC(MatMult(scene.system->matrix(), b, y));
  POLYSLIP_PETSC(VecDot(a, y, &values[1]));
  return values;
}

/// Overwrites the drops in a vector.
void set_drops(const FlowScene& scene, Vec q, double value) {
  const VecWrite a(q);
  for (Index i = 0; i < scene.system->layout().size(); ++i)
    if (scene.system->fluxes().is_drop(i)) a[i] = value;
}

class flow_matrices : public testing::TestWithParam<Shape> {
 protected:
  int dim_ = GetParam().dim;

  [[nodiscard]] physics::FlowProblem problem() const {
    physics::FlowProblem p = flow_problem(dim_, false);
    p.fractures = {fracture("0.05 + 0.03*y")};
    p.fluid_compressibility = 0.4;
    p.boundary = {given_pressure("left", "1 + y")};
    return p;
  }
  [[nodiscard]] auto box() const {
    return [shape = GetParam()] { return crossed_box(shape, 4); };
  }
};

TEST_P(flow_matrices, are_symmetric_and_fluxes_sum_to_zero) {
  FlowScene scene(box(), problem());
  scene.system->set_time_step(0.7);
  const Mat H = scene.system->fluxes().matrix(), S = scene.system->matrix();
  EXPECT_LT(distance(H, transpose(H)), 1e-14 * frobenius(H));
  EXPECT_LT(distance(S, transpose(S)), 1e-14 * frobenius(S));
  la::Handle<Vec> ones = scene.interpolate([](auto&, int) { return 1.0; }), sums = scene.system->layout().create_vector();
  set_drops(scene, ones, 0);
  POLYSLIP_PETSC(MatMult(H, ones, sums));
  EXPECT_LT(largest_entry(sums), 1e-14 * frobenius(H));
}

TEST_P(flow_matrices, dissipate_in_every_part) {
  FlowScene scene(box(), problem());
  la::Handle<Vec> q = scene.interpolate(wavy);
  const auto parts = scene.system->fluxes().dissipation(q);
  EXPECT_GT(parts.matrix, 0);
  EXPECT_GT(parts.interface, 0);
  EXPECT_GT(parts.fracture, 0);
}

TEST_P(flow_matrices, prescribed_unknowns_keep_their_diagonal_alone) {
  FlowScene scene(box(), problem());
  scene.system->set_time_step(0.7);
  EXPECT_GT(scene.system->load_assembler().fixed_total(), dim_ == 2 ? 4 : 16)
      << "traces, and ridges where fractures reach the side";
  la::Handle<Vec> fixed = scene.system->layout().create_vector(), image = scene.system->layout().create_vector();
  la::Handle<Vec> diagonal = scene.system->layout().create_vector();
  {
    const VecWrite a(fixed);
    for (Index i = 0; i < scene.system->layout().size(); ++i) a[i] = scene.system->fixed()[i] ? 2 + i % 5 : 0;
  }
  POLYSLIP_PETSC(MatMult(scene.system->matrix(), fixed, image));
  POLYSLIP_PETSC(MatGetDiagonal(scene.system->matrix(), diagonal));
  la::Handle<Vec> flux_diagonal = scene.system->layout().create_vector();
  POLYSLIP_PETSC(MatGetDiagonal(scene.system->fluxes().matrix(), flux_diagonal));
  const VecRead y(image), d(diagonal), h(flux_diagonal), a(fixed);
  for (Index i = 0; i < scene.system->layout().size(); ++i) {
    EXPECT_EQ(y[i], d[i] * a[i]);
    if (scene.system->fixed()[i]) {
      EXPECT_DOUBLE_EQ(d[i], 0.7 * h[i]);
    }
  }
}

TEST_P(flow_matrices, step_matrix_is_storage_plus_step_times_fluxes) {
  physics::FlowProblem open = problem();
  open.boundary.clear();
  FlowScene scene(box(), open);
  scene.system->set_time_step(3);
  (void)scene.system->matrix();
  scene.system->set_time_step(0.7);
  la::Handle<Vec> q = scene.interpolate(wavy), y = scene.system->layout().create_vector(),
                  z = scene.system->layout().create_vector();
  POLYSLIP_PETSC(MatMult(scene.system->matrix(), q, y));
  POLYSLIP_PETSC(MatMult(scene.system->fluxes().matrix(), q, z));
  POLYSLIP_PETSC(VecScale(z, 0.7));
  {
    const VecWrite sum(z);
    const VecRead a(q), storage(scene.system->storage());
    for (Index i = 0; i < scene.system->layout().size(); ++i) sum[i] += storage[i] * a[i];
  }
  POLYSLIP_PETSC(VecAXPY(z, -1.0, y));
  EXPECT_LT(largest_entry(z), 1e-14 * largest_entry(y));
  PetscReal stored = 0;
  POLYSLIP_PETSC(VecSum(scene.system->storage(), &stored));
  double fractures = 0;
  for (Index f = 0; f < scene.mesh.fractures.owned; ++f)
    fractures += scene.system->fluxes().areas()[f] * scene.system->fractures()[f].contact_aperture * 0.4;
  EXPECT_NEAR(stored, 0.3 /* |Omega|/M */ + mpi::sum(PETSC_COMM_WORLD, fractures), 1e-13);
}

TEST_P(flow_matrices, new_apertures_give_what_a_new_assembly_gives) {
  for (const char* aperture : {"0.0001*(2 + y)", "9 + y"}) {  // all sides carry pressures; all carry drops
    physics::FlowProblem whole = problem(), halved = problem();
    whole.fractures = {fracture(aperture)};
    halved.fractures = {fracture(fmt::format("0.5*({})", aperture))};
    FlowScene scene(box(), whole), fresh(box(), halved);
    const double before = frobenius(scene.system->fluxes().matrix());
    EXPECT_GT(distance(scene.system->fluxes().matrix(), fresh.system->fluxes().matrix()), 1e-6 * before);
    std::vector<double> apertures;
    for (const auto& f : scene.system->fractures()) apertures.push_back(0.5 * f.contact_aperture);
    ASSERT_TRUE(scene.system->set_apertures(apertures));
    EXPECT_LT(distance(scene.system->fluxes().matrix(), fresh.system->fluxes().matrix()), 1e-15 * before);
    EXPECT_LT(distance(scene.system->matrix(), fresh.system->matrix()), 1e-15 * before);
  }
}

TEST_P(flow_matrices, drops_of_conductive_sides_change_the_unknowns_and_not_the_fluxes) {
  physics::FlowProblem tight = problem(), open = problem();
  tight.fractures = {fracture("1e-4")};
  open.fractures = {fracture("9")};
  FlowScene pressures(box(), tight), drops(box(), open);
  ASSERT_TRUE(
      pressures.system->set_apertures(std::vector<double>(static_cast<std::size_t>(pressures.mesh.fractures.local()), 9.0)));
  // The same pressures in both.
  const auto& layout = drops.system->layout();
  la::Handle<Vec> p = pressures.interpolate(wavy), q = layout.create_vector();
  std::vector<double> local(static_cast<std::size_t>(layout.local_size()));
  layout.gather(p, local);
  long long found = 0;
  {
    const VecWrite a(q);
    const VecRead b(p);
    std::vector<double> zero_at_drops = local;
    for (Index i = 0; i < layout.local_size(); ++i)
      if (drops.system->fluxes().is_drop(i)) zero_at_drops[i] = 0;
    for (Index i = 0; i < layout.size(); ++i) {
      a[i] = b[i] - (drops.system->fluxes().is_drop(i) ? drops.system->fluxes().pressure(zero_at_drops, i) : 0.0);
      found += drops.system->fluxes().is_drop(i) && !pressures.system->fluxes().is_drop(i);
    }
  }
  EXPECT_EQ(mpi::sum(PETSC_COMM_WORLD, found), 2LL * drops.mesh.fractures.total);
  layout.gather(q, local);
  const VecRead b(p);
  for (Index i = 0; i < layout.size(); ++i) EXPECT_NEAR(drops.system->fluxes().pressure(local, i), b[i], 1e-15);
  const auto one = pressures.system->fluxes().dissipation(p), other = drops.system->fluxes().dissipation(q);
  EXPECT_NEAR(one.matrix, other.matrix, 1e-10 * one.total());
  EXPECT_NEAR(one.interface, other.interface, 1e-13 * one.total());
  EXPECT_NEAR(one.fracture, other.fracture, 1e-13 * one.total());
}

TEST_P(flow_matrices, are_the_same_on_any_number_of_ranks) {
  FlowScene scene(box(), problem()), alone(box(), problem(), PETSC_COMM_SELF);
  EXPECT_EQ(scene.system->layout().numbering().total, alone.system->layout().numbering().total);
  EXPECT_EQ(scene.system->load_assembler().fixed_total(), alone.system->load_assembler().fixed_total());
  const auto ours = forms(scene), whole = forms(alone);
  for (std::size_t k = 0; k < 2; ++k) EXPECT_NEAR(ours[k], whole[k], 1e-13 * frobenius(scene.system->fluxes().matrix()));
  EXPECT_NEAR(frobenius(scene.system->matrix()), frobenius(alone.system->matrix()), 1e-13 * frobenius(alone.system->matrix()));
}

TEST_P(flow_matrices, aperture_derivatives_are_those_of_the_fluxes) {
  FlowScene scene(box(), problem());
  const assembly::FlowLayout& layout = scene.system->layout();
  la::Handle<Vec> q = scene.interpolate(wavy), up = layout.create_vector(), down = layout.create_vector();
  std::vector<double> local(static_cast<std::size_t>(layout.local_size())), expected(static_cast<std::size_t>(layout.size()));
  layout.gather(q, local);
  // Along a direction with another size on each face.
  std::vector<double> contact, direction, rise, fall;
  std::vector<Index> rows;
  std::vector<double> values;
  for (Index f = 0; f < scene.mesh.fractures.local(); ++f) {
    const double d = scene.system->fractures()[f].contact_aperture, change = 1e-5 * (1 + scene.mesh.fracture_face_input[f] % 3);
    contact.push_back(d);
    rise.push_back(d + change);
    fall.push_back(d - change);
    scene.system->fluxes().aperture_derivative(f, local, rows, values);
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (rows[i] < layout.size()) expected[rows[i]] += 2 * change * values[i];
  }
  ASSERT_TRUE(scene.system->set_conducting_apertures(rise));
  POLYSLIP_PETSC(MatMult(scene.system->fluxes().matrix(), q, up));
  ASSERT_TRUE(scene.system->set_conducting_apertures(fall));
  POLYSLIP_PETSC(MatMult(scene.system->fluxes().matrix(), q, down));
  POLYSLIP_PETSC(VecAXPY(up, -1.0, down));
  const double size = largest_entry(up);
  const VecRead change(up);
  for (Index i = 0; i < layout.size(); ++i) EXPECT_NEAR(change[i], expected[i], 1e-6 * size);
  EXPECT_GT(size, 1e-7);
}

INSTANTIATE_TEST_SUITE_P(every_planar_shape, flow_matrices, testing::ValuesIn(planar_shapes()), ShapeName());

TEST(flow_system, apertures_that_are_not_positive_change_nothing_and_all_ranks_know) {
  physics::FlowProblem problem = flow_problem(2);
  problem.fractures = {fracture("0.05")};
  FlowScene scene([] { return crossed_box({2, "quads"}, 4); }, problem);
  std::vector<double> apertures(static_cast<std::size_t>(scene.mesh.fractures.local()), 0.04);
  if (scene.mesh.fractures.owned > 0 && scene.mesh.fractures.first == 0) apertures[0] = 0;
  const double before = frobenius(scene.system->matrix());
  EXPECT_FALSE(scene.system->set_apertures(apertures));
  EXPECT_EQ(frobenius(scene.system->matrix()), before);
}

TEST(flow_system, matrix_changes_only_with_apertures_and_time_step) {
  physics::FlowProblem problem = flow_problem(2, false);
  problem.fractures = {fracture("0.05")};
  FlowScene scene([] { return crossed_box({2, "quads"}, 4); }, problem);
  const auto version = [&] {
    (void)scene.system->matrix();
    return scene.system->matrix_version();
  };
  const std::vector<double> same(static_cast<std::size_t>(scene.mesh.fractures.local()), 0.05);
  const long long first = version();
  scene.system->set_time_step(1);
  ASSERT_TRUE(scene.system->set_apertures(same));
  EXPECT_EQ(version(), first);
  scene.system->set_time_step(2);
  EXPECT_EQ(version(), first + 1);
  ASSERT_TRUE(scene.system->set_apertures(std::vector<double>(same.size(), 0.06)));
  EXPECT_EQ(version(), first + 2);
}

TEST(flow_system, fractures_without_properties_are_walls) {
  FlowScene scene([] { return crossed_box({2, "quads"}, 4); }, flow_problem(2));
  const auto& layout = scene.system->layout();
  EXPECT_EQ(layout.numbering().total, scene.mesh.cells.total + scene.mesh.flow.traces.total);
  EXPECT_TRUE(assembly::fracture_pressures(*scene.system, scene.q).empty());
  const auto parts = scene.system->fluxes().dissipation(scene.interpolate(wavy));
  EXPECT_EQ(parts.interface, 0);
}

}  // namespace
}  // namespace polyslip
