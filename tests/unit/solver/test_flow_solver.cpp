// Flow alone, solved: linear pressures to round-off on every kind of cell, books that balance, orders of convergence.
#include <gtest/gtest.h>

#include "polyslip/common/error.hpp"
#include "polyslip/la/vec_access.hpp"
#include "polyslip/solver/flow_solver.hpp"
#include "support/contact_scene.hpp"
#include "support/flow_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;
using physics::FlowProblem;
using physics::FlowSource;

auto crossed(const Shape& shape, Index n = 4) {
  return [=] { return crossed_box(shape, n); };
}

/// One step; it must converge.
void solve(FlowScene& scene) {
  solver::FlowSolver solver(*scene.system);
  const auto step = solver.step(scene.q);
  ASSERT_TRUE(step.converged) << step.message;
}

class flow_patches : public testing::TestWithParam<Shape> {
 protected:
  int dim_ = GetParam().dim;
  Vec3 g_{0.4, -1.3, dim_ == 3 ? 0.7 : 0.0};
  Vec3 flux_ = -tilted_permeability(dim_) / viscosity * g_;
};

TEST_P(flow_patches, linear_pressure_is_exact_with_anisotropic_permeability) {
  FlowProblem problem = flow_problem(dim_);
  problem.boundary = {given_pressure("all", linear(2, g_)), given_flux("right", fmt::format("{:.17g}", flux_.x()))};
  FlowScene scene(
      [&] {
        mesh::PolyMesh mesh = mesh::make_box(unit_box(GetParam(), 3));
        mesh::build_copies(mesh);
        return mesh;
      },
      problem);
  solve(scene);
  la::Handle<Vec> error = scene.interpolate([&](const Vec3& x, int) { return 2 + g_.dot(x); });
  POLYSLIP_PETSC(VecAXPY(error, -1.0, scene.q));
  EXPECT_LT(largest_entry(error), 1e-12);
  const auto fluxes = assembly::cell_fluxes(*scene.system, scene.q);
  for (std::size_t k = 0; k < fluxes.size(); k += 3)
    EXPECT_LT((Vec3(fluxes[k], fluxes[k + 1], fluxes[k + 2]) - flux_).norm(), 1e-12);
  physics::ExactFlow exact{expression(linear(2, g_)), {}};
  exact.flux.emplace();
  for (int a = 0; a < 3; ++a) (*exact.flux)[a] = Expression(flux_[a]);
  const auto norms = assembly::flow_error_norms(*scene.system, exact, 0, scene.q);
  EXPECT_LT(*norms.pressure, 1e-12);
  EXPECT_LT(*norms.flux, 1e-12);
}

/// Pressure linear on both sides of a fracture through the whole box: the flow across it costs q/T_f on each side.
struct SeriesCase {
  double aperture, normal_permeability;
};

class flow_series : public testing::TestWithParam<std::tuple<Shape, SeriesCase>> {};

TEST_P(flow_series, pressure_drops_by_flux_over_transmissivity_on_each_side_of_a_fracture) {
  const auto& [shape, series] = GetParam();
  const int dim = shape.dim;
  const Vec3 g(0.4, -1.3, dim == 3 ? 0.7 : 0.0);
  const Vec3 flux = -tilted_permeability(dim) / viscosity * g;
  const double T_f = 2 * series.normal_permeability / (viscosity * series.aperture), drop = flux.x() / T_f;
  const auto exact = [&](const Vec3& x) {
    return 2 + g.dot(x) - (x.x() < 0.5 - 1e-12 ? 0.0 : x.x() > 0.5 + 1e-12 ? 2 * drop : drop);
  };
  FlowProblem problem = flow_problem(dim);
  problem.fractures = {fracture(fmt::format("{:.17g}", series.aperture), {}, series.normal_permeability)};
  problem.boundary = {given_pressure(
      "all", fmt::format("{} - (x < 0.5 - 1e-12 ? 0 : (x > 0.5 + 1e-12 ? {:.17g} : {:.17g}))", linear(2, g), 2 * drop, drop))};
  FlowScene scene([shape = shape] { return fractured_box(shape, 4, 0, 1); }, problem);
  ASSERT_GT(scene.mesh.fractures.total, 0);
  solve(scene);
  const auto points = scene.points_by_side();
  const la::VecRead q(scene.q);
  for (Index i = 0; i < scene.system->layout().size(); ++i) {
    // A side's place is that of its face, moved a hair.
    const double hair = g.dot(points[i] - scene.point(i)), from = scene.system->fluxes().is_drop(i) ? exact(scene.point(i)) : 0.0;
    EXPECT_NEAR(q[i] + scene.system->reference()[i], exact(points[i]) - hair - from, 1e-12 * std::max(1.0, std::abs(drop)));
  }
  const auto rock_fluxes = assembly::cell_fluxes(*scene.system, scene.q);
  for (std::size_t k = 0; k < rock_fluxes.size(); k += 3)
    EXPECT_LT((Vec3(rock_fluxes[k], rock_fluxes[k + 1], rock_fluxes[k + 2]) - flux).norm(), 1e-11 * std::max(1.0, std::abs(drop)));
  const Vec3 along = -series.aperture * Vec3(0, g.y(), g.z());
  const auto fluxes = assembly::fracture_fluxes(*scene.system, scene.q);
  const double C = series.aperture * series.aperture / 12 / viscosity;
  for (std::size_t k = 0; k < fluxes.size(); k += 3)
    EXPECT_LT((Vec3(fluxes[k], fluxes[k + 1], fluxes[k + 2]) - C * along).norm(), 1e-11 * C);
}

struct SeriesName {
  template <class Info>
  std::string operator()(const Info& info) const {
    const Shape& shape = std::get<0>(info.param);
    return shape.name + std::to_string(shape.dim) +
           (std::get<1>(info.param).normal_permeability < 1 ? "d_blocking" : "d_conductive");
  }
};

INSTANTIATE_TEST_SUITE_P(every_planar_shape, flow_series,
                         testing::Combine(testing::ValuesIn(planar_shapes()),
                                          testing::Values(SeriesCase{1e-2, 1e-6}, SeriesCase{1e-1, 1e2})),
                         SeriesName());

/// Pressures along the fracture y = 1/2 between 1 on the left and 0 on the right, where hardly any fluid enters the rock and the
/// fracture x = 1/2, itself of little permeability, crosses it.
std::vector<std::pair<double, double>> pressures_along_a_crossed_fracture(const Shape& shape, bool barrier) {
  FlowProblem problem = flow_problem(2);
  problem.fractures = {fracture("1e-3", 1.0, 1e-15), fracture("1e-3", 1e-9, 1e-15)};
  problem.fractures[1].fracture = "across_x";
  problem.fractures[1].barrier = barrier;
  problem.boundary = {given_pressure("left", "1"), given_pressure("right", "0")};
  FlowScene scene(crossed(shape), problem);
  solve(scene);
  const auto books = scene.system->balance(scene.q, scene.q);
  EXPECT_LT(std::abs(books.error()), 1e-12 * books.turnover);
  const auto pressures = assembly::fracture_pressures(*scene.system, scene.q);
  const auto fluxes = assembly::fracture_fluxes(*scene.system, scene.q);
  std::vector<std::pair<double, double>> found;
  for (Index f = 0; f < scene.mesh.fractures.owned; ++f) {
    const Vec3& x = scene.point(scene.system->layout().fracture(f));
    if (std::abs(x.y() - 0.5) > 1e-9) continue;
    found.emplace_back(x.x(), pressures[f]);
    EXPECT_NEAR(fluxes[3 * static_cast<std::size_t>(f)], barrier ? 0 : 1e-3 / viscosity, 1e-6 * 1e-3 / viscosity);
  }
  EXPECT_EQ(mpi::sum(PETSC_COMM_WORLD, static_cast<long long>(found.size())), 4);
  return found;
}

TEST(flow_crossings, conduct_along_fractures_but_where_a_barrier_takes_part) {
  for (const char* shape : {"quads", "triangles"}) {
    for (const auto& [x, p] : pressures_along_a_crossed_fracture({2, shape}, false)) EXPECT_NEAR(p, 1 - x, 1e-6);
    for (const auto& [x, p] : pressures_along_a_crossed_fracture({2, shape}, true)) EXPECT_NEAR(p, x < 0.5 ? 1 : 0, 1e-6);
  }
}

TEST_P(flow_patches, named_parts_of_the_boundary_tell_their_outflow_and_mean_pressure) {
  // Linear pressure 2 + g.x along a fracture through the box that takes part in the flow.
  const Vec3 g(0, -1.3, 0);
  FlowProblem problem = flow_problem(dim_);
  problem.materials = {rock(Eigen::Matrix3d(4e-3 * Eigen::Matrix3d::Identity()))};
  problem.fractures = {fracture("0.1", 0.5, 1.0)};
  problem.boundary = {given_pressure("all", linear(2, g)), given_pressure("all", linear(2, g)), given_flux("all", "-4e-3*1.3/2e-3")};
  problem.boundary[1].name = "end";
  problem.boundary[1].where = expression("y > 1 - 1e-9");
  problem.boundary[2].name = "half";
  problem.boundary[2].where = expression("y < 1e-9 && x < 0.5");
  FlowScene scene([shape = GetParam()] { return fractured_box(shape, 4, 0, 1); }, problem);
  solve(scene);
  EXPECT_EQ(assembly::boundary_names(scene.problem), (std::vector<std::string>{"end", "half"}));
  const auto figures = assembly::boundary_figures(*scene.system, scene.q);
  EXPECT_NEAR(figures[0].outflow, 1.3 / viscosity * (4e-3 + 0.5 * 0.1), 1e-10) << "rock and fracture";
  EXPECT_NEAR(figures[0].pressure, 0.7, 1e-12);
  EXPECT_NEAR(figures[1].outflow, -1.3 / viscosity * 4e-3 / 2, 1e-12);
  EXPECT_NEAR(figures[1].pressure, 2, 1e-12);
}

/// A transient problem with all that there is: crossing fractures with tips, wells, sources, boundary pressures and fluxes.
FlowProblem busy(int dim) {
  FlowProblem problem = flow_problem(dim, false);
  problem.fractures = {fracture("0.02 + 0.01*y")};
  problem.fluid_compressibility = 0.4;
  problem.initial_pressure = expression("1 + x*y");
  problem.boundary = {given_pressure("left", "2 + sin(3*y)"), given_flux("right", "-0.1*y")};
  FlowSource well = source(FlowSource::Kind::well, "0.2"), other = well;
  well.at = other.at = {0.3, 0.5, dim == 3 ? 0.5 : 0.0};
  other.on_fracture = "across_y";
  problem.sources = {well, other, source(FlowSource::Kind::matrix, "-0.1*x"), source(FlowSource::Kind::fracture, "0.3")};
  return problem;
}

TEST_P(flow_patches, fluid_balances_in_a_transient_step) {
  FlowScene scene(crossed(GetParam()), busy(dim_));
  la::Handle<Vec> before = scene.system->layout().create_vector();
  solver::FlowSolver solver(*scene.system);
  for (const double dt : {0.05, 0.05, 0.2}) {
    scene.system->set_time_step(dt);
    POLYSLIP_PETSC(VecCopy(scene.q, before));
    ASSERT_TRUE(solver.step(scene.q).converged);
    const auto books = scene.system->balance(scene.q, before);
    EXPECT_LT(std::abs(books.error()), 1e-12 * books.turnover);
    EXPECT_GT(std::abs(books.stored), 1e-3 * books.turnover);
    EXPECT_GT(std::abs(books.outflow), 1e-3 * books.turnover);
    EXPECT_NEAR(books.injected, dt * (0.4 - 0.05 + 0.3 * (dim_ == 2 ? 0.5 + 1 : 0.25 + 1 + 0.25)), 1e-12);
  }
  EXPECT_EQ(solver.counts().setups, 2) << "two steps of the same length share a factorisation";
}

// Rock of 1e-18 m2 and fractures of 2 mm: their sides let through 1e13 times more than the rock.
TEST_P(flow_patches, fluid_balances_with_open_fractures_in_tight_rock) {
  FlowProblem problem = busy(dim_);
  problem.viscosity = 1e-3;
  problem.fluid_compressibility = 4e-10;
  problem.materials = {rock(1e-18 * Eigen::Matrix3d::Identity(), 1e-10)};
  problem.fractures = {fracture("2e-3")};
  problem.initial_pressure = expression("1e7");
  problem.boundary = {given_pressure("left", "1.2e7")};
  for (auto& s : problem.sources) s.rate = expression(fmt::format("1e-12*({})", s.rate.text()));
  FlowScene scene(crossed(GetParam()), problem);
  la::Handle<Vec> before = scene.system->layout().create_vector();
  scene.system->set_time_step(1000);
  POLYSLIP_PETSC(VecCopy(scene.q, before));
  solve(scene);
  const auto books = scene.system->balance(scene.q, before);
  EXPECT_LT(std::abs(books.error()), 3 * scene.system->round_off(scene.q));
  EXPECT_LT(scene.system->round_off(scene.q), 1e-5 * books.turnover) << "pressures of both sides would leave 1e-3";
}

// (q^n.D q^n - q^{n-1}.D q^{n-1} + |q^n - q^{n-1}|_D^2)/2 + dt q^n.H q^n = dt (power of sources and boundaries)
TEST_P(flow_patches, energy_balances_in_a_transient_step) {
  FlowScene scene(crossed(GetParam()), busy(dim_));
  la::Handle<Vec> before = scene.system->layout().create_vector();
  scene.system->set_time_step(0.1);
  POLYSLIP_PETSC(VecCopy(scene.q, before));
  solve(scene);
  const double start = scene.system->stored_energy(before), end = scene.system->stored_energy(scene.q);
  POLYSLIP_PETSC(VecAXPY(before, -1.0, scene.q));
  const double lost = scene.system->stored_energy(before), dissipated = 0.1 * scene.system->fluxes().dissipation(scene.q).total();
  const double work = 0.1 * scene.system->power_input(scene.q);
  EXPECT_NEAR(end - start + lost + dissipated, work, 1e-12 * (start + end + dissipated));
  EXPECT_GT(dissipated, 0.01 * end);
}

TEST_P(flow_patches, pressures_are_the_same_on_any_number_of_ranks) {
  FlowScene scene(crossed(GetParam()), busy(dim_)), alone(crossed(GetParam()), busy(dim_), PETSC_COMM_SELF);
  for (FlowScene* s : {&scene, &alone}) {
    s->system->set_time_step(0.1);
    solve(*s);
  }
  const auto ours = assembly::cell_pressures(*scene.system, scene.q), whole = assembly::cell_pressures(*alone.system, alone.q);
  for (std::size_t c = 0; c < ours.size(); ++c) EXPECT_NEAR(ours[c], whole[scene.mesh.cell_input[c]], 1e-11);
  const auto fractures = assembly::fracture_pressures(*scene.system, scene.q),
             all = assembly::fracture_pressures(*alone.system, alone.q);
  EXPECT_EQ(fractures.size(), static_cast<std::size_t>(scene.mesh.fractures.local()));
  for (std::size_t f = 0; f < fractures.size(); ++f) {
    const auto& input = alone.mesh.fracture_face_input;
    const auto k = std::find(input.begin(), input.end(), scene.mesh.fracture_face_input[f]) - input.begin();
    EXPECT_NEAR(fractures[f], all[k], 1e-11);
  }
}

INSTANTIATE_TEST_SUITE_P(every_planar_shape, flow_patches, testing::ValuesIn(planar_shapes()), ShapeName());

// Fractures whose sides are all but tight carry fluid from the left to the right along a line with two corners: p is linear in the
// length.
TEST(flow_in_fractures, turns_corners) {
  FlowProblem problem = flow_problem(2);
  problem.fractures = {fracture("0.1", {}, 1e-30)};
  problem.boundary = {given_pressure("left", "0"), given_pressure("right", "1.5")};
  FlowScene scene(
      [] {
        mesh::PolyMesh mesh = mesh::make_box(unit_box({2, "quads"}, 8));
        mesh::mark_fractures(mesh, {{"bent", "test", "", {{0, 0.25, 0}, {0.5, 0.25, 0}, {0.5, 0.75, 0}, {1, 0.75, 0}}}});
        mesh::build_copies(mesh);
        return mesh;
      },
      problem);
  solve(scene);
  const auto p = assembly::fracture_pressures(*scene.system, scene.q);
  for (Index f = 0; f < scene.mesh.fractures.owned; ++f) {
    const Vec3& x = scene.point(scene.system->layout().fracture(f));
    EXPECT_NEAR(p[f], x.x() + x.y() - 0.25, 1e-9);
  }
}

// Four equal arms that meet: with 1 at the end of one and 0 at the others the crossing has 1/4.
TEST(flow_in_fractures, splits_at_crossings) {
  FlowProblem problem = flow_problem(2);
  problem.fractures = {fracture("0.1", {}, 1e-30)};
  problem.boundary = {given_pressure("all", "0"), given_pressure("left", "1")};
  FlowScene scene(
      [] {
        mesh::PolyMesh mesh = mesh::make_box(unit_box({2, "quads"}, 8));
        mesh::mark_fractures(mesh, {{"a", "test", "", {{0, 0.5, 0}, {1, 0.5, 0}}}, {"b", "test", "", {{0.5, 0, 0}, {0.5, 1, 0}}}});
        mesh::build_copies(mesh);
        return mesh;
      },
      problem);
  solve(scene);
  double crossings = 0;
  const la::VecRead q(scene.q);
  for (Index r = 0; r < scene.mesh.flow.ridges.owned; ++r) {
    const Index i = scene.system->layout().ridge(r);
    if ((scene.point(i) - Vec3(0.5, 0.5, 0)).norm() > 1e-12) continue;
    ++crossings;
    EXPECT_NEAR(q[i], 0.25, 1e-9);
  }
  EXPECT_EQ(mpi::sum(PETSC_COMM_WORLD, crossings), 1);
}

TEST(flow_solver, multigrid_keeps_the_books_as_well_as_a_factorisation) {
  const ScopedOption multigrid("-pressure_pc_type", "hypre");
  FlowScene scene(crossed({3, "tets"}), busy(3)), direct(crossed({3, "tets"}), busy(3));
  la::Handle<Vec> before = scene.system->layout().create_vector();
  for (FlowScene* s : {&scene, &direct}) s->system->set_time_step(0.1);
  POLYSLIP_PETSC(VecCopy(scene.q, before));
  solver::FlowSolver solver(*scene.system);
  ASSERT_TRUE(solver.step(scene.q).converged);
  EXPECT_GT(solver.counts().iterations, 2);
  EXPECT_EQ(solver.counts().factorisations, 0);
  const auto books = scene.system->balance(scene.q, before);
  EXPECT_LT(std::abs(books.error()), 1e-11 * books.turnover);
  {
    const ScopedOption factorisation("-pressure_pc_type", "cholesky");
    const ScopedOption mumps("-pressure_pc_factor_mat_solver_type", "mumps");
    solve(direct);
  }
  const double size = largest_entry(direct.q);
  POLYSLIP_PETSC(VecAXPY(direct.q, -1.0, scene.q));
  EXPECT_LT(largest_entry(direct.q), 1e-10 * size);
}

TEST(flow_solver, divergence_is_a_result_with_a_remedy) {
  const ScopedOption multigrid("-pressure_pc_type", "jacobi"), short_of("-pressure_ksp_max_it", "2");
  FlowScene scene(crossed({3, "tets"}), busy(3));
  solver::FlowSolver solver(*scene.system);
  const auto step = solver.step(scene.q);
  EXPECT_FALSE(step.converged);
  EXPECT_NE(step.message.find("-pressure_pc_type cholesky"), std::string::npos) << step.message;
}

/// Errors for p = sin(2x + y) cos(x - 2z) + y z with the tilted tensor on a box of n^d cells.
assembly::FlowErrorNorms manufactured(const Shape& shape, Index n) {
  const Eigen::Matrix3d L = tilted_permeability(shape.dim) / viscosity;
  const bool solid = shape.dim == 3;
  const std::string s = "(2*x + y)", c = solid ? "(x - 2*z)" : "x";
  const std::string ss = "sin" + s + "*sin(" + c + ")", sc = "sin" + s + "*cos(" + c + ")", cs = "cos" + s + "*sin(" + c + ")",
                    cc = "cos" + s + "*cos(" + c + ")";
  const std::string p = sc + " + y*z";
  const std::array<std::string, 3> grad{"(2*" + cc + " - " + ss + ")", "(" + cc + " + z)", "(2*" + ss + " + y)"};
  // Second derivatives: xx yy zz xy yz xz.
  const std::array<std::string, 6> second{"(-5*" + sc + " - 4*" + cs + ")", "(-" + sc + ")",      "(-4*" + sc + ")",
                                          "(-2*" + sc + " - " + cs + ")",   "(2*" + cs + " + 1)", "(4*" + cs + " + 2*" + sc + ")"};
  const std::array<double, 6> weights{L(0, 0), L(1, 1), L(2, 2), 2 * L(0, 1), 2 * L(1, 2), 2 * L(0, 2)};
  std::string rate = "0";
  for (std::size_t k = 0; k < 6; ++k) rate += fmt::format(" - {:.17g}*{}", weights[k], second[k]);
  FlowProblem problem = flow_problem(shape.dim);
  problem.boundary = {given_pressure("all", p)};
  problem.sources = {source(FlowSource::Kind::matrix, rate)};
  FlowScene scene(
      [&] {
        mesh::PolyMesh mesh = mesh::make_box(unit_box(shape, n));
        mesh::build_copies(mesh);
        return mesh;
      },
      problem);
  solve(scene);
  physics::ExactFlow exact;
  exact.pressure = expression(p);
  exact.flux.emplace();
  for (int a = 0; a < 3; ++a)
    (*exact.flux)[a] =
        expression(fmt::format("0 - {:.17g}*{} - {:.17g}*{} - {:.17g}*{}", L(a, 0), grad[0], L(a, 1), grad[1], L(a, 2), grad[2]));
  return assembly::flow_error_norms(*scene.system, exact, 0, scene.q);
}

class flow_orders : public testing::TestWithParam<Shape> {};

TEST_P(flow_orders, are_two_for_the_pressure_and_one_for_the_flux) {
  const Index n = GetParam().dim == 2 ? 16 : 8;
  const auto coarse = manufactured(GetParam(), n / 2), fine = manufactured(GetParam(), n);
  const double pressure = std::log2(*coarse.pressure / *fine.pressure), flux = std::log2(*coarse.flux / *fine.flux);
  const bool plane = GetParam().dim == 2;
  EXPECT_GT(pressure, plane ? 1.8 : 1.7);
  EXPECT_LT(pressure, 2.6);
  EXPECT_GT(flux, plane ? 0.95 : 0.85);
  EXPECT_LT(flux, 2.1);
  EXPECT_LT(*fine.pressure, plane ? 0.01 : 0.055);
  EXPECT_LT(*fine.flux, plane ? 0.07 : 0.2);
  RecordProperty("errors_and_orders", fmt::format("{:.3e} {:.3e} {:.2f} {:.2f}", *fine.pressure, *fine.flux, pressure, flux));
}

INSTANTIATE_TEST_SUITE_P(every_planar_shape, flow_orders, testing::ValuesIn(planar_shapes()), ShapeName());

TEST(flow_solver, refuses_problems_that_leave_the_pressure_open) {
  FlowProblem problem = flow_problem(2);
  problem.boundary = {given_flux("left", "1"), given_flux("right", "-1")};
  FlowScene scene(crossed({2, "quads"}), problem);
  EXPECT_THROW(solver::FlowSolver solver(*scene.system), InputError);
}

}  // namespace
}  // namespace polyslip
