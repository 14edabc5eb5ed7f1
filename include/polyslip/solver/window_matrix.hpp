// Some rows and columns of the exact condensed operator A + sum_K C_K of a system, for a few products with vectors: those of A are copied, C_K
// is multiplied by its factors, and P (see MechanicsSystem) is not asked.
#pragma once

#include <span>
#include <vector>

#include "polyslip/assembly/mechanics_system.hpp"
#include "polyslip/la/principal_submatrix.hpp"

namespace polyslip::solver {

class WindowMatrix {
 public:
  /// Of nothing yet. `system` must outlive it.
  explicit WindowMatrix(const assembly::MechanicsSystem& system);
  WindowMatrix(const WindowMatrix&) = delete;
  WindowMatrix& operator=(const WindowMatrix&) = delete;

  /// Takes the displacements of these owned entities of the layout, ascending; get() is another one then. Collective.
  void choose(std::span<const Index> entities);
  /// A shell with MatMult and MatGetDiagonal, of the contact law that was condensed last.
  [[nodiscard]] Mat get() const { return shell_; }
  /// Tells solvers that this law is another one now. Collective.
  void follow() const;

 private:
  static PetscErrorCode multiply_shell(Mat shell, Vec x, Vec y);
  static PetscErrorCode diagonal_of_shell(Mat shell, Vec diagonal);
  void multiply(Vec x, Vec y);
  void fetch_ghosts();

  const assembly::MechanicsSystem& system_;
  const bool exchanges_;         ///< Whether there are others to exchange x with.
  la::PrincipalSubmatrix bulk_;
  std::vector<Index> rows_;      ///< Displacements, local numbers.
  std::vector<Index> cells_;     ///< + cells with rows here,
  Csr columns_;                  ///< and where their displacements are among the columns of bulk_; behind the last one those that are not.
  std::vector<double> x_, y_;    ///< By these columns; in y_ nobody reads what is not a row.
  std::vector<double> whole_;    ///< x among all local displacements, for the exchange.
  std::vector<double> of_cell_, sums_;
  la::Handle<Mat> shell_;
};

}  // namespace polyslip::solver
