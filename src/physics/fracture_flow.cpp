#include "polyslip/physics/fracture_flow.hpp"

#include <fmt/format.h>

#include <cassert>

#include "polyslip/common/error.hpp"
#include "polyslip/spaces/hfv_cell.hpp"

namespace polyslip::physics {

namespace {

std::string text(const Vec3& x) { return fmt::format("({:g}, {:g}, {:g})", x.x(), x.y(), x.z()); }

void check_positive(double value, const char* what, const char* unit, const char* remedy, const FractureFlowRule& rule,
                    const Vec3& x) {
  if (value > 0) return;
  throw InputError(fmt::format("{} {:g} {} at {} is not positive", what, value, unit, text(x)), rule.place, remedy);
}

FractureHydraulics properties_at(const FractureFlowRule& rule, const EvalPoint& at) {
  FractureHydraulics face{rule.contact_aperture(at), rule.dilation(at), {}, {}, rule.barrier};
  check_positive(face.contact_aperture, "contact aperture", "m",
                 "Give a hydraulic aperture > 0: closed fractures conduct a little too", rule, at.x);
  if (rule.permeability) {
    face.permeability = (*rule.permeability)(at);
    check_positive(*face.permeability, "tangential permeability", "m2", "Give a number > 0, or leave it out for the cubic law",
                   rule, at.x);
  }
  if (rule.normal_permeability) {
    face.normal_permeability = (*rule.normal_permeability)(at);
    check_positive(*face.normal_permeability, "normal permeability", "m2", "Give a number > 0, or leave it out for the cubic law",
                   rule, at.x);
  }
  return face;
}

}  // namespace

std::vector<FractureHydraulics> fracture_hydraulics(const mesh::PolyMesh& mesh, std::span<const Index> faces,
                                                    const std::vector<FractureFlowRule>& rules) {
  std::vector<FractureHydraulics> values;
  values.reserve(faces.size());
  for (Index face : faces) {
    const auto fracture = static_cast<std::size_t>(mesh.face_fracture[face]);
    const std::string& name = mesh.fracture_names[fracture];
    const EvalPoint at{spaces::face_geometry(mesh, face).centre, 0, mesh.face_tip_distance[face], mesh.fracture_length[fracture]};
    const FractureFlowRule* chosen = nullptr;
    for (const FractureFlowRule& rule : rules)
      if (rule.fracture.empty() || rule.fracture == name) chosen = &rule;
    if (chosen == nullptr)
      throw InputError("no flow properties are given for fracture '" + name + "'", "fractures",
                       "Add an entry without a fracture's name, for all");
    values.push_back(properties_at(*chosen, at));
  }
  return values;
}

FractureConductivity fracture_conductivity(const FractureHydraulics& face, double aperture, double viscosity) {
  assert(aperture > 0);
  const double d = aperture;
  FractureConductivity c;
  c.along = (face.permeability ? *face.permeability * d : d * d * d / 12) / viscosity;
  c.d_along = (face.permeability ? *face.permeability : d * d / 4) / viscosity;
  c.through = face.normal_permeability ? 2 * *face.normal_permeability / (viscosity * d) : d / (6 * viscosity);
  c.d_through = face.normal_permeability ? -c.through / d : 1 / (6 * viscosity);
  return c;
}

}  // namespace polyslip::physics
