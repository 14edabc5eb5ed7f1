// The Darcy fluxes of rock and fractures as a matrix H over all pressure unknowns (scheme.md section 4): row by row
//   cell            (H q)_K     = sum_sigma F_{K sigma}(q)                                  what leaves the cell
//   trace           (H q)_sigma = - sum_K F_{K sigma}(q)                                    off Gamma
//                               = - F_{K sigma}(q) + |sigma| T_f (q_{K sigma} - q_sigma^f)  on each side of a fracture face
//   fracture face   (H q)_f     = sum_e F_{sigma e}(q) - sum_sides |sigma| T_f (q_{K sigma} - q_sigma^f)
//   ridge           (H q)_e     = - sum_sigma F_{sigma e}(q)
// all in m3/s (2D: m2/s). H is symmetric, positive semidefinite; q.Hq is the power that Darcy's law dissipates.
//
// An open fracture lets fluid through its sides 1e6 to 1e12 times more easily than rock does, and sums like T + |sigma| T_f lose
// the rock. The unknown of such a conductive side (T_f > n.K_m n/(eta d_{K sigma}) at the start) is therefore the drop
//   delta_{K sigma} = q_{K sigma} - q_sigma^f:
// in these unknowns T_f stands on the diagonal of delta only, and the fracture face takes the fluid from the rock itself,
//   (H q)_f = sum_e F_{sigma e}(q) - F_{K sigma}(q) - ...,
// so that fluid is conserved to round-off whatever T_f. The forms q.Hq are the same.
//
// Fractures that meet share the pressure of their ridge, so that fluid passes through crossings without loss. Where a barrier (a
// fracture that is tight along and across itself) takes part, only its own faces reach the ridge: F_{sigma e} = 0 for the others.
//
// The part of the rock is assembled once; conductivities of the fractures only rewrite the rows of fracture sides, faces and
// ridges.
#pragma once

#include <memory>

#include "polyslip/assembly/flow_layout.hpp"
#include "polyslip/la/block_matrix.hpp"
#include "polyslip/la/kernel_log.hpp"
#include "polyslip/physics/darcy.hpp"
#include "polyslip/physics/fracture_flow.hpp"

namespace polyslip::assembly {

/// Power dissipated by the flow, q.Hq [W; 2D: W/m], over all ranks.
struct Dissipation {
  double matrix = 0, interface = 0, fracture = 0;
  [[nodiscard]] double total() const { return matrix + interface + fracture; }
};

class FlowOperator {
 public:
  /// `fractures`: of each local fracture face at the start; they settle which sides are conductive. `barriers`: 1 on local fracture
  /// faces of barriers. Throws InputError, on all ranks alike, for cells that HFV cannot take.
  FlowOperator(const mesh::DistributedMesh& mesh, const FlowLayout& layout, std::span<const physics::HydraulicProperties> rock,
               double viscosity, std::span<const physics::FractureConductivity> fractures, std::span<const char> barriers);

  /// One for each local fracture face.
  void set_conductivities(std::span<const physics::FractureConductivity> fractures);

  /// H, prescribed unknowns included.
  [[nodiscard]] Mat matrix() const { return matrix_->get(); }
  [[nodiscard]] const la::KernelLog& kernels() const { return kernels_; }  ///< Of the assembly of the rock.
  /// Places of the owned unknowns [m]: x_K, face centres, ridge centres.
  [[nodiscard]] std::span<const Vec3> points() const { return points_; }
  [[nodiscard]] std::span<const double> volumes() const { return volumes_; }  ///< |K| of the owned cells [m3].
  [[nodiscard]] std::span<const double> areas() const {
    return areas_;
  }  ///< |sigma| of the local fracture faces [m2]; empty where they
     ///< carry no fluid.

  /// Whether a local unknown is a drop delta, and not a pressure.
  [[nodiscard]] bool is_drop(Index unknown) const { return drop_from_[unknown] >= 0; }
  /// q of an unknown from a local array, that of the side itself where the unknown is a drop.
  [[nodiscard]] double pressure(std::span<const double> q, Index unknown) const {
    return is_drop(unknown) ? q[unknown] + q[drop_from_[unknown]] : q[unknown];
  }

  /// F_{sigma e}(q) out of a local fracture face through each of its ridges [m3/s; 2D: m2/s], from a local array.
  void ridge_fluxes(Index fracture_face, std::span<const double> q, std::vector<double>& fluxes) const;
  /// q.Hq by parts.
  [[nodiscard]] Dissipation dissipation(Vec q) const;

  /// The rows of H q that change with the conductivities of one local fracture face, and their derivatives to its aperture at q
  /// (local array): the face, its ridges, its two sides. Conductivities must have been set.
  void aperture_derivative(Index fracture_face, std::span<const double> q, std::vector<Index>& rows,
                           std::vector<double>& values) const;

 private:
  /// The unknowns of an element and, aligned, the row of its matrix over [p_K, p_1 .. p_n] that each takes: a pressure p_i that is
  /// a drop from q_sigma^f gives its row to both.
  struct Element {
    std::vector<Index> unknowns;
    std::vector<Index> rows;
  };
  void cell_element(Index cell, Element& element) const;
  void fracture_element(Index fracture_face, Element& element) const;
  /// Unknowns of the two sides of a fracture face.
  [[nodiscard]] std::array<Index, 2> sides(Index fracture_face) const;
  [[nodiscard]] bool any_owned(std::span<const Index> unknowns) const;
  [[nodiscard]] Csr graph() const;
  struct RockSlot;
  /// Points of the cell's owned unknowns, and its volume.
  void place_points(const RockSlot& slot);
  void choose_drops(std::span<const physics::HydraulicProperties> rock, double viscosity,
                    std::span<const physics::FractureConductivity> fractures);
  void assemble_rock(std::span<const physics::HydraulicProperties> rock, double viscosity);
  [[nodiscard]] std::vector<Index> ridges_of_barriers(std::span<const char> barriers) const;
  void measure_fractures(std::span<const char> barriers, std::span<const Index> tight_ridges);
  void keep_rock_rows();
  void place_fracture_points();
  /// Adds scale times the matrix of an element, `width` columns, to the owned rows.
  void add(const Element& element, std::span<const double> block, std::size_t width, double scale);
  [[nodiscard]] double fracture_form(Index fracture_face, std::span<const double> q) const;
  [[nodiscard]] std::span<const double> unit_transmissibilities(Index fracture_face) const;

  const mesh::DistributedMesh& mesh_;
  const FlowLayout& layout_;
  std::vector<Index>
      drop_from_;  ///< Of local unknowns: the fracture face's unknown that a drop is measured from, -1 for pressures.
  std::unique_ptr<la::BlockMatrix> matrix_;
  la::KernelLog kernels_{"flow"};
  std::vector<Vec3> points_;
  std::vector<double> volumes_, areas_;

  std::vector<double> unit_T_;               ///< T of each local fracture face at unit conductivity, one behind the other.
  std::vector<std::size_t> unit_T_offsets_;  ///< Where each starts.
  std::vector<physics::FractureConductivity> conductivities_;
  std::vector<Index> fracture_rows_;  ///< Owned unknowns whose rows fractures change.
  std::vector<double> rock_rows_;     ///< Their values without fractures.
};

}  // namespace polyslip::assembly
