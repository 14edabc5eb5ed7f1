// Sources, wells, boundary fluxes and prescribed pressures at a time, as vectors over the pressure unknowns.
#pragma once

#include <vector>

#include "polyslip/assembly/flow_layout.hpp"
#include "polyslip/physics/flow_problem.hpp"

namespace polyslip::assembly {

/// Everything that drives the flow at one time, on the owned unknowns.
struct FlowLoads {
  std::vector<double> sources;  ///< Fluid put into cells and fracture faces, and through the boundary onto traces [m3/s; 2D: m2/s].
  std::vector<double> imposed;  ///< Prescribed q = p - p_ref [Pa]; 0 where free.
};

class FlowLoadAssembler {
 public:
  /// `points` and `reference` give place and p_ref of the owned unknowns; `areas` |sigma| of the local fracture faces.
  /// Throws InputError, on all ranks alike, for tags that no boundary face carries, regions and fractures that do not exist,
  /// sources in fractures that carry no fluid, rules for no face, and wells outside the rock.
  FlowLoadAssembler(const mesh::DistributedMesh& mesh, const physics::FlowProblem& problem, const FlowLayout& layout,
                    std::span<const Vec3> points, std::span<const double> reference, std::span<const double> areas);

  [[nodiscard]] FlowLoads at(double time) const;
  [[nodiscard]] bool depends_on_time() const;
  /// 1 on local unknowns with a prescribed pressure.
  [[nodiscard]] const std::vector<char>& fixed() const { return fixed_; }
  /// Boundary rule of each local face, and of each local unknown with a prescribed pressure; -1 elsewhere.
  [[nodiscard]] std::span<const Index> face_rules() const { return face_rule_; }
  [[nodiscard]] std::span<const Index> fixed_rules() const { return fixed_rule_; }
  [[nodiscard]] long long fixed_total() const { return fixed_total_; }  ///< Over all ranks.

 private:
  [[nodiscard]] FlowLoads evaluate(double time) const;
  void assign_boundary_rules();
  void mark_fixed();
  void locate_wells();
  void check_source(const physics::FlowSource& source) const;
  void add_matrix_source(const physics::FlowSource& source, double time, FlowLoads& loads) const;
  void add_fracture_source(const physics::FlowSource& source, double time, FlowLoads& loads) const;
  void add_boundary_fluxes(double time, FlowLoads& loads) const;
  [[nodiscard]] EvalPoint fracture_point(Index fracture_face, double time) const;

  const mesh::DistributedMesh& mesh_;
  const physics::FlowProblem& problem_;
  const FlowLayout& layout_;
  std::span<const Vec3> points_;
  std::span<const double> reference_, areas_;
  std::vector<Index> face_rule_, fixed_rule_;  ///< See face_rules(), fixed_rules().
  std::vector<char> fixed_;
  long long fixed_total_ = 0;
  std::vector<Index> well_unknown_;  ///< Owned unknown of each source that is a well; -1 on other ranks and for other sources.
};

}  // namespace polyslip::assembly
