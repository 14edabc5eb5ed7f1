// What is followed over time on a part of the fractures, slipped area and seismic moment: against resolved stresses and sums over faces.
#include "polyslip/assembly/fracture_window.hpp"

#include <gtest/gtest.h>

#include "support/contact_scene.hpp"

namespace polyslip {
namespace {

using namespace tests;

class fracture_window : public testing::TestWithParam<Shape> {
 protected:
  const int dim_ = GetParam().dim;
  std::function<mesh::PolyMesh()> mesh_ = [this] { return fractured_box(GetParam(), 4, 0.25, 0.75); };
  std::vector<std::string> zero_ = std::vector<std::string>(static_cast<std::size_t>(dim_), "0");

  /// A held body with lam_n = 3 and |lam_t| = 0.4 on the fracture; its friction grows with y.
  physics::MechanicsProblem held() const {
    physics::MechanicsProblem problem;
    problem.boundary = {hold("all", zero_)};
    problem.contact = {contact(physics::FrictionLaw::coulomb, 0)};
    problem.contact[0].friction = Expression("1 + y", {}, "test");
    problem.initial_stress.emplace();
    (*problem.initial_stress)[0] = Expression(-3.0);
    (*problem.initial_stress)[3] = Expression(0.4);
    return problem;
  }

  /// A body squeezed a little and sheared along its fracture, which has no friction; half of the body is stiffer.
  physics::MechanicsProblem sheared() const {
    physics::MechanicsProblem problem;
    problem.boundary = {hold("left", zero_), hold("right", {"-0.01", "0.02", dim_ == 3 ? "0.01" : ""})};
    problem.contact = {contact(physics::FrictionLaw::frictionless, 0)};
    problem.materials = {rock(), rock()};
    problem.materials[1].where = Expression("x > 0.5", {}, "test");
    problem.materials[1].first = Expression(3 * mu);
    return problem;
  }
};

TEST_P(fracture_window, reads_the_resolved_stress_and_the_face_nearest_to_sliding) {
  ContactScene scene(mesh_, held());
  ASSERT_TRUE(scene.solve().converged);
  const auto faces = assembly::fracture_values(*scene.system, scene.x);
  const auto of_faces = scene.system->contact_cells().faces();
  std::vector<double> heights;
  double lowest = 1;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    heights.push_back(of_faces[f].centre.y());
    lowest = std::min(lowest, heights.back());
  }
  lowest = mpi::min(PETSC_COMM_WORLD, lowest);
  const assembly::FractureWindow window(scene.mesh, {});
  const auto found = window.values(*scene.system, faces, heights, heights);
  EXPECT_NEAR(window.area(), std::pow(0.5, dim_ - 1), 1e-12);
  EXPECT_NEAR(found.traction_normal, 3, 1e-10);
  EXPECT_NEAR(found.traction_tangential, 0.4, 1e-10);
  EXPECT_NEAR(found.nearest_ratio, 0.4 / 3 / (1 + lowest), 1e-10);
  EXPECT_NEAR(found.nearest_normal, 3, 1e-10);
  EXPECT_NEAR(found.nearest_tangential, 0.4, 1e-10);
  EXPECT_NEAR(found.pressure, 0.5, 1e-10) << "centre of the fracture";
  EXPECT_NEAR(found.aperture, 0.5, 1e-10);
  EXPECT_LT(found.slip, 1e-12);
  const auto dry = window.values(*scene.system, faces, {}, {});
  EXPECT_EQ(dry.pressure, 0);
  EXPECT_EQ(dry.aperture, 0);
}

TEST_P(fracture_window, holds_the_faces_of_its_fracture_where_it_is_said_to_be) {
  ContactScene scene(mesh_, held());
  const assembly::FractureWindow upper(scene.mesh, {.fracture = "upright", .where = Expression("y > 0.5", {}, "test")});
  const assembly::FractureWindow other(scene.mesh, {.fracture = "other", .where = {}});
  EXPECT_EQ(other.area(), 0);
  double area = 0, height = 0;
  const auto faces = assembly::fracture_values(*scene.system, scene.x);
  std::vector<double> heights;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const auto& face = scene.system->contact_cells().faces()[f];
    heights.push_back(face.centre.y());
    if (face.centre.y() <= 0.5) continue;
    area += face.area;
    height += face.area * face.centre.y();
  }
  area = mpi::sum(PETSC_COMM_WORLD, area);
  height = mpi::sum(PETSC_COMM_WORLD, height);
  ASSERT_GT(area, 0);
  EXPECT_NEAR(upper.area(), area, 1e-12);
  EXPECT_NEAR(upper.values(*scene.system, faces, heights, {}).pressure, height / area, 1e-12);
}

TEST_P(fracture_window, area_and_moment_count_the_faces_that_have_slipped) {
  ContactScene stuck(mesh_, held());
  ASSERT_TRUE(stuck.solve().converged);
  EXPECT_EQ(assembly::fracture_extremes(*stuck.system, assembly::fracture_values(*stuck.system, stuck.x)).slipped_area, 0);

  ContactScene scene(mesh_, sheared());
  ASSERT_TRUE(scene.solve().converged);
  const auto faces = assembly::fracture_values(*scene.system, scene.x);
  const auto all = assembly::fracture_extremes(*scene.system, faces);
  EXPECT_GT(all.slip_integral, 1e-4);
  EXPECT_NEAR(all.slipped_area, std::pow(0.5, dim_ - 1), 1e-12);
  EXPECT_NEAR(all.seismic_moment, 2 * mu * all.slip_integral, 1e-12) << "the mean of mu and 3 mu";
  const assembly::FractureWindow window(scene.mesh, {});
  const auto found = window.values(*scene.system, faces, {}, {});
  EXPECT_NEAR(found.slip * window.area(), all.slip_integral, 1e-12);
  EXPECT_EQ(found.nearest_ratio, 0) << "without friction there is no bound";
}

INSTANTIATE_TEST_SUITE_P(every_shape, fracture_window, testing::ValuesIn(all_shapes()), ShapeName());

}  // namespace
}  // namespace polyslip
