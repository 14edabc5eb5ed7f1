// A flow problem on all ranks of PETSC_COMM_WORLD, ready to be assembled and solved; and the words to state one.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <memory>

#include "polyslip/assembly/flow_fields.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/la/vec_access.hpp"
#include "support/flow_shapes.hpp"

namespace polyslip::tests {

inline constexpr double viscosity = 2e-3;  ///< Of the fluid in the problems below [Pa s].

inline Expression expression(const std::string& text) { return Expression(text, {}, "test"); }

/// A permeability with contrast 20 along axes that fit no mesh [m2].
inline Eigen::Matrix3d tilted_permeability(int dim) {
  const Vec3 axis = dim == 2 ? Vec3(0, 0, 1) : Vec3(1, 2, -0.5).normalized();
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.6, axis).toRotationMatrix();
  return turn * Vec3(4e-3, 2e-4, dim == 2 ? 0.0 : 1e-3).asDiagonal() * turn.transpose();
}

inline physics::HydraulicRule rock(const Eigen::Matrix3d& K, double inverse_modulus = 0) {
  physics::HydraulicRule rule;
  rule.permeability = {Expression(K(0, 0)), Expression(K(1, 1)), Expression(K(2, 2)),
                       Expression(K(0, 1)), Expression(K(1, 2)), Expression(K(0, 2))};
  rule.inverse_modulus = Expression(inverse_modulus);
  return rule;
}

/// A fracture of uniform aperture with the cubic law, or with given permeabilities along (K_f) and across (K_fn).
inline physics::FractureFlowRule fracture(const std::string& aperture, std::optional<double> along = {},
                                          std::optional<double> across = {}) {
  physics::FractureFlowRule rule;
  rule.contact_aperture = expression(aperture);
  if (along) rule.permeability = Expression(*along);
  if (across) rule.normal_permeability = Expression(*across);
  return rule;
}

inline physics::FlowBoundaryRule given_pressure(const std::string& tag, const std::string& p) {
  physics::FlowBoundaryRule rule;
  rule.tag = tag;
  rule.pressure = expression(p);
  return rule;
}

inline physics::FlowBoundaryRule given_flux(const std::string& tag, const std::string& flux) {
  physics::FlowBoundaryRule rule;
  rule.tag = tag;
  rule.flux = expression(flux);
  return rule;
}

inline physics::FlowSource source(physics::FlowSource::Kind kind, const std::string& rate) {
  physics::FlowSource s;
  s.kind = kind;
  s.rate = expression(rate);
  return s;
}

inline physics::FlowProblem flow_problem(int dim, bool stationary = true) {
  physics::FlowProblem problem;
  problem.viscosity = viscosity;
  problem.stationary = stationary;
  problem.materials = {rock(tilted_permeability(dim), 0.3)};
  return problem;
}

/// p_0 + g.x as a text.
inline std::string linear(double p_0, const Vec3& g) {
  return fmt::format("({:.17g} + {:.17g}*x + {:.17g}*y + {:.17g}*z)", p_0, g.x(), g.y(), g.z());
}

class FlowScene {
 public:
  /// `make_mesh` runs on rank 0.
  template <class MakeMesh>
  FlowScene(MakeMesh&& make_mesh, physics::FlowProblem stated, MPI_Comm comm = PETSC_COMM_WORLD) : problem(std::move(stated)) {
    mesh::PolyMesh serial;
    mpi::on_root(comm, [&] { serial = make_mesh(); });
    mesh::PartitionOptions options;
    options.flow = true;
    mesh = mesh::distribute(comm, std::move(serial), options);
    system = std::make_unique<assembly::FlowSystem>(mesh, problem);
    system->set_loads(system->load_assembler().at(0));
    q = system->layout().create_vector();
    system->set_initial(0, q);
    system->impose(q);
  }
  FlowScene(const FlowScene&) = delete;
  FlowScene& operator=(const FlowScene&) = delete;

  /// A Vec with f(place, kind) in every unknown; kind 0 cell, 1 trace, 2 fracture face, 3 ridge.
  template <class Function>
  la::Handle<Vec> interpolate(Function&& f) const {
    la::Handle<Vec> v = system->layout().create_vector();
    const la::VecWrite a(v);
    const std::array<Index, 4> ends{mesh.cells.owned, mesh.cells.owned + mesh.flow.traces.owned,
                                    mesh.cells.owned + mesh.flow.traces.owned + mesh.fractures.owned, system->layout().size()};
    for (Index i = 0, kind = 0; i < system->layout().size(); ++i) {
      while (i >= ends[kind]) ++kind;
      a[i] = f(point(i), static_cast<int>(kind));
    }
    return v;
  }
  [[nodiscard]] const Vec3& point(Index unknown) const { return system->fluxes().points()[unknown]; }

  /// The place of each owned unknown, moved a hair towards the cell that sees a trace: tells the sides of a fracture apart.
  [[nodiscard]] std::vector<Vec3> points_by_side() const {
    std::vector<Vec3> points(system->fluxes().points().begin(), system->fluxes().points().end());
    for (Index face = 0; face < mesh.mesh.n_faces(); ++face)
      for (int side = 0; side < 2; ++side) {
        const Index trace = mesh.flow.face_traces[face][side], cell = mesh.mesh.face_cells[face][side];
        if (trace < 0 || cell < 0 || trace >= mesh.flow.traces.owned || !mesh.mesh.on_fracture(face)) continue;
        Vec3& x = points[system->layout().trace(trace)];
        x += 1e-9 * (mesh::cell_node_average(mesh.mesh, cell) - x);
      }
    return points;
  }

  mesh::DistributedMesh mesh;
  physics::FlowProblem problem;
  std::unique_ptr<assembly::FlowSystem> system;
  la::Handle<Vec> q;
};

/// Largest |v| over all ranks.
inline double largest_entry(Vec v) {
  PetscReal norm = 0;
  POLYSLIP_PETSC(VecNorm(v, NORM_INFINITY, &norm));
  return norm;
}

/// The unit box with fractures on x = 1/2 and (2D) y = 1/2 or (3D) y = 1/2 and z = 1/2 that cross; on grids with an even count.
inline mesh::PolyMesh crossed_box(const Shape& shape, Index n) {
  mesh::BoxSpec spec = unit_box(shape, n);
  std::vector<mesh::FractureGeometry> fractures;
  for (int axis = 0; axis < shape.dim; ++axis) spec.kept_planes.emplace_back(axis, 0.5);
  for (int axis = 0; axis < shape.dim; ++axis)
    for (double end : {0.25, 0.75}) spec.kept_planes.emplace_back(axis, end);
  mesh::PolyMesh mesh = mesh::make_box(spec);
  for (int axis = 0; axis < shape.dim; ++axis) {
    mesh::FractureGeometry f = upright_fracture(shape.dim, 0.5, axis == 1 ? 0.0 : 0.25, axis == 1 ? 1.0 : 0.75);
    f.name = std::string("across_") + "xyz"[axis];
    for (Vec3& x : f.points) std::swap(x[0], x[axis]);
    fractures.push_back(f);
  }
  mesh::mark_fractures(mesh, fractures);
  mesh::build_copies(mesh);
  return mesh;
}

}  // namespace polyslip::tests
