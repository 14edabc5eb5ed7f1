// Loops of assembly over cells: kernel by kernel over a batch of cells, whose elements and matrices stay in cache and are allocated once.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "polyslip/common/types.hpp"
#include "polyslip/la/kernel_log.hpp"
#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::assembly {

/// As many as there is cache for, within reason: fewer and the clock is read too often.
inline std::size_t cells_per_batch(double entries_per_cell) {
  constexpr double entries = 1 << 16;  // 520 kB
  return static_cast<std::size_t>(std::clamp(entries / std::max(1.0, entries_per_cell), 4.0, 512.0));
}

/// `slots` are the cells of a batch, with a member `cell` and whatever the kernels keep. Each kernel takes a slot and returns its
/// floating-point operations.
template <class Slot, class Geometry, class Matrix, class Insert>
void in_batches(std::span<const Index> cells, std::vector<Slot>& slots, la::KernelLog& log, Geometry&& geometry, Matrix&& matrix,
                Insert&& insert) {
  for (std::size_t begin = 0; begin < cells.size(); begin += slots.size()) {
    const auto batch = std::span(slots).first(std::min(slots.size(), cells.size() - begin));
    for (std::size_t i = 0; i < batch.size(); ++i) batch[i].cell = cells[begin + i];
    const auto run = [&](la::Kernel kernel, auto&& body) {
      la::KernelScope scope(log, kernel);
      for (Slot& slot : batch) scope.add_flops(body(slot));
    };
    run(la::Kernel::geometry, geometry);
    run(la::Kernel::local_matrices, matrix);
    run(la::Kernel::insertion, insert);
  }
}

/// What the geometry of all cells has to read [bytes]: coordinates, and the nodes of faces and the faces and nodes of cells.
double bytes_of_geometry(const mesh::PolyMesh& mesh);

/// The entries of a matrix [bytes].
double bytes_of_entries(Mat matrix);

}  // namespace polyslip::assembly
