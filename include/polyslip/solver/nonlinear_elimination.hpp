// Nonlinear elimination near unsettled fracture faces (Cai & Li 2011, SIAM J. Sci. Comput. 33, 746-762; scheme.md section 6), between two
// Newton iterations.
//
// Towards the end a few faces change state, or turn their slip, one after the other, and each costs Newton an iteration of the whole system.
// With S the faces whose contact rows are unsettled and W the displacements of the + cells of S and of their neighbours in the matrix:
//   Newton on (u_W, all bubbles, all multipliers), all other displacements (and pressures) held,
// until three thousandths are left of the contact rows, or W is large. S grows on the way. A step costs what a few unknowns cost; the momentum
// rows around W take up what it leaves, and the next Newton iteration spreads it.
//
// Windows leave their surroundings out of balance. Where the whole system has a preconditioner for the displacements next to its pressures, W
// is all of the rock after half as many steps: its momentum rows come to rest, too, and Newton's method has the coupling of rock and fluid left
// to solve. So it takes about as many iterations on fine meshes as on coarse ones.
#pragma once

#include <optional>
#include <vector>

#include "polyslip/assembly/mechanics_system.hpp"
#include "polyslip/solver/window_matrix.hpp"

namespace polyslip::solver {

class NonlinearElimination {
 public:
  explicit NonlinearElimination(assembly::MechanicsSystem& system);

  /// Improves x and brings f = F(x) up to date; leaves both where that does not help. Returns whether x is another. `of_rock` is a
  /// preconditioner of all displacements, if there is one, for a matrix near to that at hand. Collective.
  bool improve(Vec x, Vec f, PC of_rock = nullptr);
  /// Of windows and of the rock, by the last improve().
  [[nodiscard]] int steps() const { return steps_; }

 private:
  void measure(Vec f);
  void choose_faces();
  bool choose_window();
  void mark(Index entity);
  [[nodiscard]] std::vector<Index> marked();
  void forget_window();
  void create_solver();
  void set_matrix();
  void set_up_rock(PC of_rock);
  bool step(Vec x, Vec f, PC of_rock);

  assembly::MechanicsSystem& system_;
  la::Handle<Vec> start_x_, start_f_, direction_, condensed_rows_, condensed_direction_;
  std::vector<double> sizes_;   ///< Of the contact rows of each owned face [N].
  double total_ = 0;            ///< Their 2-norm over all ranks.
  std::vector<char> is_unsettled_;  ///< By owned face: S.
  std::vector<char> is_in_;     ///< By owned entity: W, while it grows,
  la::Handle<Vec> is_asked_;    ///< and 1 in the first rows of those that other ranks want in it.
  std::vector<Index> window_, rows_;  ///< W: owned entities, and their rows of the matrix by local numbers; ascending.
  std::optional<WindowMatrix> products_;  ///< With rows and columns of W, where solvers need no more,
  la::Handle<IS> in_matrix_;
  la::Handle<Mat> matrix_;      ///< or those as a matrix of PETSc; a shell where W is all of the rock.
  la::Handle<KSP> ksp_;
  PetscBool multiplies_alone_ = PETSC_FALSE;  ///< Whether that is all it does with its matrix.
  la::Handle<Vec> rhs_, solution_;
  PetscReal most_;              ///< -elimination_share: of all displacements that W may have (0: no elimination)
  PetscInt rings_;              ///< -elimination_rings: of neighbours, as far as W stays small
  PetscInt most_steps_ = 8;     ///< -elimination_max_it: of windows, half of it where the rock follows; and of the rock
  PetscBool takes_rock_ = PETSC_TRUE;  ///< -elimination_rock: after the windows, where it has a preconditioner
  int steps_ = 0;
};

}  // namespace polyslip::solver
