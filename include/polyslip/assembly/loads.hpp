// Body force, tractions, pressures and Dirichlet values at a time, as vectors.
#pragma once

#include <vector>

#include "polyslip/assembly/contact_cells.hpp"
#include "polyslip/assembly/layout.hpp"
#include "polyslip/physics/problem.hpp"

namespace polyslip::assembly {

/// Everything that drives a mechanical problem at one time. Loads may be added and scaled entry by entry.
struct Loads {
  std::vector<double> nodal;              ///< External forces on nodal rows, dim copies.local() [N]; ghosts' entries incomplete.
  std::vector<double> bubble;             ///< On bubble rows, dim fractures.local() [N]; complete on faces of assembled + cells.
  std::vector<double> dirichlet;          ///< Prescribed displacements, dim copies.local() [m]; 0 where free.
  std::vector<double> fracture_pressure;  ///< p_f, fractures.local() [Pa].

  /// (1 - s) a + s b
  static Loads blend(const Loads& a, const Loads& b, double s);
};

class LoadAssembler {
 public:
  /// `cells` gives the fracture faces' frames and centres. Throws InputError for boundary tags that no face carries.
  LoadAssembler(const mesh::DistributedMesh& mesh, const physics::MechanicsProblem& problem, const Layout& layout,
                const ContactCells& cells);

  [[nodiscard]] Loads at(double time) const;
  [[nodiscard]] Loads zero() const;
  /// 1 on prescribed components, dim copies.local().
  [[nodiscard]] const std::vector<char>& fixed() const { return fixed_; }
  [[nodiscard]] bool depends_on_time() const;

 private:
  void mark_fixed();
  void add_body_force(double time, Loads& loads) const;
  void add_initial_stress(double time, Loads& loads) const;
  void add_boundary_forces(double time, Loads& loads) const;
  void set_dirichlet(double time, Loads& loads) const;
  [[nodiscard]] bool applies(const physics::BoundaryRule& rule, Index face) const;

  const mesh::DistributedMesh& mesh_;
  const physics::MechanicsProblem& problem_;
  const Layout& layout_;
  const ContactCells& cells_;
  std::vector<Index> boundary_faces_;    ///< Of local cells, on the boundary of the whole domain.
  std::vector<char> fixed_;
  std::vector<Index> rule_of_;           ///< Rule of each prescribed component, -1 elsewhere; dim copies.local().
  std::vector<Vec3> evaluation_points_;  ///< Where Dirichlet functions are evaluated, copies.local(): split nodes are moved a hair into
                                         ///< their own side, so that functions may jump across a fracture.
};

}  // namespace polyslip::assembly
