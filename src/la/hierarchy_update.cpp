#include "polyslip/la/hierarchy_update.hpp"

#include <algorithm>
#include <utility>

#include "polyslip/la/field_split.hpp"
#include "polyslip/la/galerkin_product.hpp"
#include "polyslip/la/incomplete_cholesky.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::la {

namespace {

/// A matrix of the layout of `like` with the entries of the given rows only, all zero.
Handle<Mat> rows_of(Mat like, const std::vector<PetscInt>& rows) {
  PetscInt begin = 0, end = 0, first_column = 0, end_column = 0, columns_total = 0, rows_total = 0;
  POLYSLIP_PETSC(MatGetOwnershipRange(like, &begin, &end));
  POLYSLIP_PETSC(MatGetOwnershipRangeColumn(like, &first_column, &end_column));
  POLYSLIP_PETSC(MatGetSize(like, &rows_total, &columns_total));
  std::vector<PetscInt> diagonal(static_cast<std::size_t>(end - begin), 0), off_diagonal(diagonal.size(), 0);
  for (PetscInt row : rows) {
    PetscInt n = 0;
    const PetscInt* columns = nullptr;
    POLYSLIP_PETSC(MatGetRow(like, row, &n, &columns, nullptr));
    for (PetscInt k = 0; k < n; ++k) ++(columns[k] >= first_column && columns[k] < end_column ? diagonal : off_diagonal)[row - begin];
    POLYSLIP_PETSC(MatRestoreRow(like, row, &n, &columns, nullptr));
  }
  Handle<Mat> matrix;
  POLYSLIP_PETSC(MatCreateAIJ(comm_of(like), end - begin, end_column - first_column, rows_total, columns_total, 0, diagonal.data(), 0,
                              off_diagonal.data(), matrix.put()));
  return matrix;
}

/// Rows of this rank that have entries.
std::vector<PetscInt> filled_rows(Mat matrix) {
  std::vector<PetscInt> rows;
  PetscInt begin = 0, end = 0;
  POLYSLIP_PETSC(MatGetOwnershipRange(matrix, &begin, &end));
  for (PetscInt row = begin; row < end; ++row) {
    PetscInt n = 0;
    POLYSLIP_PETSC(MatGetRow(matrix, row, &n, nullptr, nullptr));
    if (n > 0) rows.push_back(row);
    POLYSLIP_PETSC(MatRestoreRow(matrix, row, &n, nullptr, nullptr));
  }
  return rows;
}

void fill_empty_rows_of(Mat matrix) {
  Handle<Vec> diagonal;
  PetscReal largest = 0;
  POLYSLIP_PETSC(MatCreateVecs(matrix, nullptr, diagonal.put()));
  POLYSLIP_PETSC(MatGetDiagonal(matrix, diagonal));
  POLYSLIP_PETSC(VecMax(diagonal, nullptr, &largest));
  PetscInt begin = 0, end = 0;
  POLYSLIP_PETSC(VecGetOwnershipRange(diagonal, &begin, &end));
  const VecRead values(diagonal);
  for (PetscInt row = begin; row < end; ++row)
    if (values[row - begin] == 0) POLYSLIP_PETSC(MatSetValue(matrix, row, row, largest, INSERT_VALUES));
  POLYSLIP_PETSC(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
}

/// Solver and operator of a level, 0 the coarsest.
std::pair<KSP, Mat> level_of(PC hierarchy, PetscInt level) {
  KSP smoother = nullptr;
  Mat matrix = nullptr;
  POLYSLIP_PETSC(PCMGGetSmoother(hierarchy, level, &smoother));
  POLYSLIP_PETSC(KSPGetOperators(smoother, nullptr, &matrix));
  return {smoother, matrix};
}

PetscInt levels_of(PC hierarchy) {
  PetscInt levels = 0;
  POLYSLIP_PETSC(PCMGGetLevels(hierarchy, &levels));
  return levels;
}

}  // namespace

void complete_hierarchy(PC pc) {
  for_each_field(pc, [](KSP field) {
    PC inner = nullptr;
    POLYSLIP_PETSC(KSPGetPC(field, &inner));
    complete_hierarchy(inner);
  });
  if (!HierarchyUpdate::can_update(pc)) return;
  const PetscInt coarse = levels_of(pc) - 1;
  for (PetscInt level = 0; level < coarse; ++level) {
    const auto [smoother, matrix] = level_of(pc, level);
    fill_empty_rows_of(matrix);
    POLYSLIP_PETSC(KSPSetOperators(smoother, matrix, matrix));
    POLYSLIP_PETSC(KSPSetUp(smoother));
  }
  take_residuals_from_smoothers(pc);
}

HierarchyUpdate::HierarchyUpdate(Mat fine, std::vector<PetscInt> rows) : fine_(fine), rows_(std::move(rows)), change_(rows_of(fine, rows_)) {
  form_galerkin_products_by_blocks(change_);
}

bool HierarchyUpdate::can_update(PC pc) {
  PetscBool is_hierarchy = PETSC_FALSE;
  POLYSLIP_PETSC(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(pc), &is_hierarchy, PCGAMG, PCML, ""));
  if (!is_hierarchy) return false;
  return levels_of(pc) > 1;
}

void HierarchyUpdate::is_set_up() {
  fine_rows_ = {};
  coarse_changes_.clear();
  coarse_rows_.clear();
  for (PetscInt row : rows_) fine_rows_.keep(fine_, row);
}

void HierarchyUpdate::write_change() {
  std::vector<PetscScalar> difference;
  auto before = fine_rows_.values.begin();
  for (PetscInt row : rows_) {
    PetscInt n = 0;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    POLYSLIP_PETSC(MatGetRow(fine_, row, &n, &columns, &values));
    difference.assign(values, values + n);
    for (PetscScalar& value : difference) value -= *before++;
    POLYSLIP_PETSC(MatSetValues(change_, 1, &row, n, columns, difference.data(), INSERT_VALUES));
    POLYSLIP_PETSC(MatRestoreRow(fine_, row, &n, &columns, &values));
  }
  POLYSLIP_PETSC(MatAssemblyBegin(change_, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(change_, MAT_FINAL_ASSEMBLY));
}

void HierarchyUpdate::Rows::keep(Mat matrix, PetscInt row) {
  PetscInt n = 0;
  const PetscInt* its_columns = nullptr;
  const PetscScalar* its_values = nullptr;
  POLYSLIP_PETSC(MatGetRow(matrix, row, &n, &its_columns, &its_values));
  rows.push_back(row);
  sizes.push_back(n);
  columns.insert(columns.end(), its_columns, its_columns + n);
  values.insert(values.end(), its_values, its_values + n);
  POLYSLIP_PETSC(MatRestoreRow(matrix, row, &n, &its_columns, &its_values));
}

void HierarchyUpdate::Rows::put_back(Mat matrix) const {
  std::size_t at = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    POLYSLIP_PETSC(MatSetValues(matrix, 1, &rows[i], sizes[i], columns.data() + at, values.data() + at, INSERT_VALUES));
    at += static_cast<std::size_t>(sizes[i]);
  }
  POLYSLIP_PETSC(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
}

void HierarchyUpdate::apply(PC pc) {
  write_change();
  const PetscInt levels = levels_of(pc);
  const bool first = coarse_changes_.empty();
  if (first) {
    coarse_changes_.resize(static_cast<std::size_t>(levels) - 1);
    coarse_rows_.resize(coarse_changes_.size());
  }
  Mat change = change_;
  for (PetscInt level = levels - 1; level > 0; --level) {
    const auto at = static_cast<std::size_t>(levels - 1 - level);
    Handle<Mat>& coarse = coarse_changes_[at];
    Rows& rows = coarse_rows_[at];
    Mat prolongation = nullptr, operator_matrix = level_of(pc, level - 1).second;
    POLYSLIP_PETSC(PCMGGetInterpolation(pc, level, &prolongation));
    if (first) {
      POLYSLIP_PETSC(MatPtAP(change, prolongation, MAT_INITIAL_MATRIX, PETSC_DEFAULT, coarse.put()));
      for (PetscInt row : filled_rows(coarse)) rows.keep(operator_matrix, row);
    } else {
      Mat reused = coarse;
      POLYSLIP_PETSC(MatPtAP(change, prolongation, MAT_REUSE_MATRIX, PETSC_DEFAULT, &reused));
      rows.put_back(operator_matrix);
    }
    POLYSLIP_PETSC(MatAXPY(operator_matrix, 1.0, coarse, SUBSET_NONZERO_PATTERN));
    change = coarse;
  }
  // Smoothers with the eigenvalues of the old matrix on the finest level alone, where open faces come to stick, cost four times the iterations
  // (tets of poromechanics_3d).
  for (PetscInt level = 0; level < levels; ++level) {
    const bool is_finest = level == levels - 1;
    const auto [smoother, matrix] = level_of(pc, level);
    set_up_for_changed_rows(smoother, matrix, is_finest ? rows_ : coarse_rows_[static_cast<std::size_t>(levels - 2 - level)].rows);
  }
}

}  // namespace polyslip::la
