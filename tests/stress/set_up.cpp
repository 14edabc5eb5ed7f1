#include "stress/set_up.hpp"

#include <algorithm>

#include "polyslip/la/handle.hpp"
#include "polyslip/mesh/distributed_mesh.hpp"
#include "polyslip/scene/model.hpp"
#include "polyslip/scene/prepare.hpp"
#include "polyslip/solver/registration.hpp"

namespace polyslip::stress {

void prepare() { POLYSLIP_PETSC(solver::register_types()); }

void set_up(const scene::Scene& scene, mesh::PolyMesh serial, bool first_step) {
  const mesh::DistributedMesh mesh = mesh::distribute(PETSC_COMM_SELF, std::move(serial), scene::partition_options(scene));
  scene::Model model(mesh, scene);
  if (!first_step) return;
  const double end = std::min(scene.time.end, scene.time.start + scene.time.step);
  if (model.find_equilibrium([](const solver::NewtonRecord&) {}).converged) (void)model.steps().attempt(scene.time.start, end, end);
}

}  // namespace polyslip::stress
