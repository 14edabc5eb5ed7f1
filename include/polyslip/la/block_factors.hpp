// A sparse symmetric matrix and its incomplete Cholesky factors by blocks of one node, in less than double precision, across the borders of
// ranks.
//
//   A ~ M = (I + L) D (I + L)^T      D block diagonal, L strictly lower; blocks of b x b for b components a node
//   W_ij = A_ij - sum_{k<j} W_ik L_jk^T,   L_ij = W_ij D_j^{-1}   where A has a block ij, j < i, and nowhere else
//   D_i  = A_ii - omega_i sum_{k<i} W_ik L_ik^T                   omega_i <= 1 the largest for which D_i >= A_ii / 20
//
// the factorisation without fill of Meijerink and van der Vorst (Math. Comp. 31, 1977). It differs from PETSc's on each rank (PCBJACOBI with
// PCICC) in three things. L is kept in half precision (bfloat16: 8 bits and the exponents of floats), D in single: a quarter of the memory, and
// of what an application moves. A few thousandths are little beside what the pattern leaves out, and M stays symmetric
// and positive definite: it takes the same iterations (within one in a hundred) as with L in single precision. The factorisation does not end
// where a rank's rows do: all ranks eliminate the nodes within at once, then those at borders, on one rank after the other by colours (ranks
// side by side have different ones, two ranks two). So it takes nearly the same iterations on any number of ranks; the price is that a rank
// waits at each application for the borders of those of lower colours, and back. (Borders first, what is left out across them gives single
// eigenvalues of A M^{-1} that Chebyshev's estimate misses, unless their rows are damped six times as much, which costs a tenth of the
// iterations.) And omega keeps M positive definite without a shift of all rows.
//
// Where rows that are all but dependent (volumes that hardly change) let L grow beyond what is finite, all is done again with W_ij = A_ij and
// D_i = A_ii, which is symmetric Gauss-Seidel and positive definite whatever A.
//
// The matrix itself, for products with it, is held by its lower blocks and the diagonal ones, in single precision, as residuals of smooth
// errors are differences of large numbers: a quarter of the bytes of a MATAIJ.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "polyslip/common/types.hpp"
#include "polyslip/la/handle.hpp"

namespace polyslip::la {

class BlockFactors {
 public:
  /// The components of all nodes of this rank in the order of elimination, behind room for those of ghosts and with gaps.
  using Values = std::vector<float>;

  BlockFactors() = default;
  BlockFactors(const BlockFactors&) = delete;
  BlockFactors& operator=(const BlockFactors&) = delete;
  virtual ~BlockFactors() = default;

  /// Takes over the entries of a matrix of the same pattern, and factorises it. False, on all ranks, where an entry is not finite. Collective.
  virtual bool factorise(Mat matrix) = 0;
  /// The same for a matrix that differs from the one factorised last in some rows (of this rank, local numbers) and the same columns alone. Rows
  /// of L and D far from these are kept, so that M depends on the two matrices alone, and not on those of updates between.
  virtual bool update(Mat matrix, const std::vector<PetscInt>& rows) = 0;
  /// z = M^{-1} r
  virtual void solve(const Values& r, Values& z) = 0;
  /// y = A x; only where `keeps_matrix`.
  virtual void multiply(const Values& x, Values& y) = 0;

  [[nodiscard]] virtual Values zeros() const = 0;
  /// From and to the owned entries of a Vec of the matrix.
  virtual void gather(const PetscScalar* from, Values& to) const = 0;
  virtual void scatter(const Values& from, PetscScalar* to) const = 0;
  /// What this rank owns of some values: for sums, which the gaps do not change.
  [[nodiscard]] virtual Eigen::Map<Eigen::ArrayXf> owned(Values& values) const = 0;

  [[nodiscard]] virtual int block() const = 0;
  [[nodiscard]] virtual Index damped() const = 0;  ///< Rows of this rank with omega < 1.
};

/// For a MATAIJ, of which the blocks of the lower rows are read, as if it were symmetric; b is its block size if 2, 3 or 6, else 1.
std::unique_ptr<BlockFactors> block_factors(Mat matrix, PetscMPIInt tag, bool keeps_matrix);

}  // namespace polyslip::la
