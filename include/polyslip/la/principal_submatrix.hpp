// Some rows of a distributed matrix and the same columns, for a few products with vectors: what MatCreateSubMatrix gives, in blocks, in memory that
// is used again for other rows.
#pragma once

#include <vector>

#include "polyslip/common/processor.hpp"
#include "polyslip/common/types.hpp"
#include "polyslip/la/aij_parts.hpp"
#include "polyslip/la/handle.hpp"

namespace polyslip::la {

class PrincipalSubmatrix {
 public:
  /// Of no rows yet; `matrix` is a square MATAIJ that must outlive this object, and keep its pattern. Where it has a block size up to 3, it must
  /// consist of whole blocks of that. Collective.
  explicit PrincipalSubmatrix(Mat matrix);
  PrincipalSubmatrix(const PrincipalSubmatrix&) = delete;
  PrincipalSubmatrix& operator=(const PrincipalSubmatrix&) = delete;

  /// Copies these rows of this rank (local numbers, ascending, whole blocks). Collective.
  void copy(const std::vector<PetscInt>& rows);
  /// The same rows, whose entries have changed. Collective.
  void copy_again();
  /// A shell with MatMult and MatGetDiagonal; another one after copy().
  [[nodiscard]] Mat get() const { return shell_; }

 private:
  static PetscErrorCode multiply_shell(Mat shell, Vec x, Vec y);
  static PetscErrorCode diagonal_of_shell(Mat shell, Vec diagonal);
  /// Calls `body` with the block size as a constant.
  template <class Body>
  void with_block(Body&& body);
  template <int b>
  void copy_blocks();
  template <int b>
  void multiply(Vec x, Vec y);
  /// The rows of the chosen nodes times `x_`.
  template <int b>
  POLYSLIP_BY_PROCESSOR void multiply_rows(double* y);
  template <int b>
  void fetch_ghosts(const double* x);

  Mat matrix_;
  AijParts parts_;
  PetscInt block_ = 1, ghosts_ = 0;  ///< Ghosts: nodes in columns of others.
  std::vector<Index> nodes_;         ///< Of this rank, that are chosen.
  std::vector<Index> place_;         ///< Of each node of this rank among these, or -1.
  Csr columns_;                      ///< Places, those of ghosts behind the chosen nodes; blocks that serve twice (lend_rows) first,
  std::vector<Index> mirrored_;      ///< and how many these are;
  std::vector<Index> diagonal_;      ///< where each node has its own block.
  std::vector<double> values_;       ///< Block by block; longer than needed at times.
  std::vector<double> x_, y_;        ///< By lanes (lanes.hpp).
  Handle<Vec> whole_, of_ghosts_;    ///< x among all rows of this rank, and in the columns of others: 0 where it is not chosen.
  Handle<VecScatter> fetch_;         ///< Null on one rank.
  Handle<Mat> shell_;
};

}  // namespace polyslip::la
