// The discrete mechanical problem of scheme.md section 3: residual, exact linearisation, and its condensed form (section 6).
//
// The matrix is over the displacements (of node copies, and of bubbles along normals where bubbles are on all faces):
// P = A + sum_K C_K  with the bulk A (of all cells, without bubbles of fracture faces; assembled once, by halves of its blocks) and what their
// elimination from the + cells adds, C_K. What is multiplied is A, and C_K by its factors (MatMult of P, too). P is for preconditioners and
// factorisations. Between Newton iterations only the rows of + cells are rewritten, and only these are held, unless somebody needs all of them: the
// others are those of A. Where frictional slip makes C_K unsymmetric, P may hold the blocks of the same states with the friction bounds held
// (symmetric, what multigrid likes); the exact condensed operator is A + sum_K C_K, see apply_condensed.
#pragma once

#include <array>
#include <functional>
#include <memory>

#include "polyslip/assembly/contact_cells.hpp"
#include "polyslip/assembly/layout.hpp"
#include "polyslip/assembly/loads.hpp"
#include "polyslip/la/block_matrix.hpp"
#include "polyslip/la/block_operator.hpp"
#include "polyslip/la/kernel_log.hpp"
#include "polyslip/la/vec_access.hpp"
#include "polyslip/physics/problem.hpp"

namespace polyslip::assembly {

/// Contact values of the owned fracture faces at x and along a direction y: contact rows of x - alpha y without touching the bulk.
struct ContactLine {
  std::vector<physics::ContactPoint> at;         ///< Owned faces.
  std::vector<physics::ContactPoint> direction;  ///< lam and jump of y.
};

/// Norms that convergence is judged by; independent of beta.
struct ResidualNorms {
  double momentum = 0, momentum_scale = 0;  ///< [N]
  double momentum_floor = 0;                ///< What the digits of the displacements leave of momentum.
  double contact = 0, contact_scale = 0;    ///< With beta = (2 mu + lambda)/h_K, times |sigma| [N].
  double flow = 0, flow_scale = 1;          ///< Volumes of fluid [m3; 2D: m2]; 0 without it. See CoupledSystem::norms.
  double flow_floor = 0;                    ///< What the digits of the pressures leave of flow.
  double flow_loss = 0, flow_turnover = 1;  ///< What all flow rows lose together, and the volumes that move (of all rows, in the 1-norm).
};

struct StateCounts {
  std::array<long long, 3> faces{};  ///< By physics::ContactState, over all ranks.
};

class MechanicsSystem {
 public:
  enum class MatrixContent { bulk, symmetric, exact };  ///< What P holds: A, A + sum C_K^sym, A + sum C_K.

  MechanicsSystem(const mesh::DistributedMesh& mesh, const physics::MechanicsProblem& problem);
  virtual ~MechanicsSystem() = default;

  [[nodiscard]] const mesh::DistributedMesh& mesh() const { return mesh_; }
  [[nodiscard]] const physics::MechanicsProblem& problem() const { return problem_; }
  [[nodiscard]] const Layout& layout() const { return layout_; }
  [[nodiscard]] const ContactCells& contact_cells() const { return cells_; }
  [[nodiscard]] const LoadAssembler& load_assembler() const { return load_assembler_; }
  [[nodiscard]] std::span<const physics::Lame> moduli() const { return moduli_; }
  [[nodiscard]] GlobalIndex fracture_faces() const { return mesh_.fractures.total; }

  // What a coupled system adds to: its vectors end with the pressures.
  [[nodiscard]] virtual la::Handle<Vec> create_vector() const { return layout_.create_vector(); }
  [[nodiscard]] virtual la::Handle<Vec> create_condensed_vector() const { return layout_.create_displacement_vector(); }
  [[nodiscard]] virtual Index size() const { return layout_.size(); }  ///< Owned entries of a whole vector.
  /// Whether all rows but those of contact are linear (then a line search need not evaluate them again).
  [[nodiscard]] virtual bool is_linear_off_contact() const { return true; }

  // --- the step ---
  virtual void set_loads(Loads loads);
  [[nodiscard]] const Loads& loads() const { return loads_; }
  virtual void impose_dirichlet(Vec x) const;
  /// Friction is measured from the jumps of x from now on.
  void set_previous_jumps(Vec x);
  [[nodiscard]] std::span<const Vec3> previous_jumps() const { return previous_; }
  void set_previous_jumps(std::span<const Vec3> jumps);
  /// Jumps from which slip and shear dilation count, one a local fracture face; zero at first.
  void set_initial_jumps(std::span<const Vec3> jumps) { initial_.assign(jumps.begin(), jumps.end()); }
  [[nodiscard]] std::span<const Vec3> initial_jumps() const { return initial_; }
  /// beta_n = beta_t = scale (2 mu + lambda)/h_K
  void set_beta_scale(double scale) { beta_scale_ = scale; }
  [[nodiscard]] double beta_scale() const { return beta_scale_; }
  /// Springs of stiffness beta instead of contact (an approach to the solution, see Augmentation::theta), or the contact law.
  void use_springs(bool springs) { theta_ = springs ? 0 : 1; }
  /// Freezes the friction bound g of every Coulomb face (a Tresca problem) or goes back to Coulomb's law.
  void use_lagged_friction(bool lagged) { friction_is_lagged_ = lagged; }
  /// g = (1 - weight) g + weight F max(0, lam_n) at x (weight 1 forgets what was); returns the largest change due, relative to the largest bound.
  double update_lagged_friction(Vec x, double weight);
  /// Multiplies every friction coefficient and bound (continuation); 1 is the problem itself.
  void set_friction_factor(double factor) { friction_factor_ = factor; }

  // --- nonlinear rows ---
  /// f = all rows of the residual at x: momentum [N], contact rows times |sigma| [N], u - u_D on prescribed components.
  virtual void residual(Vec x, Vec f) const;
  /// x -= d, and f, the residual at x, follows in its mechanical rows: in a time that depends on where d moves displacements, those of some owned
  /// entities of the layout. d has no pressures.
  void move(Vec x, Vec d, std::span<const Index> moved, Vec f) const;
  /// r = momentum rows of the Jacobian times y (they are linear); 0 on contact rows.
  virtual void momentum_action(Vec y, Vec r) const;
  [[nodiscard]] ContactLine contact_line(Vec x, Vec y) const;
  /// Sum of squares of the contact rows at x - alpha y, over all ranks [N2].
  [[nodiscard]] double contact_merit(const ContactLine& line, double alpha) const;
  /// Writes the contact rows at x - alpha y into f.
  void set_contact_rows(const ContactLine& line, double alpha, Vec f) const;
  [[nodiscard]] virtual ResidualNorms norms(Vec x, Vec f) const;
  /// State of each owned fracture face.
  [[nodiscard]] std::vector<physics::ContactState> states(Vec x) const;
  [[nodiscard]] StateCounts count(std::span<const physics::ContactState> states) const;

  // --- linearisation ---
  /// Linearises the contact law at x and condenses: what multiplies + cells by their factors follows, P does not yet.
  void condense_contact(Vec x);
  /// The same; then writes P, where it changes.
  void linearise_contact(Vec x, MatrixContent content);
  /// This, and all else that depends on x.
  virtual void linearise(Vec x, MatrixContent content) { linearise_contact(x, content); }
  /// Calls `work` while P is what it is where all fracture faces are open, then writes it again as it was. Collective.
  void with_open_faces(const std::function<void()>& work);
  /// Leaves the bulk alone in P: what is computed then does not depend on earlier linearisations, to the bit.
  void forget_linearisation() { write_contact_rows(MatrixContent::bulk); }
  /// Products with A by all of its blocks from now on, where digits count: the mirrored half of a row is not rounded as the row is, and leaves
  /// more of what cancels in rigid motions (on flat cells also in other linear fields; there it is so from the start). Collective.
  void multiply_whole_rows();
  [[nodiscard]] Mat matrix() const { return matrix_->get(); }
  /// P holds all of its rows from now on, for whom reads it by PETSc's functions; else others than those of + cells are lent (la::lend_rows).
  /// matrix() is another one then. Collective.
  virtual void hold_all_rows();
  [[nodiscard]] bool holds_all_rows() const { return holds_all_rows_; }
  /// A, by entities of the layout; of prescribed displacements only diagonal entries are left. It has all couplings of P.
  [[nodiscard]] const la::BlockOperator& bulk() const { return *bulk_; }
  [[nodiscard]] const la::KernelLog& kernels() const { return kernels_; }  ///< Of the assembly of the bulk.
  /// Rows of P that are nodal, with the rigid-body modes as their near null space, and those of bubbles along normals; null where bubbles
  /// are on fracture faces only (the modes are then those of P).
  [[nodiscard]] IS nodal_field() const { return nodal_field_; }
  [[nodiscard]] IS normal_field() const { return normal_field_; }
  /// Rows of P (of this rank, local numbers) that linearise rewrites.
  [[nodiscard]] std::vector<PetscInt> changing_rows() const;
  /// Whether the exact condensed operator is P itself (otherwise friction makes them differ).
  [[nodiscard]] bool matrix_is_exact() const { return matrix_is_exact_; }
  [[nodiscard]] bool is_symmetric() const { return symmetric_everywhere_; }
  /// y = (A + sum_K C_K) x
  virtual void apply_condensed(Vec x, Vec y) const { apply(MatrixContent::exact, x, y); }
  /// Right-hand side of the condensed system for the residual f.
  virtual void condense_residual(Vec f, Vec displacement) const;
  /// All components of the Newton direction from its displacements.
  virtual void recover(Vec f, Vec displacement, Vec direction) const;

  /// Contact laws linearised last, by local fracture face.
  [[nodiscard]] std::span<const physics::ContactLinearisation> linearised_law() const { return law_; }
  [[nodiscard]] const std::vector<char>& fixed() const { return load_assembler_.fixed(); }

 protected:
  /// Vec to local arrays with ghosts, and back (owned).
  virtual void gather(Vec x, MechanicalState& state) const { layout_.gather(x, state); }
  virtual void scatter(const MechanicalState& state, Vec x) const { layout_.scatter(state, x); }
  [[nodiscard]] ContactCells& cells() { return cells_; }
  /// y = P x with this content, for all local displacements (x, ghosts last) and the owned ones (y). P itself is not touched.
  void multiply(std::span<const double> x, MatrixContent content, std::span<double> y) const;
  void apply(MatrixContent content, Vec x, Vec y) const;
  /// That of the C_K in this content, which is not that of the bulk.
  [[nodiscard]] static ContactCells::Friction friction_of(MatrixContent content) {
    return content == MatrixContent::exact ? ContactCells::Friction::moving : ContactCells::Friction::held;
  }
  [[nodiscard]] bool is_ours(Index cell) const;  ///< Whether this rank owns some of its displacements.
  [[nodiscard]] MatrixContent content() const { return content_; }

 private:
  void assemble_bulk();
  /// A by these blocks of the cells; returns the flatness of the flattest cell.
  double sum_up_bulk(const Csr& graph, physics::Blocks blocks);
  /// P = A, of which the rows that are `wanted` are held.
  template <class Wanted>
  void create_matrix(Wanted&& wanted);
  void find_contact_places();
  void write_bulk();
  void diagonal(Vec y) const;  ///< Of P.
  /// Cells of which this rank owns displacements, and that are `wanted`.
  template <class Wanted>
  [[nodiscard]] std::vector<Index> our_cells(Wanted&& wanted) const;
  void keep_bulk_diagonal();
  void describe_fields();
  void compute_lift();
  void condense_law();
  void write_law(MatrixContent content);
  void write_contact_rows(MatrixContent content);
  [[nodiscard]] physics::ContactLaw law_of(Index face) const;
  [[nodiscard]] physics::Augmentation augmentation(Index face) const {
    return {beta_scale_ * cells_.faces()[face].stiffness, theta_};
  }
  [[nodiscard]] physics::ContactPoint point(Index face, const MechanicalState& state) const;
  void momentum_rows(Vec y, std::span<const double> fracture_pressure, Vec r) const;
  void write_contact_residual(const MechanicalState& state, const la::VecWrite& rows) const;

  const mesh::DistributedMesh& mesh_;
  const physics::MechanicsProblem& problem_;
  std::vector<physics::Lame> moduli_;
  Layout layout_;
  ContactCells cells_;
  LoadAssembler load_assembler_;
  std::unique_ptr<la::BlockMatrix> matrix_;
  std::unique_ptr<la::BlockOperator> bulk_;  ///< A
  bool holds_all_rows_ = false;
  const la::MatrixOperations operations_{[this](Vec x, Vec y) { apply(content_, x, y); }, [this](Vec y) { diagonal(y); }};
  la::KernelLog kernels_{"rock"};
  la::Handle<MatNullSpace> modes_;  ///< Of rigid bodies.
  la::Handle<IS> nodal_field_, normal_field_;
  Csr contact_entities_;             ///< Entities of the condensed block of each + cell,
  Csr contact_places_;               ///< and the places of its blocks in P, row by row of owned entities.
  std::vector<Index> contact_rows_;  ///< Owned entities whose rows + cells touch.
  std::vector<double> bulk_rows_;    ///< Their values in A, in order.
  std::vector<double> bulk_diagonal_;  ///< Of A, owned displacements; 0 where prescribed [N/m].
  MatrixContent content_ = MatrixContent::bulk;
  bool matrix_is_exact_ = true, symmetric_everywhere_ = true;

  Loads loads_;
  std::vector<double> lift_;  ///< A_{free, prescribed} u_D, owned displacements [N]
  double load_scale_ = 0;     ///< Norm of lift and loads [N]
  double beta_scale_ = 0.1, theta_ = 1, friction_factor_ = 1;
  bool friction_is_lagged_ = false;
  std::vector<double> lagged_bounds_;  ///< g by local fracture face [Pa]
  std::vector<Vec3> initial_;   ///< J_sigma u^0 by local fracture face.
  std::vector<Vec3> previous_;  ///< J_sigma u^{n-1} by local fracture face.
  std::vector<physics::ContactLinearisation> law_;
  std::vector<char> is_outdated_;  ///< By + cell: what P holds is of an earlier condensation.

  mutable MechanicalState work_, work2_;
};

}  // namespace polyslip::assembly
