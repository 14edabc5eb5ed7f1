// Body force, tractions, pressures and Dirichlet values at a time, as vectors.
#pragma once

#include <vector>

#include "polyslip/assembly/contact_cells.hpp"
#include "polyslip/assembly/layout.hpp"
#include "polyslip/physics/problem.hpp"

namespace polyslip::assembly {

/// Everything that drives a mechanical problem at one time. Loads may be added and scaled entry by entry.
struct Loads {
  std::vector<double> displacement;       ///< External forces on local displacements [N]; ghosts' entries incomplete.
  std::vector<double> bubble;             ///< On bubble rows, dim fractures.local() [N]; complete on faces of assembled + cells.
  std::vector<double> dirichlet;          ///< Prescribed values of local displacements [m]; 0 where free.
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
  /// 1 on prescribed displacements, one a local displacement.
  [[nodiscard]] const std::vector<char>& fixed() const { return fixed_; }
  [[nodiscard]] bool depends_on_time() const;

 private:
  void evaluate(double time, Loads& loads) const;
  void mark_fixed();
  void mark_fixed_normals();
  void add_to_unknown(const spaces::VemCell& vem, int j, const Vec3& force, Loads& loads) const;
  void add_body_force(double time, Loads& loads) const;
  void add_initial_stress(double time, Loads& loads) const;
  void add_boundary_forces(double time, Loads& loads) const;
  void set_dirichlet(double time, Loads& loads) const;
  void set_normal_dirichlet(double time, Loads& loads) const;
  [[nodiscard]] bool applies(const physics::BoundaryRule& rule, Index face) const;

  const mesh::DistributedMesh& mesh_;
  const physics::MechanicsProblem& problem_;
  const Layout& layout_;
  const ContactCells& cells_;
  std::vector<Index> boundary_faces_;    ///< Of local cells, on the boundary of the whole domain.
  /// A boundary face whose bubble along the normal is prescribed: the rule of each component that the normal has.
  struct FixedNormal {
    Index face;
    std::array<Index, 3> rule;
  };
  std::vector<char> fixed_;
  std::vector<FixedNormal> fixed_normals_;
  std::vector<Index> fracture_of_face_;  ///< Local fracture face of each face, -1 off Gamma.
  std::vector<Index> rule_of_;           ///< Rule of each prescribed component, -1 elsewhere; dim copies.local().
  std::vector<Vec3> evaluation_points_;  ///< Where Dirichlet functions are evaluated, copies.local(): split nodes are moved a hair into
                                         ///< their own side, so that functions may jump across a fracture.
};

}  // namespace polyslip::assembly
