#include "polyslip/assembly/error_norms.hpp"

#include <cmath>

#include "polyslip/common/mpi.hpp"

namespace polyslip::assembly {

namespace {

/// Squares of an error and of the exact field, summed over ranks at the end.
struct Squares {
  double error = 0, exact = 0;

  void add(double weight, double difference_squared, double exact_squared) {
    error += weight * difference_squared;
    exact += weight * exact_squared;
  }
  [[nodiscard]] double relative(MPI_Comm comm) const {
    const double e = std::sqrt(std::max(0.0, mpi::sum(comm, error))), n = std::sqrt(std::max(0.0, mpi::sum(comm, exact)));
    return n > 0 ? e / n : e;
  }
};

Vec3 evaluate(const std::array<Expression, 3>& f, int dim, const EvalPoint& at) {
  Vec3 v = Vec3::Zero();
  for (int a = 0; a < dim; ++a) v[a] = f[a](at);
  return v;
}

EvalPoint face_point(const mesh::DistributedMesh& mesh, Index fracture_face, const Vec3& x, double time) {
  const Index face = mesh.fracture_faces[fracture_face];
  return {x, time, mesh.mesh.face_tip_distance[face], mesh.mesh.fracture_length[mesh.mesh.face_fracture[face]]};
}

void add_cell_errors(const MechanicsSystem& system, const physics::ExactSolution& exact, double time, Vec x, ErrorNorms& norms) {
  const int dim = system.layout().dim();
  const CellLoop loop(system, x);
  spaces::VemCell vem(system.mesh().mesh, system.layout().bubbles());
  std::vector<double> v;
  std::vector<geometry::QuadraturePoint> rule;
  Squares displacement, gradient;
  mpi::together(system.mesh().comm, [&] {
    for (Index cell = 0; cell < system.mesh().cells.owned; ++cell) {
      vem.build(cell);
      loop.values(vem, v);
      const Eigen::Matrix3d g = vem.gradient(v);
      rule.clear();
      vem.append_rule(rule);
      for (const auto& q : rule) {
        const EvalPoint at{.x = q.x, .t = time};
        if (exact.displacement) {
          const Vec3 u = evaluate(*exact.displacement, dim, at);
          displacement.add(q.weight, (vem.value(g, v, q.x) - u).squaredNorm(), u.squaredNorm());
        }
        if (exact.gradient)
          for (int i = 0; i < dim; ++i) {
            const Vec3 row = evaluate((*exact.gradient)[i], dim, at);
            gradient.add(q.weight, (g.row(i).transpose() - row).squaredNorm(), row.squaredNorm());
          }
      }
    }
  });
  if (exact.displacement) norms.displacement = displacement.relative(system.mesh().comm);
  if (exact.gradient) norms.gradient = gradient.relative(system.mesh().comm);
}

void add_face_errors(const MechanicsSystem& system, const physics::ExactSolution& exact, double time, Vec x, ErrorNorms& norms) {
  const mesh::DistributedMesh& mesh = system.mesh();
  const int dim = system.layout().dim();
  const auto values = fracture_values(system, x);
  Squares lam_n, lam_t, jump_n, jump_t;
  std::vector<Vec3> points;
  std::vector<geometry::QuadraturePoint> rule;
  mpi::together(mesh.comm, [&] {
    for (Index f = 0; f < mesh.fractures.owned; ++f) {
      const ContactFace& face = system.contact_cells().faces()[f];
      if (exact.faces && (*exact.faces)(face_point(mesh, f, face.centre, time)) == 0) continue;
      spaces::face_points(mesh.mesh, mesh.fracture_faces[f], points);
      rule.clear();
      geometry::append_face_rule(dim, points, face.frame.row(0).transpose(), rule);
      const auto add_scalar = [&](const std::optional<Expression>& e, double value, Squares& s, const auto& q, const EvalPoint& at) {
        if (!e) return;
        const double w = (*e)(at);
        s.add(q.weight, std::pow(value - w, 2), w * w);
      };
      const auto add_vector = [&](const std::optional<std::array<Expression, 3>>& e, const Vec3& value, Squares& s, const auto& q,
                                  const EvalPoint& at) {
        if (!e) return;
        const Vec3 w = evaluate(*e, dim, at);
        s.add(q.weight, (value - w).squaredNorm(), w.squaredNorm());
      };
      for (const auto& q : rule) {
        const EvalPoint at = face_point(mesh, f, q.x, time);
        add_scalar(exact.multiplier_normal, values[f].traction_normal, lam_n, q, at);
        add_scalar(exact.jump_normal, values[f].jump_normal, jump_n, q, at);
        add_vector(exact.multiplier_tangential, values[f].traction_tangential, lam_t, q, at);
        add_vector(exact.jump_tangential, values[f].jump_tangential, jump_t, q, at);
      }
    }
  });
  if (exact.multiplier_normal) norms.multiplier_normal = lam_n.relative(mesh.comm);
  if (exact.multiplier_tangential) norms.multiplier_tangential = lam_t.relative(mesh.comm);
  if (exact.jump_normal) norms.jump_normal = jump_n.relative(mesh.comm);
  if (exact.jump_tangential) norms.jump_tangential = jump_t.relative(mesh.comm);
}

}  // namespace

ErrorNorms error_norms(const MechanicsSystem& system, const physics::ExactSolution& exact, double time, Vec x) {
  ErrorNorms norms;
  if (exact.displacement || exact.gradient) add_cell_errors(system, exact, time, x, norms);
  if (system.fracture_faces() > 0) add_face_errors(system, exact, time, x, norms);
  return norms;
}

ExactFaceFields exact_face_fields(const MechanicsSystem& system, const physics::ExactSolution& exact, double time) {
  ExactFaceFields fields;
  const mesh::DistributedMesh& mesh = system.mesh();
  mpi::together(mesh.comm, [&] {
    for (Index f = 0; f < mesh.fractures.owned; ++f) {
      const EvalPoint at = face_point(mesh, f, system.contact_cells().faces()[f].centre, time);
      if (exact.jump_normal) fields.jump_normal.push_back((*exact.jump_normal)(at));
      if (exact.multiplier_normal) fields.traction_normal.push_back((*exact.multiplier_normal)(at));
      if (!exact.jump_tangential) continue;
      const Vec3 t = evaluate(*exact.jump_tangential, system.layout().dim(), at);
      fields.jump_tangential.insert(fields.jump_tangential.end(), {t[0], t[1], t[2]});
    }
  });
  return fields;
}

}  // namespace polyslip::assembly
