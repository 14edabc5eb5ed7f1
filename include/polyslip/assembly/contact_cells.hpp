// The cells on the + side of fracture faces: their bubbles and multipliers, eliminated exactly (scheme.md section 6).
//
// Local unknowns of a + cell K:
//   E  external: nodal copies of K, then the copies that only the - sides of its fracture faces see    (dim n_ext)
//   I  internal: bubbles v_{Ksigma}, then multipliers lam_sigma of these faces                         (2 dim n_faces)
//
//            E (nodal)              bubble            multiplier
//   E    |  K_nn                    K_nb              |sigma| j_e R^T      |   momentum, nodal rows
//   b    |  K_bn                    K_bb              |sigma| R^T          |   momentum, bubble rows
//   lam  |  |sigma| D_J R j_e       |sigma| D_J R     |sigma| D_lam        |   contact rows, times |sigma|: a force
//
// with the jump J_sigma v = sum_e j_e v_e + v_{Ksigma}, the face frame R (rows n^+, t_1, t_2) and the derivatives D_J, D_lam of the contact law.
// Condensed block: C = M_EE - M_EI M_II^{-1} M_IE, for any contact state.
#pragma once

#include <span>
#include <vector>

#include "polyslip/assembly/layout.hpp"
#include "polyslip/physics/contact_law.hpp"
#include "polyslip/physics/elasticity.hpp"

namespace polyslip::assembly {

/// What stays of a fracture face: geometry, law, the natural size of beta. One a local fracture face that belongs to a + cell here.
struct ContactFace {
  Index cell = -1;  ///< + cell (number in ContactCells), -1 where this rank does not assemble the face
  int position = 0;  ///< Among the faces of that cell.
  double area = 0;          ///< |sigma| [m2; m in 2D]
  double stiffness = 0;     ///< (2 mu + lambda)/h_K of the + cell [Pa/m]
  Vec3 centre;              ///< x_sigma [m]
  Eigen::Matrix3d frame;    ///< Rows n^+, t_1, t_2.
  physics::ContactLaw law;
};

class ContactCells {
 public:
  ContactCells(const mesh::DistributedMesh& mesh, std::span<const physics::Lame> moduli, physics::Stabilisation stabilisation);

  [[nodiscard]] Index size() const { return static_cast<Index>(cells_.size()); }
  [[nodiscard]] std::span<const Index> external(Index p) const { return external_[p]; }  ///< Copies E, local numbers.
  [[nodiscard]] Index mesh_cell(Index p) const { return cells_[p].cell; }
  [[nodiscard]] bool contains(Index mesh_cell) const { return is_contact_cell_[mesh_cell] != 0; }
  [[nodiscard]] std::span<const ContactFace> faces() const { return faces_; }  ///< By local fracture face number.
  [[nodiscard]] std::span<ContactFace> faces() { return faces_; }
  [[nodiscard]] std::span<const Index> faces_of(Index p) const { return cell_faces_[p]; }  ///< Local fracture faces, by position.

  /// J_sigma of a state on a fracture face, in its frame [m].
  [[nodiscard]] Vec3 jump(Index face, const MechanicalState& state) const;

  /// Adds the momentum rows of all + cells for given u, bubbles and multipliers: nodal (dim copies.local(), ghosts' rows incomplete) and
  /// bubble rows (dim fractures.local()). `fracture_pressure` [Pa], one a local fracture face, may be empty.
  void add_momentum(const MechanicalState& state, std::span<const double> fracture_pressure, std::span<double> nodal,
                    std::span<double> bubble) const;

  /// Condenses every cell for the given derivatives of the contact law (by local fracture face). If `symmetric` derivatives differ on
  /// some face (friction bounds held), their blocks are condensed too.
  void condense(std::span<const physics::ContactLinearisation> law, std::span<const physics::ContactLinearisation> symmetric,
                std::span<const char> differs);
  [[nodiscard]] std::span<const double> block(Index p) const { return matrix(condensed_, p); }          ///< C
  [[nodiscard]] std::span<const double> symmetric_block(Index p) const;                                 ///< C with friction bounds held.
  [[nodiscard]] bool any_difference() const { return any_difference_; }
  [[nodiscard]] bool differs(Index p) const { return cell_differs_[p] != 0; }

  /// Right-hand side: adds -M_EI M_II^{-1} r_I to the nodal rows (dim copies.local()); r_I by local fracture face, bubble and contact rows.
  void condense_residual(std::span<const double> bubble, std::span<const double> contact, std::span<double> nodal) const;
  /// delta_I = M_II^{-1} (r_I - M_IE delta_E), for all faces of these cells.
  void recover(std::span<const double> bubble, std::span<const double> contact, MechanicalState& delta) const;

  /// Blocks before condensation, for the saddle formulation; shapes as in the table above, row-major.
  struct SaddleBlocks {
    Eigen::MatrixXd ee, ei, ie, ii;
  };
  [[nodiscard]] SaddleBlocks saddle_blocks(Index p, std::span<const physics::ContactLinearisation> law) const;

 private:
  struct Cell {
    Index cell;
    int n_nodes, n_ext, n_faces;
    std::size_t stiffness, jump, condensed, internal, coupling;  // starts in the pools
  };
  void add_cell(const mesh::DistributedMesh& mesh, spaces::VemCell& vem, const physics::Lame& lame, double gamma,
                std::span<const Index> fracture_of_face);
  [[nodiscard]] std::span<const double> matrix(const std::vector<double>& pool, Index p) const;
  void blocks(Index p, std::span<const physics::ContactLinearisation> law, SaddleBlocks& m) const;
  [[nodiscard]] Eigen::VectorXd internal_residual(Index p, std::span<const double> bubble, std::span<const double> contact) const;

  int dim_;
  std::vector<Cell> cells_;
  std::vector<char> is_contact_cell_;
  Csr external_, cell_faces_;
  std::vector<ContactFace> faces_;
  std::vector<double> stiffness_;  ///< K over nodes and bubbles, row-major.
  std::vector<double> jump_;       ///< j_e, shape (n_faces, n_ext).
  std::vector<double> condensed_, symmetric_;
  std::vector<double> inverse_;    ///< M_II^{-1}
  std::vector<double> m_ei_, m_ie_;
  std::vector<char> cell_differs_;
  bool any_difference_ = false;
};

}  // namespace polyslip::assembly
