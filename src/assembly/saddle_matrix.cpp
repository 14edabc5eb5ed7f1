#include "polyslip/assembly/saddle_matrix.hpp"

#include <numeric>

namespace polyslip::assembly {

namespace {

/// Global numbers, in the saddle Vec, of the first component of each local copy, bubble and multiplier.
struct SaddleNumbers {
  std::vector<Index> nodal, bubble, multiplier;
};

SaddleNumbers number_unknowns(const MechanicsSystem& system) {
  const Layout& layout = system.layout();
  const mesh::DistributedMesh& mesh = system.mesh();
  la::Handle<Vec> x = layout.create_vector();
  PetscInt first = 0;
  POLYSLIP_PETSC(VecGetOwnershipRange(x, &first, nullptr));
  SaddleNumbers n{std::vector<Index>(mesh.copies.local()), std::vector<Index>(mesh.fractures.local()),
                  std::vector<Index>(mesh.fractures.local())};
  const int dim = layout.dim();
  for (Index i = 0; i < mesh.copies.owned; ++i) n.nodal[i] = first + dim * i;
  for (Index f = 0; f < mesh.fractures.owned; ++f) {
    n.bubble[f] = first + layout.bubble_start() + dim * f;
    n.multiplier[f] = first + layout.multiplier_start() + dim * f;
  }
  layout.copy_halo().owner_to_ghost(std::span<Index>(n.nodal));
  layout.fracture_halo().owner_to_ghost(std::span<Index>(n.bubble));
  layout.fracture_halo().owner_to_ghost(std::span<Index>(n.multiplier));
  return n;
}

/// Hands every entry of the owned rows to `insert(row, col, value)`; rows of prescribed components are those of the identity.
template <class Insert>
void visit_entries(const MechanicsSystem& system, const SaddleNumbers& numbers, Insert&& insert) {
  const Layout& layout = system.layout();
  const mesh::DistributedMesh& mesh = system.mesh();
  const int dim = layout.dim();
  const auto& fixed = system.fixed();

  // Bulk: the nodal matrix, its columns renumbered.
  PetscInt first = 0;
  POLYSLIP_PETSC(MatGetOwnershipRange(system.matrix(), &first, nullptr));
  std::vector<std::pair<GlobalIndex, Index>> ghosts;
  for (Index i = mesh.copies.owned; i < mesh.copies.local(); ++i) ghosts.emplace_back(mesh.copies.global(i), i);
  std::sort(ghosts.begin(), ghosts.end());
  const auto local_copy = [&](GlobalIndex copy) {
    if (copy >= mesh.copies.first && copy < mesh.copies.first + mesh.copies.owned) return copy - mesh.copies.first;
    return std::lower_bound(ghosts.begin(), ghosts.end(), std::pair<GlobalIndex, Index>(copy, 0))->second;
  };
  for (Index row = 0; row < layout.nodal_size(); ++row) {
    const Index target = numbers.nodal[row / dim] + row % dim;
    if (fixed[row]) {
      insert(target, target, 1.0);
      continue;
    }
    PetscInt n = 0;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    POLYSLIP_PETSC(MatGetRow(system.matrix(), first + row, &n, &columns, &values));
    for (PetscInt k = 0; k < n; ++k) insert(target, numbers.nodal[local_copy(columns[k] / dim)] + columns[k] % dim, values[k]);
    POLYSLIP_PETSC(MatRestoreRow(system.matrix(), first + row, &n, &columns, &values));
  }

  // + cells.
  const ContactCells& cells = system.contact_cells();
  for (Index p = 0; p < cells.size(); ++p) {
    const auto m = cells.saddle_blocks(p, system.linearised_law());
    const auto external = cells.external(p), faces = cells.faces_of(p);
    const int nb = dim * static_cast<int>(faces.size());
    const auto e_number = [&](int i) { return numbers.nodal[external[i / dim]] + i % dim; };
    const auto e_row = [&](int i) { return external[i / dim] < mesh.copies.owned && !fixed[dim * external[i / dim] + i % dim]; };
    const auto e_col = [&](int i) { return !fixed[dim * external[i / dim] + i % dim]; };
    const auto i_number = [&](int i) { return (i < nb ? numbers.bubble : numbers.multiplier)[faces[(i % nb) / dim]] + i % dim; };
    const bool own = cells.mesh_cell(p) < mesh.cells.owned;
    for (int i = 0; i < m.ee.rows(); ++i) {
      if (!e_row(i)) continue;
      for (int j = 0; j < m.ee.cols(); ++j)
        if (e_col(j)) insert(e_number(i), e_number(j), m.ee(i, j));
      for (int j = 0; j < m.ei.cols(); ++j) insert(e_number(i), i_number(j), m.ei(i, j));
    }
    for (int i = 0; own && i < m.ii.rows(); ++i) {
      for (int j = 0; j < m.ie.cols(); ++j)
        if (e_col(j)) insert(i_number(i), e_number(j), m.ie(i, j));
      for (int j = 0; j < m.ii.cols(); ++j) insert(i_number(i), i_number(j), m.ii(i, j));
    }
  }
}

}  // namespace

la::Handle<Mat> create_saddle_matrix(const MechanicsSystem& system) {
  const SaddleNumbers numbers = number_unknowns(system);
  const Index n = system.layout().size();
  la::Handle<Mat> pattern, matrix;
  POLYSLIP_PETSC(MatCreate(system.mesh().comm, pattern.put()));
  POLYSLIP_PETSC(MatSetSizes(pattern, n, n, PETSC_DETERMINE, PETSC_DETERMINE));
  POLYSLIP_PETSC(MatSetType(pattern, MATPREALLOCATOR));
  POLYSLIP_PETSC(MatSetUp(pattern));
  visit_entries(system, numbers, [&](Index row, Index col, double) {
    POLYSLIP_PETSC(MatSetValue(pattern, row, col, 0.0, ADD_VALUES));
  });
  POLYSLIP_PETSC(MatAssemblyBegin(pattern, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(pattern, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatCreate(system.mesh().comm, matrix.put()));
  POLYSLIP_PETSC(MatSetSizes(matrix, n, n, PETSC_DETERMINE, PETSC_DETERMINE));
  POLYSLIP_PETSC(MatSetType(matrix, MATAIJ));
  POLYSLIP_PETSC(MatPreallocatorPreallocate(pattern, PETSC_TRUE, matrix));
  return matrix;
}

void fill_saddle_matrix(const MechanicsSystem& system, Mat matrix) {
  const SaddleNumbers numbers = number_unknowns(system);
  POLYSLIP_PETSC(MatZeroEntries(matrix));
  visit_entries(system, numbers, [&](Index row, Index col, double value) {
    POLYSLIP_PETSC(MatSetValue(matrix, row, col, value, ADD_VALUES));
  });
  POLYSLIP_PETSC(MatAssemblyBegin(matrix, MAT_FINAL_ASSEMBLY));
  POLYSLIP_PETSC(MatAssemblyEnd(matrix, MAT_FINAL_ASSEMBLY));
}

}  // namespace polyslip::assembly
