#include "polyslip/la/hierarchy_update.hpp"

#include <petsc/private/petscimpl.h>  // PetscObjectStateIncrease

#include <algorithm>
#include <functional>
#include <optional>
#include <stdexcept>
#include <utility>

#include "polyslip/la/aij_parts.hpp"
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
  const AijParts parts(like);
  std::vector<PetscInt> own(static_cast<std::size_t>(end - begin), 0), others(own.size(), 0), columns;
  const auto for_each_part = [&](auto&& visit) {
    visit(parts.own, own, [&](PetscInt column) { return first_column + column; });
    if (parts.others != nullptr) visit(parts.others, others, [&](PetscInt column) { return parts.global[column]; });
  };
  for_each_part([&](Mat part, std::vector<PetscInt>& sizes, auto&&) {
    const AijRows entries(part);
    for (const PetscInt row : rows) sizes[static_cast<std::size_t>(row)] = entries.offsets()[row + 1] - entries.offsets()[row];
  });
  Handle<Mat> matrix;
  POLYSLIP_PETSC(MatCreateAIJ(comm_of(like), end - begin, end_column - first_column, rows_total, columns_total, 0, own.data(), 0, others.data(),
                              matrix.put()));
  for_each_part([&](Mat part, std::vector<PetscInt>&, auto&& global) {
    const AijRows entries(part);
    for (const PetscInt row : rows) {
      columns.clear();
      entries.visit(row, 1, [&](PetscInt, PetscInt column, PetscScalar) { columns.push_back(global(column)); });
      const PetscInt its_number = begin + row;
      const std::vector<PetscScalar> zeros(columns.size(), 0);
      POLYSLIP_PETSC(MatSetValues(matrix, 1, &its_number, static_cast<PetscInt>(columns.size()), columns.data(), zeros.data(), INSERT_VALUES));
    }
  });
  POLYSLIP_PETSC(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
  return matrix;
}

/// Rows of this rank that have entries.
std::vector<PetscInt> filled_rows(Mat matrix) {
  std::vector<PetscInt> rows;
  const AijParts parts(matrix);
  const AijRows own(parts.own);
  std::optional<AijRows> others;
  if (parts.others != nullptr) others.emplace(parts.others);
  const auto is_filled = [](const AijRows& entries, PetscInt row) { return entries.offsets()[row + 1] > entries.offsets()[row]; };
  for (PetscInt row = 0; row < own.rows(); ++row)
    if (is_filled(own, row) || (others && is_filled(*others, row))) rows.push_back(row);
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

/// Calls visit for the preconditioner of each field, if there are any.
void for_each_inner(PC pc, void (*visit)(PC)) {
  for_each_field(pc, [visit](KSP field) {
    PC inner = nullptr;
    POLYSLIP_PETSC(KSPGetPC(field, &inner));
    visit(inner);
  });
}

PetscInt levels_of(PC hierarchy) {
  PetscInt levels = 0;
  POLYSLIP_PETSC(PCMGGetLevels(hierarchy, &levels));
  return levels;
}

}  // namespace

void begin_full_set_up(PC pc) {
  for_each_inner(pc, begin_full_set_up);
  if (!HierarchyUpdate::can_update(pc)) return;
  for (PetscInt level = 0; level < levels_of(pc); ++level) forget_changed_rows(level_of(pc, level).first);
}

void complete_hierarchy(PC pc) {
  for_each_inner(pc, complete_hierarchy);
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

HierarchyUpdate::HierarchyUpdate(Mat fine, const std::vector<PetscInt>& rows) : fine_(fine), change_(rows_of(fine, rows)), fine_rows_(fine, rows) {
  form_galerkin_products_by_blocks(change_, forms_symmetric_products(fine));
}

bool HierarchyUpdate::can_update(PC pc) {
  PetscBool is_hierarchy = PETSC_FALSE;
  POLYSLIP_PETSC(PetscObjectTypeCompareAny(reinterpret_cast<PetscObject>(pc), &is_hierarchy, PCGAMG, PCML, ""));
  if (!is_hierarchy) return false;
  return levels_of(pc) > 1;
}

HierarchyUpdate::Rows::Rows(Mat matrix, std::vector<PetscInt> rows) : rows_(std::move(rows)) {
  const AijParts parts(matrix);
  const auto keep = [&](Mat part, std::vector<PetscScalar>& values) {
    const AijRows entries(part);
    std::size_t size = 0;
    for (const PetscInt row : rows_) size += static_cast<std::size_t>(entries.offsets()[row + 1] - entries.offsets()[row]);
    values.reserve(size);
    for (const PetscInt row : rows_)
      values.insert(values.end(), entries.values() + entries.offsets()[row], entries.values() + entries.offsets()[row + 1]);
  };
  keep(parts.own, own_);
  if (parts.others != nullptr) keep(parts.others, others_);
}

void HierarchyUpdate::Rows::subtract_from(Mat matrix, Mat difference) const {
  const AijParts now(matrix), parts(difference);
  const auto subtract = [&](Mat part, Mat its_difference, const std::vector<PetscScalar>& before) {
    const AijRows entries(part), places(its_difference);
    const AijValues values(its_difference);
    auto old = before.begin();
    for (const PetscInt row : rows_) {
      PetscScalar* value = values.data() + places.offsets()[row];
      entries.visit(row, 1, [&](PetscInt, PetscInt, PetscScalar entry) { *value++ = entry - *old++; });
    }
  };
  subtract(now.own, parts.own, own_);
  if (now.others != nullptr) subtract(now.others, parts.others, others_);
  POLYSLIP_PETSC(PetscObjectStateIncrease(reinterpret_cast<PetscObject>(difference)));
}

void HierarchyUpdate::Rows::set_sum(Mat matrix, Mat change) const {
  const AijParts sums(matrix), changes(change);
  const auto add = [&](Mat part, Mat its_change, const std::vector<PetscScalar>& before, auto&& is_same) {
    const AijRows places(part), entries(its_change);
    const AijValues values(part);
    auto old = before.begin();
    for (const PetscInt row : rows_) {
      const PetscInt *begin = places.columns() + places.offsets()[row], *end = places.columns() + places.offsets()[row + 1], *place = begin;
      PetscScalar* sum = values.data() + places.offsets()[row];
      std::copy_n(old, end - begin, sum);
      old += end - begin;
      entries.visit(row, 1, [&](PetscInt, PetscInt column, PetscScalar value) {  // mostly in the order of the columns of the matrix
        const auto has = [&](PetscInt its_column) { return is_same(its_column, column); };
        place = std::find_if(place, end, has);
        if (place == end) place = std::find_if(begin, end, has);
        if (place == end) throw std::logic_error("HierarchyUpdate: a coarse operator has no place for a change of its row");
        sum[place++ - begin] += value;
      });
    }
  };
  add(sums.own, changes.own, own_, std::equal_to<PetscInt>());
  if (sums.others != nullptr)
    add(sums.others, changes.others, others_, [&](PetscInt a, PetscInt b) { return sums.global[a] == changes.global[b]; });
  POLYSLIP_PETSC(PetscObjectStateIncrease(reinterpret_cast<PetscObject>(matrix)));
}

void HierarchyUpdate::apply(PC pc) {
  fine_rows_.subtract_from(fine_, change_);
  const PetscInt levels = levels_of(pc);
  const bool first = coarse_changes_.empty();
  coarse_changes_.resize(static_cast<std::size_t>(levels) - 1);
  Mat change = change_;
  for (PetscInt level = levels - 1; level > 0; --level) {
    const auto at = static_cast<std::size_t>(levels - 1 - level);
    Handle<Mat>& coarse = coarse_changes_[at];
    Mat prolongation = nullptr, operator_matrix = level_of(pc, level - 1).second;
    POLYSLIP_PETSC(PCMGGetInterpolation(pc, level, &prolongation));
    if (first) {
      POLYSLIP_PETSC(MatPtAP(change, prolongation, MAT_INITIAL_MATRIX, PETSC_DEFAULT, coarse.put()));
      coarse_rows_.emplace_back(operator_matrix, filled_rows(coarse));
    } else {
      Mat reused = coarse;
      POLYSLIP_PETSC(MatPtAP(change, prolongation, MAT_REUSE_MATRIX, PETSC_DEFAULT, &reused));
    }
    coarse_rows_[at].set_sum(operator_matrix, coarse);
    change = coarse;
  }
  // Smoothers with the eigenvalues of the old matrix on the finest level alone, where open faces come to stick, cost four times the iterations
  // (tets of poromechanics_3d).
  for (PetscInt level = 0; level < levels; ++level) {
    const bool is_finest = level == levels - 1;
    const auto [smoother, matrix] = level_of(pc, level);
    set_up_for_changed_rows(smoother, matrix, (is_finest ? fine_rows_ : coarse_rows_[static_cast<std::size_t>(levels - 2 - level)]).rows());
  }
}

}  // namespace polyslip::la
