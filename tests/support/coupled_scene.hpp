// Rock, contact and fluid on all ranks of PETSC_COMM_WORLD: a crossed network in a box whose top is pushed and sheared.
#pragma once

#include <memory>

#include "polyslip/solver/coupled_solver.hpp"
#include "polyslip/solver/coupled_step.hpp"
#include "support/contact_scene.hpp"
#include "support/flow_scene.hpp"

namespace polyslip::tests {

struct CoupledOptions {
  double dilation = 0;
  physics::ConductivityTime conductivities = physics::ConductivityTime::previous;
  double friction = 0.4;
  spaces::Bubbles bubbles = spaces::Bubbles::fracture;
  std::vector<std::string> top = {"0.02*t", "-0.01*t", "-0.01*t"};  ///< Displacement of the top, by component; 2D: the first two.
};

class CoupledScene {
 public:
  CoupledScene(const Shape& shape, const CoupledOptions& options, Index n = 4) : dim(shape.dim) {
    rules.boundary = {hold("bottom", {"0", "0", "0"}), hold("top", {options.top[0], options.top[1], dim == 3 ? options.top[2] : ""})};
    rules.materials = {rock()};
    rules.bubbles = options.bubbles;
    rules.contact = {contact(physics::FrictionLaw::coulomb, options.friction)};
    fluid = flow_problem(dim, false);
    fluid.materials[0].biot = Expression(0.8);
    physics::FractureFlowRule rule = fracture("0.05");
    rule.dilation = Expression(options.dilation);
    fluid.fractures = {rule};
    fluid.boundary = {given_pressure("left", "0.1")};
    fluid.conductivities = options.conductivities;
    fluid.fluid_compressibility = 0.1;
    fluid.initial_pressure = Expression(0.1);
    mesh::PolyMesh serial;
    mpi::on_root(PETSC_COMM_WORLD, [&] { serial = crossed_box(shape, n); });
    mesh::PartitionOptions partition;
    partition.flow = true;
    mesh = mesh::distribute(PETSC_COMM_WORLD, std::move(serial), partition);
    flow = std::make_unique<assembly::FlowSystem>(mesh, fluid);
    system = std::make_unique<assembly::CoupledSystem>(mesh, rules, *flow);
    static const PetscErrorCode registered = solver::register_types();
    POLYSLIP_PETSC(registered);
  }
  CoupledScene(const CoupledScene&) = delete;
  CoupledScene& operator=(const CoupledScene&) = delete;

  int dim;
  physics::MechanicsProblem rules;
  physics::FlowProblem fluid;
  mesh::DistributedMesh mesh;
  std::unique_ptr<assembly::FlowSystem> flow;
  std::unique_ptr<assembly::CoupledSystem> system;
};

}  // namespace polyslip::tests
