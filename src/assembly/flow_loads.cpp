#include "polyslip/assembly/flow_loads.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "polyslip/assembly/point_location.hpp"
#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/spaces/hfv_cell.hpp"
#include "polyslip/spaces/vem_cell.hpp"

namespace polyslip::assembly {

using physics::FlowBoundaryRule;
using physics::FlowSource;

namespace {

/// A well this far outside of the cell nearest to it, in units of the size of that cell, is outside of the rock.
constexpr double outside_tolerance = 1e-6;

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::string listed(const std::vector<std::string>& names) {
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

FlowLoadAssembler::FlowLoadAssembler(const mesh::DistributedMesh& mesh, const physics::FlowProblem& problem,
                                     const FlowLayout& layout, std::span<const Vec3> points, std::span<const double> reference,
                                     std::span<const double> areas)
    : mesh_(mesh), problem_(problem), layout_(layout), points_(points), reference_(reference), areas_(areas) {
  assign_boundary_rules();
  mark_fixed();
  for (const FlowSource& source : problem.sources) check_source(source);
  locate_wells();
}

void FlowLoadAssembler::assign_boundary_rules() {
  const mesh::PolyMesh& m = mesh_.mesh;
  face_rule_.assign(static_cast<std::size_t>(m.n_faces()), -1);
  for (Index r = 0; r < static_cast<Index>(problem_.boundary.size()); ++r) {
    const FlowBoundaryRule& rule = problem_.boundary[r];
    bool has_tag = false, here = false;
    for (Index face = 0; face < m.n_faces(); ++face) {
      if (!mesh_.face_is_boundary[face]) continue;
      if (rule.tag != "all" && (m.face_tag[face] < 0 || m.tag_names[m.face_tag[face]] != rule.tag)) continue;
      has_tag = true;
      if (rule.where && (*rule.where)({.x = spaces::face_geometry(m, face).centre}) == 0) continue;
      face_rule_[face] = r;
      here = true;
    }
    if (!mpi::any(mesh_.comm, has_tag))
      throw InputError("no boundary face carries the tag '" + rule.tag + "'", rule.place,
                       "Use a side of the box, a physical group on the boundary, or all");
    if (!mpi::any(mesh_.comm, here))
      throw InputError("\"where\" is zero at the centre of every boundary face of '" + rule.tag + "'", rule.place,
                       "Give a condition that holds at the centres of some faces, or refine the mesh");
  }
}

void FlowLoadAssembler::mark_fixed() {
  fixed_rule_.assign(static_cast<std::size_t>(layout_.local_size()), -1);
  const auto prescribes = [&](Index face) { return face_rule_[face] >= 0 && problem_.boundary[face_rule_[face]].pressure; };
  for (Index face = 0; face < mesh_.mesh.n_faces(); ++face)
    if (prescribes(face)) fixed_rule_[layout_.trace(mesh_.flow.face_traces[face][0])] = face_rule_[face];
  for (Index r = 0; layout_.with_fractures() && r < mesh_.flow.ridges.owned; ++r)
    for (Index face : mesh_.flow.ridge_boundary_faces[r])
      if (prescribes(face)) fixed_rule_[layout_.ridge(r)] = std::max(fixed_rule_[layout_.ridge(r)], face_rule_[face]);
  layout_.halo().owner_to_ghost(std::span<Index>(fixed_rule_));
  fixed_.resize(fixed_rule_.size());
  std::transform(fixed_rule_.begin(), fixed_rule_.end(), fixed_.begin(), [](Index r) { return r >= 0 ? 1 : 0; });
  fixed_total_ = mpi::sum(mesh_.comm, static_cast<long long>(std::count(fixed_.begin(), fixed_.begin() + layout_.size(), 1)));
}

void FlowLoadAssembler::check_source(const FlowSource& source) const {
  const mesh::PolyMesh& m = mesh_.mesh;
  if (source.kind == FlowSource::Kind::matrix) {
    if (source.name.empty() || contains(m.region_names, source.name)) return;
    throw InputError("there is no region '" + source.name + "'", source.place, "Regions are " + listed(m.region_names));
  }
  const bool on_fracture = source.kind == FlowSource::Kind::fracture || !source.on_fracture.empty();
  if (!on_fracture) return;
  if (!layout_.with_fractures())
    throw InputError("a source in a fracture, but fractures carry no fluid here", source.place,
                     "Give the fractures flow properties");
  const std::string& fracture = source.kind == FlowSource::Kind::fracture ? source.name : source.on_fracture;
  if (fracture.empty() || contains(m.fracture_names, fracture)) return;
  throw InputError("there is no fracture '" + fracture + "'", source.place, "Fractures are " + listed(m.fracture_names));
}

void FlowLoadAssembler::locate_wells() {
  well_unknown_.assign(problem_.sources.size(), -1);
  for (std::size_t k = 0; k < problem_.sources.size(); ++k) {
    const FlowSource& well = problem_.sources[k];
    if (well.kind != FlowSource::Kind::well) continue;
    const bool in_cell = well.on_fracture.empty();
    const Located located = in_cell ? locate_in_cells(mesh_, well.at) : locate_on_fracture(mesh_, well.on_fracture, well.at);
    if (located.local >= 0) well_unknown_[k] = in_cell ? layout_.cell(located.local) : layout_.fracture(located.local);
    if (!located.found)
      throw InputError("fracture '" + well.on_fracture + "' has no faces in this mesh", well.place,
                       "Refine the mesh or move the well");
    const double size = in_cell && located.local >= 0 ? (points_[layout_.cell(located.local)] - well.at).norm() : 0.0;
    if (in_cell && located.distance > outside_tolerance * mpi::max(mesh_.comm, size))
      throw InputError(fmt::format("well '{}' at ({:g}, {:g}, {:g}) is {:g} m outside of the rock", well.name, well.at.x(),
                                   well.at.y(), well.at.z(), located.distance),
                       well.place, "Move it into the domain, or name the fracture that it feeds");
  }
}

bool FlowLoadAssembler::depends_on_time() const {
  const auto varies = [](const std::optional<Expression>& e) { return e && e->depends_on_time(); };
  return std::any_of(problem_.boundary.begin(), problem_.boundary.end(),
                     [&](const FlowBoundaryRule& rule) { return varies(rule.pressure) || varies(rule.flux); }) ||
         std::any_of(problem_.sources.begin(), problem_.sources.end(),
                     [](const FlowSource& s) { return s.rate.depends_on_time(); });
}

EvalPoint FlowLoadAssembler::fracture_point(Index f, double time) const {
  const Index face = mesh_.fracture_faces[f];
  return {points_[layout_.fracture(f)], time, mesh_.mesh.face_tip_distance[face],
          mesh_.mesh.fracture_length[mesh_.mesh.face_fracture[face]]};
}

FlowLoads FlowLoadAssembler::at(double time) const {
  return mpi::made_together(mesh_.comm, [&] { return evaluate(time); });
}

/// What expressions give on this rank, which may refuse them.
FlowLoads FlowLoadAssembler::evaluate(double time) const {
  const auto n = static_cast<std::size_t>(layout_.size());
  FlowLoads loads{std::vector<double>(n), std::vector<double>(n)};
  for (std::size_t k = 0; k < problem_.sources.size(); ++k) {
    const FlowSource& source = problem_.sources[k];
    if (source.kind == FlowSource::Kind::matrix) add_matrix_source(source, time, loads);
    if (source.kind == FlowSource::Kind::fracture) add_fracture_source(source, time, loads);
    if (well_unknown_[k] >= 0) loads.sources[well_unknown_[k]] += source.rate({.x = source.at, .t = time});
  }
  add_boundary_fluxes(time, loads);
  for (std::size_t i = 0; i < n; ++i)
    if (fixed_[i]) loads.imposed[i] = (*problem_.boundary[fixed_rule_[i]].pressure)({.x = points_[i], .t = time}) - reference_[i];
  return loads;
}

void FlowLoadAssembler::add_matrix_source(const FlowSource& source, double time, FlowLoads& loads) const {
  if (source.rate.is_zero()) return;
  const mesh::PolyMesh& m = mesh_.mesh;
  std::vector<Vec3> points;
  std::vector<geometry::QuadraturePoint> rule;
  for (Index cell = 0; cell < mesh_.cells.owned; ++cell) {
    if (!source.name.empty() && m.region_names[m.cell_region[cell]] != source.name) continue;
    rule.clear();
    for (Index face : m.cell_faces[cell]) {
      spaces::face_points(m, face, points);
      geometry::append_cone_rule(m.dim, points_[layout_.cell(cell)], points, m.orientation(cell, face), rule);
    }
    for (const auto& q : rule) loads.sources[layout_.cell(cell)] += q.weight * source.rate({.x = q.x, .t = time});
  }
}

void FlowLoadAssembler::add_fracture_source(const FlowSource& source, double time, FlowLoads& loads) const {
  const mesh::PolyMesh& m = mesh_.mesh;
  for (Index f = 0; f < mesh_.fractures.owned; ++f) {
    if (!source.name.empty() && m.fracture_names[m.face_fracture[mesh_.fracture_faces[f]]] != source.name) continue;
    loads.sources[layout_.fracture(f)] += areas_[f] * source.rate(fracture_point(f, time));
  }
}

void FlowLoadAssembler::add_boundary_fluxes(double time, FlowLoads& loads) const {
  const mesh::PolyMesh& m = mesh_.mesh;
  std::vector<Vec3> points;
  std::vector<geometry::QuadraturePoint> rule;
  for (Index face = 0; face < m.n_faces(); ++face) {
    if (face_rule_[face] < 0 || !problem_.boundary[face_rule_[face]].flux) continue;
    const Index trace = layout_.trace(mesh_.flow.face_traces[face][0]);
    if (trace >= layout_.size()) continue;
    spaces::face_points(m, face, points);
    rule.clear();
    geometry::append_face_rule(m.dim, points, spaces::face_geometry(m, face).normal, rule);
    for (const auto& q : rule)
      loads.sources[trace] -= q.weight * (*problem_.boundary[face_rule_[face]].flux)({.x = q.x, .t = time});
  }
}

}  // namespace polyslip::assembly
