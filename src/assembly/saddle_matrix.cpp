#include "polyslip/assembly/saddle_matrix.hpp"

#include <numeric>

namespace polyslip::assembly {

namespace {

/// Global numbers, in the saddle Vec, of each local displacement and of the first component of each local bubble and multiplier.
struct SaddleNumbers {
  std::vector<Index> displacement, bubble, multiplier;
};

SaddleNumbers number_unknowns(const MechanicsSystem& system) {
  const Layout& layout = system.layout();
  const mesh::DistributedMesh& mesh = system.mesh();
  la::Handle<Vec> x = layout.create_vector();
  PetscInt first = 0;
  POLYSLIP_PETSC(VecGetOwnershipRange(x, &first, nullptr));
  SaddleNumbers n{std::vector<Index>(layout.local_displacements()), std::vector<Index>(mesh.fractures.local()),
                  std::vector<Index>(mesh.fractures.local())};
  const int dim = layout.dim();
  for (Index f = 0; f < mesh.fractures.owned; ++f) {
    n.bubble[f] = first + layout.bubble_start() + dim * f;
    n.multiplier[f] = first + layout.multiplier_start() + dim * f;
  }
  std::iota(n.displacement.begin(), n.displacement.begin() + layout.displacement_size(), first);
  layout.exchange(std::span<Index>(n.displacement));
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

  // Bulk.
  const la::BlockOperator& bulk = system.bulk();
  for (Index entity = 0; entity < layout.owned_entities(); ++entity) {
    const Index first = layout.first_displacement(entity);
    for (Index row = first; row < first + layout.width(entity); ++row)
      if (fixed[row]) insert(numbers.displacement[row], numbers.displacement[row], 1.0);
    bulk.visit_row(entity, [&](Index other, const double* block, int columns) {
      for (int r = 0; r < layout.width(entity); ++r)
        for (int c = 0; c < columns && !fixed[first + r]; ++c)
          insert(numbers.displacement[first + r], numbers.displacement[layout.first_displacement(other) + c], block[r * columns + c]);
    });
  }

  // + cells.
  const ContactCells& cells = system.contact_cells();
  for (Index p = 0; p < cells.size(); ++p) {
    const auto m = cells.saddle_blocks(p, system.linearised_law());
    const auto displacements = cells.displacements(p), faces = cells.faces_of(p);
    const int nb = dim * static_cast<int>(faces.size());
    const auto e_number = [&](int i) { return numbers.displacement[displacements[i]]; };
    const auto e_row = [&](int i) { return displacements[i] < layout.displacement_size() && !fixed[displacements[i]]; };
    const auto e_col = [&](int i) { return !fixed[displacements[i]]; };
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
