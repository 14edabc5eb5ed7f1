#include "polyslip/la/principal_submatrix.hpp"

#include <algorithm>
#include <optional>

#include "polyslip/la/block_rows.hpp"
#include "polyslip/la/lanes.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::la {

PrincipalSubmatrix::PrincipalSubmatrix(Mat matrix) : matrix_(matrix), parts_(matrix) {
  PetscInt rows = 0, columns = 0;
  POLYSLIP_PETSC(MatGetBlockSize(matrix_, &block_));
  if (block_ > 3) block_ = 1;
  POLYSLIP_PETSC(MatGetLocalSize(matrix_, &rows, nullptr));
  place_.assign(static_cast<std::size_t>(rows / block_), -1);
  if (parts_.others == nullptr) return;
  POLYSLIP_PETSC(MatGetSize(parts_.others, nullptr, &columns));
  ghosts_ = columns / block_;
  POLYSLIP_PETSC(MatCreateVecs(matrix_, whole_.put(), nullptr));
  POLYSLIP_PETSC(VecCreateSeq(PETSC_COMM_SELF, columns, of_ghosts_.put()));
  Handle<IS> wanted;
  POLYSLIP_PETSC(ISCreateGeneral(PETSC_COMM_SELF, columns, parts_.global, PETSC_COPY_VALUES, wanted.put()));
  POLYSLIP_PETSC(VecScatterCreate(whole_, wanted, of_ghosts_, nullptr, fetch_.put()));
}

template <class Body>
void PrincipalSubmatrix::with_block(Body&& body) {
  switch (block_) {
    case 2: return body.template operator()<2>();
    case 3: return body.template operator()<3>();
    default: return body.template operator()<1>();
  }
}

void PrincipalSubmatrix::copy(const std::vector<PetscInt>& rows) {
  for (Index node : nodes_) place_[static_cast<std::size_t>(node)] = -1;
  nodes_.clear();
  for (std::size_t k = 0; k < rows.size(); k += static_cast<std::size_t>(block_)) {
    place_[static_cast<std::size_t>(rows[k] / block_)] = static_cast<Index>(nodes_.size());
    nodes_.push_back(rows[k] / block_);
  }
  if (whole_ != nullptr) POLYSLIP_PETSC(VecZeroEntries(whole_));
  const auto n = static_cast<PetscInt>(rows.size());
  POLYSLIP_PETSC(MatCreateShell(comm_of(matrix_), n, n, PETSC_DETERMINE, PETSC_DETERMINE, this, shell_.put()));
  POLYSLIP_PETSC(MatShellSetOperation(shell_, MATOP_MULT, reinterpret_cast<void (*)()>(multiply_shell)));
  POLYSLIP_PETSC(MatShellSetOperation(shell_, MATOP_GET_DIAGONAL, reinterpret_cast<void (*)()>(diagonal_of_shell)));
  copy_again();
}

void PrincipalSubmatrix::copy_again() {
  with_block([&]<int b>() { copy_blocks<b>(); });
  POLYSLIP_PETSC(MatAssemblyBegin(shell_, MAT_FINAL_ASSEMBLY));  // solvers see that entries have changed
  POLYSLIP_PETSC(MatAssemblyEnd(shell_, MAT_FINAL_ASSEMBLY));
}

template <int b>
void PrincipalSubmatrix::copy_blocks() {
  const auto chosen = static_cast<Index>(nodes_.size());
  const BlockRows<b, b> own(parts_.own, parts_.lent);
  std::optional<BlockRows<b, b>> others;
  if (parts_.others != nullptr) others.emplace(parts_.others);
  columns_.offsets.assign(1, 0);
  columns_.values.clear();
  diagonal_.clear();
  std::size_t most = 0;
  std::vector<char> is_mirrored;
  for (Index node : nodes_) {
    most += static_cast<std::size_t>(own.row_size(node) + (others ? others->row_size(node) : 0));
    is_mirrored.push_back(own.is_mirrored(node) ? 1 : 0);
  }
  if (values_.size() < most * b * b + beyond_blocks) values_.resize(most * b * b + beyond_blocks);
  double* next = values_.data();
  const auto append = [&](Index column, const double* block, PetscInt width) {
    columns_.values.push_back(column);
    for (int r = 0; r < b; ++r, next += b) copy_numbers<b>(block + r * width, next);
  };
  mirrored_.assign(nodes_.size(), 0);
  for (Index k = 0; k < chosen; ++k) {
    for (const bool serves_twice : {true, false}) {
      const auto take = [&](Index column, const double* block, PetscInt width) {
        const Index place = place_[static_cast<std::size_t>(column)];
        if (place < 0 || serves_twice != (place < k && is_mirrored[static_cast<std::size_t>(place)] != 0)) return;
        if (place == k) diagonal_.push_back(static_cast<Index>(columns_.values.size()));
        mirrored_[static_cast<std::size_t>(k)] += serves_twice ? 1 : 0;
        append(place, block, width);
      };
      is_mirrored[static_cast<std::size_t>(k)] != 0 ? own.visit_lower(nodes_[k], take) : own.visit(nodes_[k], take);
    }
    if (others) others->visit(nodes_[k], [&](Index ghost, const double* block, PetscInt width) { append(chosen + ghost, block, width); });
    columns_.offsets.push_back(static_cast<Index>(columns_.values.size()));
  }
  x_.assign(static_cast<std::size_t>((chosen + ghosts_) * lanes_of(b)), 0.0);
  y_.resize(static_cast<std::size_t>(chosen * lanes_of(b)));
}

PetscErrorCode PrincipalSubmatrix::multiply_shell(Mat shell, Vec x, Vec y) {
  PetscFunctionBeginUser;
  PrincipalSubmatrix* its = nullptr;
  PetscCall(MatShellGetContext(shell, &its));
  PetscCallCXX(its->with_block([&]<int b>() { its->multiply<b>(x, y); }));
  PetscFunctionReturn(0);
}

template <int b>
void PrincipalSubmatrix::multiply(Vec x, Vec y) {
  const VecRead from(x);
  const auto chosen = static_cast<Index>(nodes_.size());
  for (Index k = 0; k < chosen; ++k) copy_numbers<b>(from.data() + k * b, node<b>(x_.data(), k));
  if (fetch_ != nullptr) fetch_ghosts<b>(from.data());
  multiply_rows<b>(VecWrite(y).data());
}

template <int b>
void PrincipalSubmatrix::multiply_rows(double* y) {
  const double* block = values_.data();
  const auto chosen = static_cast<Index>(nodes_.size());
  for (Index k = 0; k < chosen; ++k) {
    multiply_row<b>(k, std::as_const(columns_)[k], mirrored_[static_cast<std::size_t>(k)], block, x_.data(), y_.data());
    block += static_cast<std::ptrdiff_t>(columns_.row_size(k)) * b * b;
  }
  for (Index k = 0; k < chosen; ++k) copy_numbers<b>(node<b>(y_.data(), k), y + k * b);
}

template <int b>
void PrincipalSubmatrix::fetch_ghosts(const double* x) {
  {
    const VecWrite to(whole_);
    for (std::size_t k = 0; k < nodes_.size(); ++k) copy_numbers<b>(x + k * b, to.data() + nodes_[k] * b);
  }
  POLYSLIP_PETSC(VecScatterBegin(fetch_, whole_, of_ghosts_, INSERT_VALUES, SCATTER_FORWARD));
  POLYSLIP_PETSC(VecScatterEnd(fetch_, whole_, of_ghosts_, INSERT_VALUES, SCATTER_FORWARD));
  const VecRead from(of_ghosts_);
  for (Index k = 0; k < ghosts_; ++k) copy_numbers<b>(from.data() + k * b, node<b>(x_.data(), static_cast<Index>(nodes_.size()) + k));
}

PetscErrorCode PrincipalSubmatrix::diagonal_of_shell(Mat shell, Vec diagonal) {
  PetscFunctionBeginUser;
  PrincipalSubmatrix* its = nullptr;
  PetscCall(MatShellGetContext(shell, &its));
  const VecWrite to(diagonal);
  const int b = its->block_;
  for (Index k = 0; k < static_cast<Index>(its->nodes_.size()); ++k) {
    const double* block = its->values_.data() + static_cast<std::size_t>(its->diagonal_[static_cast<std::size_t>(k)]) * static_cast<std::size_t>(b * b);
    for (int r = 0; r < b; ++r) to[k * b + r] = block[r * b + r];
  }
  PetscFunctionReturn(0);
}

}  // namespace polyslip::la
