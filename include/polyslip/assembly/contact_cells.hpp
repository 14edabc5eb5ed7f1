// The cells on the + side of fracture faces: their bubbles and multipliers, eliminated exactly (scheme.md section 6).
//
// Local unknowns of a + cell K:
//   E  external: nodal copies of K, bubbles along normals of K (where bubbles are on all faces), then the copies that only the - sides of
//      its fracture faces see    (n_u)
//   I  internal: bubbles v_{Ksigma}, then multipliers lam_sigma of these faces                         (2 dim n_faces)
//
//            E                      bubble            multiplier
//   E    |  K_EE                    K_Eb              |sigma| j_e R^T      |   momentum
//   b    |  K_bE                    K_bb              |sigma| R^T          |   momentum, bubble rows
//   lam  |  |sigma| D_J R j_e       |sigma| D_J R     |sigma| D_lam        |   contact rows, times |sigma|: a force
//
// with the jump J_sigma v = sum_e j_e v_e + v_{Ksigma}, the face frame R (rows n^+, t_1, t_2) and the derivatives D_J, D_lam of the contact law.
// K_EE is the bulk's, like the matrices of all other cells. What the elimination adds to it, for any contact state:
//   C = M_EE - M_EI M_II^{-1} M_IE    with M_EE = 0 (without fluid)
// of rank 2 dim n_faces at most: a product with it takes a quarter of the numbers of C. M_IE = diag(1, D_J) M_EI^T there, so that all that
// follows the contact law is M_II^{-1}.
//
// With fluid (attach_fluid) E ends with pressures: q_K, then q_sigma^f of each of its fracture faces, then other flow unknowns whose
// rows depend on the apertures (if conductivities are those of the end of the step). With D_d = d d_f/dJ (1 x dim, in the frame):
//
//            E (displacement)             bubble                       pressure
//   E    |                                                             -b|K| c_e (q_K),  |sigma| j_e n^+ (q_f)
//   b    |                                                             -b|K| c_b (q_K),  |sigma| n^+ (q_f)
//   q_K  |  b|K| c_e                      b|K| c_b                     0: storage and fluxes are the flow system's
//   q_f  |  |sigma| D_d R j_e             |sigma| D_d R                0
//   row  |  dt d(Hq)_row/d d_f D_d R j_e  dt d(Hq)_row/d d_f D_d R     0
#pragma once

#include <span>
#include <vector>

#include "polyslip/assembly/layout.hpp"
#include "polyslip/physics/contact_law.hpp"
#include "polyslip/physics/elasticity.hpp"

namespace polyslip::assembly {

/// The fluid of a + cell; all local numbers are those of the flow unknowns.
struct ContactFluid {
  std::vector<Index> unknowns;  ///< q_K, q_sigma^f by position of the face (none where fractures carry no fluid), other rows.
  std::vector<double> biot;     ///< b|K| c_j by component of VemCell [m2; 2D: m].
};

/// How an aperture and what depends on it changes with the jump of a face.
struct ApertureLinearisation {
  Vec3 d_jump = Vec3::Zero();                 ///< D_d, in the frame of the face [-]
  std::vector<Index> rows;                    ///< Flow unknowns whose rows depend on the aperture beyond storage.
  std::vector<double> values;                 ///< dt d(Hq)_row/d d_f [m2; 2D: m]

  bool operator==(const ApertureLinearisation&) const = default;
};

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
  ContactCells(const mesh::DistributedMesh& mesh, const Layout& layout, std::span<const physics::Lame> moduli,
               physics::Stabilisation stabilisation);

  [[nodiscard]] Index size() const { return static_cast<Index>(cells_.size()); }
  [[nodiscard]] std::span<const Index> displacements(Index p) const { return displacements_[p]; }  ///< Of E, local numbers.
  [[nodiscard]] Index mesh_cell(Index p) const { return cells_[p].cell; }
  [[nodiscard]] bool contains(Index mesh_cell) const { return is_contact_cell_[mesh_cell] != 0; }
  [[nodiscard]] std::span<const ContactFace> faces() const { return faces_; }  ///< By local fracture face number.
  [[nodiscard]] std::span<ContactFace> faces() { return faces_; }
  [[nodiscard]] std::span<const Index> faces_of(Index p) const { return cell_faces_[p]; }  ///< Local fracture faces, by position.

  /// Adds fluid to the + cells, one entry a cell.
  void attach_fluid(std::vector<ContactFluid> fluid);
  /// Flow unknowns of E, local numbers; empty without fluid.
  [[nodiscard]] std::span<const Index> pressures(Index p) const {
    return fluid_.empty() ? std::span<const Index>{} : std::span<const Index>(fluid_[p].unknowns);
  }
  [[nodiscard]] const ContactFluid& fluid(Index p) const { return fluid_[p]; }
  /// Rows (and columns) of a condensed block.
  [[nodiscard]] int block_size(Index p) const { return displacements_.row_size(p) + static_cast<int>(pressures(p).size()); }
  /// For the next condensation, by local fracture face.
  void set_apertures(std::vector<ApertureLinearisation> apertures);
  /// What the fluid at the pressures q (local flow unknowns) does to the momentum rows of all + cells: added to these.
  void add_fluid_forces(std::span<const double> q, std::span<double> displacement, std::span<double> bubble) const;
  /// b|K| div_K of a state in a + cell [m3; 2D: m2].
  [[nodiscard]] double pore_volume(Index p, const MechanicalState& state) const;

  /// J_sigma of a state on a fracture face, in its frame [m].
  [[nodiscard]] Vec3 jump(Index face, const MechanicalState& state) const;

  /// Adds the momentum rows of all + cells for given u, bubbles and multipliers: displacement (local, ghosts' rows incomplete) and
  /// bubble rows (dim fractures.local()). `fracture_pressure` [Pa], one a local fracture face, may be empty.
  void add_momentum(const MechanicalState& state, std::span<const double> fracture_pressure, std::span<double> displacement,
                    std::span<double> bubble) const;

  /// Condenses the cells for the given derivatives of the contact law (by local fracture face); those that are condensed for the same ones
  /// already stay as they are. If `symmetric` derivatives differ on some face (friction bounds held), the cells are condensed for them too.
  void condense(std::span<const physics::ContactLinearisation> law, std::span<const physics::ContactLinearisation> symmetric,
                std::span<const char> differs);
  enum class Friction { moving, held };  ///< Whether bounds follow the normal traction in C.
  [[nodiscard]] bool has_changed(Index p) const { return has_changed_[p] != 0; }  ///< By the last condensation.
  [[nodiscard]] bool any_difference() const { return any_difference_; }
  [[nodiscard]] bool differs(Index p) const { return cell_differs_[p] != 0; }  ///< Whether C depends on Friction.
  /// C, row by row.
  void write_block(Index p, Friction friction, std::vector<double>& block) const;
  /// y -= factor M_EI M_II^{-1} M_IE x, for the first entries of E, as many as x and y have.
  void add_condensation(Index p, Friction friction, double factor, std::span<const double> x, std::span<double> y) const;
  [[nodiscard]] double condensed_diagonal(Index p, Friction friction, int i) const;  ///< C_ii of a displacement.

  /// Right-hand side: adds -M_EI M_II^{-1} r_I to the (local) displacement rows; r_I by local fracture face, bubble and contact rows.
  /// With fluid also to the rows of the flow unknowns (local).
  void condense_residual(std::span<const double> bubble, std::span<const double> contact, std::span<double> displacement,
                         std::span<double> flow = {}) const;
  /// delta_I = M_II^{-1} (r_I - M_IE delta_E), for all faces of these cells.
  void recover(std::span<const double> bubble, std::span<const double> contact, MechanicalState& delta) const;

  /// Blocks before condensation, for the saddle formulation; shapes as in the table above, row-major, without K_EE.
  struct SaddleBlocks {
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> ee, ei, ie, ii;
  };
  [[nodiscard]] SaddleBlocks saddle_blocks(Index p, std::span<const physics::ContactLinearisation> law) const;

 private:
  struct Cell {
    Index cell;
    int n_own;    ///< Displacements of the cell itself: nodes and bubbles along normals.
    int n_nodes;  ///< Of them, nodes.
    int n_ext;    ///< Copies of E.
    int n_normals, n_faces;
    std::size_t stiffness, jump, internal, coupling, pressing;  // starts in the pools
  };
  void add_cell(const mesh::DistributedMesh& mesh, const Layout& layout, spaces::VemCell& vem, const physics::Lame& lame, double gamma,
                std::span<const Index> fracture_of_face);
  /// Room for the condensed blocks of all cells, which have nothing in them then.
  void allocate_condensed();
  /// Position in E of the first component of its copy e.
  [[nodiscard]] int position(const Cell& cell, int e) const { return dim_ * e + (e < cell.n_nodes ? 0 : cell.n_normals); }
  [[nodiscard]] int internal_size(Index p) const { return 2 * dim_ * cells_[p].n_faces; }  ///< Rows and columns of M_II.
  void internal_block(Index p, std::span<const physics::ContactLinearisation> law,
                      Eigen::Ref<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> ii) const;
  void blocks(Index p, std::span<const physics::ContactLinearisation> law, SaddleBlocks& m) const;
  void couple(Index p, std::span<const physics::ContactLinearisation> law);
  template <int ni>
  void find_recovery(Index p, std::span<const physics::ContactLinearisation> law, double* inverse, double* recovery) const;
  template <int ni>
  void condense_cell(Index p, std::span<const physics::ContactLinearisation> law, std::span<const physics::ContactLinearisation> symmetric);
  [[nodiscard]] const double* recovery(Index p, Friction friction) const;
  void add_fluid_blocks(Index p, SaddleBlocks& m) const;
  /// r_I of a cell.
  void internal_residual(Index p, std::span<const double> bubble, std::span<const double> contact, std::vector<double>& r) const;

  int dim_;
  std::vector<Cell> cells_;
  std::vector<char> is_contact_cell_;
  Csr displacements_, cell_faces_;
  std::vector<ContactFace> faces_;
  std::vector<double> stiffness_;  ///< K_bE and K_bb, row by row.
  std::vector<double> jump_;       ///< j_e, shape (n_faces, n_ext).
  std::vector<double> inverse_;    ///< M_II^{-1}
  std::vector<double> coupling_;   ///< M_EI^T
  std::vector<double> pressing_;   ///< Of M_IE, the columns of pressures.
  std::vector<double> recovery_, held_recovery_;  ///< M_II^{-1} M_IE for each Friction, the second one where it differs.
  std::vector<char> cell_differs_, has_changed_;
  std::vector<ContactFluid> fluid_;
  std::vector<ApertureLinearisation> apertures_;
  // What the blocks are condensed for, by local fracture face.
  std::vector<physics::ContactLinearisation> condensed_law_;
  std::vector<char> condensed_differs_;
  std::vector<char> is_stale_;  ///< By cell: condensed for nothing yet, or for other apertures.
  bool any_difference_ = false;

  mutable SaddleBlocks work_;
  mutable std::vector<double> work_internal_;
};

}  // namespace polyslip::assembly
