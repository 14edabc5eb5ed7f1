#include "polyslip/assembly/loads.hpp"

#include <algorithm>
#include <cmath>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/geometry/faces.hpp"
#include "polyslip/spaces/hfv_cell.hpp"

namespace polyslip::assembly {

namespace {

std::vector<double> blend(const std::vector<double>& a, const std::vector<double>& b, double s) {
  std::vector<double> c(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) c[i] = (1 - s) * a[i] + s * b[i];
  return c;
}

bool is_zero(const std::array<Expression, 3>& f, int dim) {
  return std::all_of(f.begin(), f.begin() + dim, [](const Expression& e) { return e.is_zero(); });
}

/// Points at which a function of each copy is evaluated: the node, or for split nodes a point 1e-12 of the way to the cells that see it.
std::vector<Vec3> points_of_copies(const mesh::DistributedMesh& mesh) {
  const mesh::PolyMesh& m = mesh.mesh;
  std::vector<Vec3> points;
  std::vector<Index> copies_at(static_cast<std::size_t>(m.n_nodes()), 0), seen(m.copy_node.size(), 0);
  for (Index s : m.copy_node) {
    points.push_back(m.nodes[s]);
    ++copies_at[s];
  }
  const auto is_split = [&](Index copy) { return copies_at[m.copy_node[copy]] > 1; };
  std::vector<Vec3> inward(points.size(), Vec3::Zero());
  for (Index cell = 0; cell < m.n_cells(); ++cell) {
    const auto copies = m.copies_of(cell);
    if (std::none_of(copies.begin(), copies.end(), is_split)) continue;
    const Vec3 centre = mesh::cell_node_average(m, cell);
    for (Index copy : copies) {
      inward[copy] += centre - points[copy];
      ++seen[copy];
    }
  }
  for (Index copy = 0; copy < m.n_copies(); ++copy)
    if (is_split(copy)) points[copy] += 1e-12 / std::max(1, seen[copy]) * inward[copy];
  return points;
}

}  // namespace

Loads Loads::blend(const Loads& a, const Loads& b, double s) {
  return {assembly::blend(a.displacement, b.displacement, s), assembly::blend(a.bubble, b.bubble, s), assembly::blend(a.dirichlet, b.dirichlet, s),
          assembly::blend(a.fracture_pressure, b.fracture_pressure, s)};
}

LoadAssembler::LoadAssembler(const mesh::DistributedMesh& mesh, const physics::MechanicsProblem& problem, const Layout& layout,
                             const ContactCells& cells)
    : mesh_(mesh), problem_(problem), layout_(layout), cells_(cells), fracture_of_face_(mesh::fracture_numbers(mesh)) {
  for (Index face = 0; face < mesh.mesh.n_faces(); ++face)
    if (mesh.face_is_boundary[face]) boundary_faces_.push_back(face);
  for (const physics::BoundaryRule& rule : problem.boundary) {
    const bool here = std::any_of(boundary_faces_.begin(), boundary_faces_.end(), [&](Index face) { return applies(rule, face); });
    if (!mpi::any(mesh.comm, here))
      throw InputError("no boundary face carries the tag '" + rule.tag + "'", rule.place,
                       "Use a side of the box, a physical group on the boundary, or all");
  }
  evaluation_points_ = points_of_copies(mesh);
  mark_fixed();
}

bool LoadAssembler::applies(const physics::BoundaryRule& rule, Index face) const {
  if (rule.tag == "all") return true;
  const Index tag = mesh_.mesh.face_tag[face];
  return tag >= 0 && mesh_.mesh.tag_names[tag] == rule.tag;
}

void LoadAssembler::mark_fixed() {
  const mesh::PolyMesh& m = mesh_.mesh;
  const int dim = m.dim;
  rule_of_.assign(static_cast<std::size_t>(dim) * m.n_copies(), -1);
  for (Index r = 0; r < static_cast<Index>(problem_.boundary.size()); ++r)
    for (Index face : boundary_faces_) {
      if (!applies(problem_.boundary[r], face)) continue;
      const Index cell = m.face_cells[face][0];
      const auto nodes = m.cell_nodes[cell];
      for (Index node : m.face_nodes[face]) {
        const Index copy = m.copies_of(cell)[std::find(nodes.begin(), nodes.end(), node) - nodes.begin()];
        for (int a = 0; a < dim; ++a)
          if (problem_.boundary[r].displacement[a]) rule_of_[static_cast<std::size_t>(dim) * copy + a] = r;
      }
    }
  layout_.copy_halo().owner_to_ghost(std::span<Index>(rule_of_), dim);
  fixed_.assign(static_cast<std::size_t>(layout_.local_displacements()), 0);
  for (Index copy = 0; copy < m.n_copies(); ++copy)
    for (int a = 0; a < dim; ++a) fixed_[layout_.of_copy(copy) + a] = rule_of_[static_cast<std::size_t>(dim) * copy + a] >= 0 ? 1 : 0;
  if (layout_.bubbles() == spaces::Bubbles::all) mark_fixed_normals();
}

/// The bubble of a boundary face is prescribed where all components that its normal has are.
void LoadAssembler::mark_fixed_normals() {
  for (Index face : boundary_faces_) {
    if (layout_.of_normal(face) < 0) continue;
    FixedNormal normal{face, {-1, -1, -1}};
    for (Index r = 0; r < static_cast<Index>(problem_.boundary.size()); ++r)
      for (int a = 0; a < layout_.dim() && applies(problem_.boundary[r], face); ++a)
        if (problem_.boundary[r].displacement[a]) normal.rule[a] = r;
    const Vec3 n = spaces::face_geometry(mesh_.mesh, face).normal;
    bool all = true;
    for (int a = 0; a < layout_.dim(); ++a) {
      const bool matters = std::abs(n[a]) > 1e-8;
      if (matters && normal.rule[a] < 0) all = false;
      if (!matters) normal.rule[a] = -1;
    }
    if (!all) continue;
    fixed_[layout_.of_normal(face)] = 1;
    fixed_normals_.push_back(normal);
  }
}

bool LoadAssembler::depends_on_time() const {
  const auto varies = [](const std::optional<Expression>& e) { return e && e->depends_on_time(); };
  for (const physics::BoundaryRule& rule : problem_.boundary) {
    if (varies(rule.pressure)) return true;
    for (int a = 0; a < 3; ++a)
      if (varies(rule.displacement[a]) || varies(rule.traction[a])) return true;
  }
  for (const Expression& f : problem_.body_force)
    if (f.depends_on_time()) return true;
  if (problem_.initial_stress) return true;  // it is there from the start: loads must not be blended from zero
  return std::any_of(problem_.contact.begin(), problem_.contact.end(),
                     [](const physics::ContactRule& rule) { return rule.fracture_pressure.depends_on_time(); });
}

Loads LoadAssembler::zero() const {
  const auto d = static_cast<std::size_t>(mesh_.mesh.dim);
  const auto displacements = static_cast<std::size_t>(layout_.local_displacements());
  return {std::vector<double>(displacements), std::vector<double>(d * mesh_.fractures.local()), std::vector<double>(displacements),
          std::vector<double>(mesh_.fractures.local())};
}

Loads LoadAssembler::at(double time) const {
  Loads loads = zero();
  mpi::together(mesh_.comm, [&] { evaluate(time, loads); });
  layout_.exchange(loads.dirichlet);
  mpi::together(mesh_.comm, [&] { set_normal_dirichlet(time, loads); });
  return loads;
}

/// What expressions give on this rank, which may refuse them.
void LoadAssembler::evaluate(double time, Loads& loads) const {
  if (!is_zero(problem_.body_force, mesh_.mesh.dim)) add_body_force(time, loads);
  if (problem_.initial_stress) add_initial_stress(time, loads);
  add_boundary_forces(time, loads);
  set_dirichlet(time, loads);
  for (Index f = 0; f < mesh_.fractures.local(); ++f) {
    const ContactFace& face = cells_.faces()[f];
    if (face.cell < 0) continue;
    const Index mesh_face = mesh_.fracture_faces[f];
    const Index fracture = mesh_.mesh.face_fracture[mesh_face];
    for (const physics::ContactRule& rule : problem_.contact)
      if (rule.fracture.empty() || rule.fracture == mesh_.mesh.fracture_names[fracture])
        loads.fracture_pressure[f] = rule.fracture_pressure(
            {face.centre, time, mesh_.mesh.face_tip_distance[mesh_face], mesh_.mesh.fracture_length[fracture]});
  }
}

void LoadAssembler::add_to_unknown(const spaces::VemCell& vem, int j, const Vec3& force, Loads& loads) const {
  const int dim = layout_.dim();
  if (vem.is_normal(j)) {
    loads.displacement[layout_.of_normal(vem.face(j))] += force.dot(vem.normal(j));
    return;
  }
  double* target = nullptr;
  if (j < vem.n_nodes())
    target = &loads.displacement[layout_.of_copy(mesh_.mesh.copies_of(vem.cell())[j])];
  else if (const Index face = fracture_of_face_[vem.face(j)]; face >= 0)
    target = &loads.bubble[static_cast<std::size_t>(dim) * face];
  for (int a = 0; target != nullptr && a < dim; ++a) target[a] += force[a];
}

void LoadAssembler::add_body_force(double time, Loads& loads) const {
  // int_K f . Pi_K v = sum_s v_s . (F/n + M c_s) + sum_b v_b . (M c_b),  F = int f,  M = int f (x) (x - xbar)
  const mesh::PolyMesh& m = mesh_.mesh;
  const int dim = m.dim;
  spaces::VemCell vem(m, layout_.bubbles());
  std::vector<geometry::QuadraturePoint> rule;
  for (Index cell = 0; cell < m.n_cells(); ++cell) {
    vem.build(cell);
    rule.clear();
    vem.append_rule(rule);
    Vec3 total = Vec3::Zero();
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
    for (const auto& q : rule) {
      Vec3 f = Vec3::Zero();
      for (int a = 0; a < dim; ++a) f[a] = problem_.body_force[a]({.x = q.x, .t = time});
      total += q.weight * f;
      moment += q.weight * f * (q.x - vem.xbar()).transpose();
    }
    for (int j = 0; j < vem.size(); ++j) {
      Vec3 force = moment * vem.c()[j];
      if (j < vem.n_nodes()) force += total / vem.n_nodes();
      add_to_unknown(vem, j, force, loads);
    }
  }
}

void LoadAssembler::add_initial_stress(double time, Loads& loads) const {
  // - |K| sigma_0 : G_K v, with sigma_0 in the middle of the cell for the nodes and in the middle of the face for a bubble. The bubble
  // rows give the traction of the face, which would else be that in the cell, off by the gradient of sigma_0 times h/4 or so.
  const mesh::PolyMesh& m = mesh_.mesh;
  spaces::VemCell vem(m, layout_.bubbles());
  for (Index cell = 0; cell < m.n_cells(); ++cell) {
    vem.build(cell);
    const auto stress_at = [&](const Vec3& x) { return physics::initial_stress(*problem_.initial_stress, {.x = x, .t = time}); };
    const Eigen::Matrix3d stress = stress_at(vem.xbar());
    for (int j = 0; j < vem.size(); ++j) {
      const bool node = j < vem.n_nodes();
      add_to_unknown(vem, j, -vem.volume() * ((node ? stress : stress_at(spaces::face_geometry(m, vem.face(j)).centre)) * vem.c()[j]), loads);
    }
  }
}

void LoadAssembler::add_boundary_forces(double time, Loads& loads) const {
  const mesh::PolyMesh& m = mesh_.mesh;
  const int dim = m.dim;
  std::vector<Vec3> points, g;
  std::vector<double> w;
  std::vector<geometry::QuadraturePoint> rule;
  for (Index face : boundary_faces_) {
    std::array<const Expression*, 3> traction{};
    const Expression* pressure = nullptr;
    for (const physics::BoundaryRule& r : problem_.boundary) {
      if (!applies(r, face)) continue;
      for (int a = 0; a < dim; ++a)
        if (r.traction[a]) traction[a] = &*r.traction[a];
      if (r.pressure) pressure = &*r.pressure;
    }
    if (pressure == nullptr && std::all_of(traction.begin(), traction.end(), [](auto* e) { return e == nullptr; })) continue;
    spaces::face_points(m, face, points);
    g.resize(points.size());
    w.resize(points.size());
    geometry::vector_weights(dim, points, g);
    const auto geometry = geometry::face_geometry(points, g, w);
    rule.clear();
    geometry::append_face_rule(dim, points, geometry.normal, rule);
    Vec3 force = Vec3::Zero();
    double pressure_mean = 0;
    for (const auto& q : rule) {
      const EvalPoint at{.x = q.x, .t = time};
      for (int a = 0; a < dim; ++a)
        if (traction[a] != nullptr) force[a] += q.weight * (*traction[a])(at);
      if (pressure != nullptr) pressure_mean += q.weight * (*pressure)(at) / geometry.area;
    }
    const Index cell = m.face_cells[face][0];
    const auto nodes = m.cell_nodes[cell];
    for (std::size_t s = 0; s < points.size(); ++s) {
      const Index copy = m.copies_of(cell)[std::find(nodes.begin(), nodes.end(), m.face_nodes[face][s]) - nodes.begin()];
      for (int a = 0; a < dim; ++a)
        loads.displacement[layout_.of_copy(copy) + a] += w[s] * force[a] - pressure_mean * g[s][a];
    }
    if (const Index bubble = layout_.of_normal(face); bubble >= 0)
      loads.displacement[bubble] += spaces::bubble_normal(geometry.normal).dot(force - pressure_mean * geometry.area * geometry.normal);
  }
}

void LoadAssembler::set_dirichlet(double time, Loads& loads) const {
  const int dim = mesh_.mesh.dim;
  for (Index copy = 0; copy < mesh_.copies.owned; ++copy)
    for (int a = 0; a < dim; ++a) {
      const Index r = rule_of_[static_cast<std::size_t>(dim) * copy + a];
      if (r < 0) continue;
      loads.dirichlet[layout_.of_copy(copy) + a] = (*problem_.boundary[r].displacement[a])({.x = evaluation_points_[copy], .t = time});
    }
}

/// What the mean of a prescribed displacement over a face has beyond the weighted values at its nodes, along the normal. Without it the
/// volume that is pressed through the boundary would be wrong by O(h^2), and the pressure of a body held all round by lambda times that.
void LoadAssembler::set_normal_dirichlet(double time, Loads& loads) const {
  const mesh::PolyMesh& m = mesh_.mesh;
  std::vector<Vec3> points, g;
  std::vector<double> w;
  std::vector<geometry::QuadraturePoint> rule;
  for (const FixedNormal& fixed : fixed_normals_) {
    spaces::face_points(m, fixed.face, points);
    g.resize(points.size());
    w.resize(points.size());
    geometry::vector_weights(m.dim, points, g);
    const auto geometry = geometry::face_geometry(points, g, w);
    rule.clear();
    geometry::append_face_rule(m.dim, points, geometry.normal, rule);
    const Vec3 n = spaces::bubble_normal(geometry.normal);
    double sum = 0, area = 0, nodal = 0;
    for (const auto& q : rule) {
      area += q.weight;
      for (int a = 0; a < m.dim; ++a)
        if (fixed.rule[a] >= 0) sum += q.weight * n[a] * (*problem_.boundary[fixed.rule[a]].displacement[a])({.x = q.x, .t = time});
    }
    const Index cell = m.face_cells[fixed.face][0];
    const auto nodes = m.cell_nodes[cell];
    for (std::size_t s = 0; s < points.size(); ++s) {
      const Index copy = m.copies_of(cell)[std::find(nodes.begin(), nodes.end(), m.face_nodes[fixed.face][s]) - nodes.begin()];
      for (int a = 0; a < m.dim; ++a)
        if (fixed.rule[a] >= 0) nodal += w[s] * n[a] * loads.dirichlet[layout_.of_copy(copy) + a];
    }
    loads.dirichlet[layout_.of_normal(fixed.face)] = sum / area - nodal;
  }
}

}  // namespace polyslip::assembly
