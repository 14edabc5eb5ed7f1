#include "polyslip/scene/fields.hpp"

#include <deque>

#include "polyslip/assembly/error_norms.hpp"
#include "polyslip/common/mpi.hpp"

namespace polyslip::scene {

namespace {

using io::Location;

/// Fields and their values.
class FieldSet {
 public:
  void add(const std::string& name, Location on, int components, std::vector<double> values) {
    fields_.push_back({name, on, components, values_.emplace_back(std::move(values))});
  }
  /// One number of each of some entities.
  template <class Entities, class Number>
  void add_each(const std::string& name, Location on, const Entities& entities, Number&& number) {
    std::vector<double> values;
    for (const auto& entity : entities) values.push_back(static_cast<double>(number(entity)));
    add(name, on, 1, std::move(values));
  }
  /// One vector of each.
  template <class Entities, class Vector>
  void add_vectors(const std::string& name, Location on, const Entities& entities, Vector&& vector) {
    std::vector<double> values;
    for (const auto& entity : entities) {
      const Vec3& v = vector(entity);
      values.insert(values.end(), v.begin(), v.end());
    }
    add(name, on, 3, std::move(values));
  }
  [[nodiscard]] const std::vector<io::Field>& fields() const { return fields_; }

 private:
  std::deque<std::vector<double>> values_;
  std::vector<io::Field> fields_;
};

void add_rock(FieldSet& set, const mesh::DistributedMesh& mesh, const Model& model) {
  if (model.mechanics()) {
    set.add("displacement", Location::copy, 3, assembly::copy_displacements(*model.mechanics(), model.displacement().trial));
    set.add("stress", Location::cell, 6, assembly::cell_stresses(*model.mechanics(), model.displacement().trial));
  }
  if (model.flow()) {
    set.add("pressure", Location::cell, 1, assembly::cell_pressures(*model.flow(), model.pressure().trial));
    set.add("flux", Location::cell, 3, assembly::cell_fluxes(*model.flow(), model.pressure().trial));
  }
  const auto owned = static_cast<std::size_t>(mesh.cells.owned);
  set.add_each("region", Location::cell, std::span(mesh.mesh.cell_region).first(owned), [](Index region) { return region; });
  set.add("rank", Location::cell, 1, std::vector<double>(owned, mpi::rank(mesh.comm)));
}

void add_contact(FieldSet& set, const Model& model, const std::vector<assembly::FractureFaceValues>& faces) {
  using Values = assembly::FractureFaceValues;
  const auto on = Location::fracture_face;
  set.add_each("friction_state", on, faces, [](const Values& v) { return v.state; });
  set.add_each("traction_normal", on, faces, [](const Values& v) { return v.traction_normal; });
  set.add_vectors("traction_tangential", on, faces, [](const Values& v) { return v.traction_tangential; });
  set.add_each("jump_normal", on, faces, [](const Values& v) { return v.jump_normal; });
  set.add_vectors("jump_tangential", on, faces, [](const Values& v) { return v.jump_tangential; });
  set.add_each("slip", on, faces, [](const Values& v) { return v.slip; });
  const auto contact = model.mechanics()->contact_cells().faces().first(faces.size());
  set.add_each("friction_coefficient", on, contact, [](const auto& face) { return face.law.friction; });
}

/// Aperture, pressure and flux: computed where the fractures carry fluid, else what the contact gives.
void add_fracture_fluid(FieldSet& set, const Model& model, const std::vector<assembly::FractureFaceValues>& faces) {
  const auto on = Location::fracture_face;
  if (model.flow() && model.flow()->layout().with_fractures()) {
    set.add("aperture", on, 1, model.apertures());
    set.add("pressure", on, 1, assembly::fracture_pressures(*model.flow(), model.pressure().trial));
    set.add("flux", on, 3, assembly::fracture_fluxes(*model.flow(), model.pressure().trial));
  } else if (model.mechanics()) {
    set.add_each("aperture", on, faces, [](const assembly::FractureFaceValues& v) { return -v.jump_normal; });
    set.add("pressure", on, 1, model.mechanics()->loads().fracture_pressure);
  }
}

void add_exact(FieldSet& set, const Scene& scene, const Model& model, double time) {
  const auto exact = assembly::exact_face_fields(*model.mechanics(), *scene.exact, time);
  const auto on = Location::fracture_face;
  if (scene.exact->jump_normal) set.add("jump_normal_exact", on, 1, exact.jump_normal);
  if (scene.exact->jump_tangential) set.add("jump_tangential_exact", on, 3, exact.jump_tangential);
  if (scene.exact->multiplier_normal) set.add("traction_normal_exact", on, 1, exact.traction_normal);
}

}  // namespace

void write_fields(io::FieldWriter& writer, const Scene& scene, const Model& model, const StepFigures& figures, double time) {
  const mesh::DistributedMesh& mesh = model.mesh();
  FieldSet set;
  add_rock(set, mesh, model);
  if (mesh.fractures.total > 0) {
    if (model.has_contact()) add_contact(set, model, figures.fractures);
    add_fracture_fluid(set, model, figures.fractures);
    const auto owned = static_cast<std::size_t>(mesh.fractures.owned);
    set.add_each("fracture", Location::fracture_face, std::span(mesh.fracture_faces).first(owned),
                 [&](Index face) { return mesh.mesh.face_fracture[face]; });
    if (scene.exact) add_exact(set, scene, model, time);
  }
  writer.write(time, set.fields());
}

}  // namespace polyslip::scene
