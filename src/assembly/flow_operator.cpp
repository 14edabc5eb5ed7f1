#include "polyslip/assembly/flow_operator.hpp"

#include <algorithm>
#include <numeric>

#include "polyslip/assembly/cell_batches.hpp"
#include "polyslip/common/mpi.hpp"

namespace polyslip::assembly {

namespace {

/// Couplings of each owned unknown: all members of the groups that it belongs to.
Csr graph_of_groups(const Csr& groups, Index owned, Index local) {
  Csr groups_of;
  groups_of.offsets.assign(static_cast<std::size_t>(owned) + 1, 0);
  for (Index unknown : groups.values)
    if (unknown < owned) ++groups_of.offsets[unknown + 1];
  for (Index i = 0; i < owned; ++i) groups_of.offsets[i + 1] += groups_of.offsets[i];
  groups_of.values.resize(static_cast<std::size_t>(groups_of.offsets[owned]));
  std::vector<Index> next(groups_of.offsets.begin(), groups_of.offsets.end() - 1);
  for (Index g = 0; g < groups.rows(); ++g)
    for (Index unknown : groups[g])
      if (unknown < owned) groups_of.values[next[unknown]++] = g;

  Csr graph;
  graph.offsets.reserve(static_cast<std::size_t>(owned) + 1);
  std::vector<Index> seen_by(static_cast<std::size_t>(local), -1);
  for (Index row = 0; row < owned; ++row) {
    for (Index g : groups_of[row])
      for (Index unknown : groups[g]) {
        if (seen_by[unknown] == row) continue;
        seen_by[unknown] = row;
        graph.values.push_back(unknown);
      }
    graph.offsets.push_back(static_cast<Index>(graph.values.size()));
  }
  return graph;
}

}  // namespace

FlowOperator::FlowOperator(const mesh::DistributedMesh& mesh, const FlowLayout& layout,
                           std::span<const physics::HydraulicProperties> rock, double viscosity,
                           std::span<const physics::FractureConductivity> fractures, std::span<const char> barriers)
    : mesh_(mesh),
      layout_(layout),
      drop_from_(static_cast<std::size_t>(layout.local_size()), -1),
      points_(static_cast<std::size_t>(layout.size())) {
  if (layout.with_fractures()) choose_drops(rock, viscosity, fractures);
  const mesh::Numbering& numbers = layout.numbering();
  matrix_ = std::make_unique<la::BlockMatrix>(la::BlockMatrix::Layout{mesh.comm, 1, numbers.owned, numbers.first, numbers.ghosts},
                                              graph());
  const std::vector<Index> tight_ridges = layout.with_fractures() ? ridges_of_barriers(barriers) : std::vector<Index>();
  matrix_->begin_writing();
  matrix_->set_zero();
  mpi::together(mesh.comm, [&] {
    assemble_rock(rock, viscosity);
    if (layout.with_fractures()) measure_fractures(barriers, tight_ridges);
  });
  if (layout.with_fractures()) keep_rock_rows();
  matrix_->end_writing();
  if (!layout.with_fractures()) return;
  place_fracture_points();
  set_conductivities(fractures);
}

void FlowOperator::choose_drops(std::span<const physics::HydraulicProperties> rock, double viscosity,
                                std::span<const physics::FractureConductivity> fractures) {
  std::vector<Index> is_conductive(drop_from_.size(), 0);
  mpi::together(mesh_.comm, [&] {
    spaces::HfvCell hfv(mesh_.mesh);
    for (Index f = 0; f < mesh_.fractures.local(); ++f)
      for (int side = 0; side < 2; ++side) {
        const Index face = mesh_.fracture_faces[f], cell = mesh_.mesh.face_cells[face][side];
        if (cell >= mesh_.cells.owned) continue;
        hfv.build(cell);
        const auto faces = mesh_.mesh.cell_faces[cell];
        const spaces::HfvFace& seen = hfv.faces()[std::find(faces.begin(), faces.end(), face) - faces.begin()];
        const double rock_side = seen.normal.dot(rock[cell].permeability * seen.normal) / (viscosity * seen.distance);
        is_conductive[sides(f)[side]] = fractures[f].through > rock_side ? 1 : 0;
      }
  });
  layout_.halo().owner_to_ghost(std::span<Index>(is_conductive));  // ranks may round differently
  for (Index f = 0; f < mesh_.fractures.local(); ++f)
    for (Index side : sides(f))
      if (is_conductive[side] != 0) drop_from_[side] = layout_.fracture(f);
}

void FlowOperator::cell_element(Index cell, Element& element) const {
  element.unknowns.assign(1, layout_.cell(cell));
  for (Index face : mesh_.mesh.cell_faces[cell])
    element.unknowns.push_back(layout_.trace(mesh_.flow.face_traces[face][mesh_.mesh.face_cells[face][0] == cell ? 0 : 1]));
  const auto n = static_cast<Index>(element.unknowns.size());
  element.rows.resize(element.unknowns.size());
  std::iota(element.rows.begin(), element.rows.end(), 0);
  for (Index i = 1; i < n; ++i) {
    if (!is_drop(element.unknowns[i])) continue;
    element.unknowns.push_back(drop_from_[element.unknowns[i]]);
    element.rows.push_back(i);
  }
}

void FlowOperator::fracture_element(Index fracture_face, Element& element) const {
  element.unknowns.assign(1, layout_.fracture(fracture_face));
  for (Index ridge : mesh_.flow.fracture_ridges[fracture_face]) element.unknowns.push_back(layout_.ridge(ridge));
  element.rows.resize(element.unknowns.size());
  std::iota(element.rows.begin(), element.rows.end(), 0);
}

std::array<Index, 2> FlowOperator::sides(Index fracture_face) const {
  const auto& traces = mesh_.flow.face_traces[mesh_.fracture_faces[fracture_face]];
  return {layout_.trace(traces[0]), layout_.trace(traces[1])};
}

bool FlowOperator::any_owned(std::span<const Index> unknowns) const {
  return std::any_of(unknowns.begin(), unknowns.end(), [&](Index i) { return i < layout_.size(); });
}

Csr FlowOperator::graph() const {
  Csr groups;
  Element element;
  const auto add_group = [&](const auto& group) {
    if (any_owned(group)) groups.push_row(group);
  };
  for (Index cell = 0; cell < mesh_.mesh.n_cells(); ++cell) {
    cell_element(cell, element);
    add_group(element.unknowns);
  }
  for (Index f = 0; layout_.with_fractures() && f < mesh_.fractures.local(); ++f) {
    fracture_element(f, element);
    add_group(element.unknowns);
    for (Index side : sides(f))
      if (!is_drop(side)) add_group(std::array{layout_.fracture(f), side});
  }
  return graph_of_groups(groups, layout_.size(), layout_.local_size());
}

void FlowOperator::add(const Element& element, std::span<const double> block, std::size_t width, double scale) {
  std::array<double, 9> value{};  // for all the compiler knows blocks may be of 3 x 3
  for (std::size_t i = 0; i < element.unknowns.size(); ++i) {
    if (element.unknowns[i] >= layout_.size()) continue;
    const double* row = &block[static_cast<std::size_t>(element.rows[i]) * width];
    for (std::size_t j = 0; j < element.unknowns.size(); ++j) {
      value[0] = scale * row[element.rows[j]];
      matrix_->add(element.unknowns[i], element.unknowns[j], value.data(), 1);
    }
  }
}

/// A cell of a batch.
struct FlowOperator::RockSlot {
  spaces::HfvCell hfv;
  Index cell = -1;
  Element element;
  std::vector<double> T, block;
};

void FlowOperator::assemble_rock(std::span<const physics::HydraulicProperties> rock, double viscosity) {
  volumes_.resize(static_cast<std::size_t>(mesh_.cells.owned));
  std::vector<Index> cells;
  Element element;
  for (Index cell = 0; cell < mesh_.mesh.n_cells(); ++cell) {
    cell_element(cell, element);
    if (any_owned(element.unknowns)) cells.push_back(cell);
  }
  std::vector<RockSlot> slots(cells_per_batch(0), RockSlot{spaces::HfvCell(mesh_.mesh), -1, {}, {}, {}});
  const auto geometry = [](RockSlot& slot) {
    slot.hfv.build(slot.cell);
    return slot.hfv.flops();
  };
  const auto matrix = [&](RockSlot& slot) {
    const std::size_t n = slot.hfv.faces().size();
    slot.T.resize(n * n);
    slot.block.resize((n + 1) * (n + 1));
    physics::local_transmissibilities(slot.hfv, rock[slot.cell].permeability / viscosity, slot.T);
    physics::element_matrix(slot.T, static_cast<int>(n), slot.block);
    return physics::transmissibility_flops(static_cast<int>(n));
  };
  in_batches(cells, slots, kernels_, geometry, matrix, [&](RockSlot& slot) {
    cell_element(slot.cell, slot.element);
    add(slot.element, slot.block, slot.hfv.faces().size() + 1, 1.0);
    place_points(slot);
    return 2.0 * static_cast<double>(slot.block.size());
  });
  kernels_.add_bytes(la::Kernel::geometry, bytes_of_geometry(mesh_.mesh));
  kernels_.add_bytes(la::Kernel::local_matrices, static_cast<double>(rock.size_bytes()));
  kernels_.add_bytes(la::Kernel::insertion, 3 * bytes_of_entries(matrix_->get()));  // read and written, and a column and offset looked up for each
}

void FlowOperator::place_points(const RockSlot& slot) {
  const auto faces = slot.hfv.faces();
  for (std::size_t i = 0; i < faces.size(); ++i)
    if (slot.element.unknowns[i + 1] < layout_.size()) points_[slot.element.unknowns[i + 1]] = faces[i].centre;
  if (slot.cell >= mesh_.cells.owned) return;
  points_[slot.element.unknowns[0]] = slot.hfv.centre();
  volumes_[slot.cell] = slot.hfv.measure();
}

/// 1 on the unknowns of ridges that a barrier reaches.
std::vector<Index> FlowOperator::ridges_of_barriers(std::span<const char> barriers) const {
  std::vector<Index> reached(drop_from_.size(), 0);
  for (Index f = 0; f < mesh_.fractures.local(); ++f)
    if (barriers[f] != 0)
      for (Index ridge : mesh_.flow.fracture_ridges[f]) reached[layout_.ridge(ridge)] = 1;
  layout_.halo().owner_to_ghost(std::span<Index>(reached));  // only the owner sees all faces at a ridge
  return reached;
}

void FlowOperator::measure_fractures(std::span<const char> barriers, std::span<const Index> tight_ridges) {
  spaces::HfvCell hfv(mesh_.mesh);
  unit_T_offsets_.assign(1, 0);
  for (Index f = 0; f < mesh_.fractures.local(); ++f) {
    hfv.build_fracture_face(mesh_.fracture_faces[f]);
    areas_.push_back(hfv.measure());
    const std::size_t n = hfv.faces().size(), start = unit_T_.size();
    unit_T_.resize(start + n * n);
    physics::local_transmissibilities(hfv, Eigen::Matrix3d::Identity(), {&unit_T_[start], n * n});
    const auto ridges = mesh_.flow.fracture_ridges[f];
    for (std::size_t i = 0; i < n && barriers[f] == 0; ++i)
      if (tight_ridges[layout_.ridge(ridges[i])] != 0) physics::seal_face({&unit_T_[start], n * n}, n, i);
    unit_T_offsets_.push_back(unit_T_.size());
  }
}

void FlowOperator::keep_rock_rows() {
  Element element;
  for (Index f = 0; f < mesh_.fractures.local(); ++f) {
    fracture_element(f, element);
    const auto both = sides(f);
    element.unknowns.insert(element.unknowns.end(), both.begin(), both.end());
    std::copy_if(element.unknowns.begin(), element.unknowns.end(), std::back_inserter(fracture_rows_),
                 [&](Index i) { return i < layout_.size(); });
  }
  std::sort(fracture_rows_.begin(), fracture_rows_.end());
  fracture_rows_.erase(std::unique(fracture_rows_.begin(), fracture_rows_.end()), fracture_rows_.end());
  for (Index row : fracture_rows_)
    for (auto values : {matrix_->diagonal_row(row), matrix_->offdiagonal_row(row)})
      rock_rows_.insert(rock_rows_.end(), values.begin(), values.end());
}

void FlowOperator::place_fracture_points() {
  const mesh::PolyMesh& m = mesh_.mesh;
  for (Index f = 0; f < mesh_.fractures.owned; ++f)
    points_[layout_.fracture(f)] = spaces::face_geometry(m, mesh_.fracture_faces[f]).centre;
  for (Index r = 0; r < mesh_.flow.ridges.owned; ++r) {
    const auto& [first, second] = mesh_.flow.ridge_nodes[r];
    points_[layout_.ridge(r)] = second < 0 ? m.nodes[first] : Vec3((m.nodes[first] + m.nodes[second]) / 2);
  }
}

std::span<const double> FlowOperator::unit_transmissibilities(Index f) const {
  return std::span(unit_T_).subspan(unit_T_offsets_[f], unit_T_offsets_[f + 1] - unit_T_offsets_[f]);
}

void FlowOperator::set_conductivities(std::span<const physics::FractureConductivity> fractures) {
  conductivities_.assign(fractures.begin(), fractures.end());
  matrix_->begin_writing();
  auto rock = rock_rows_.begin();
  for (Index row : fracture_rows_)
    for (auto values : {matrix_->diagonal_row(row), matrix_->offdiagonal_row(row)}) {
      std::copy_n(rock, values.size(), values.begin());
      rock += static_cast<std::ptrdiff_t>(values.size());
    }
  Element element;
  std::vector<double> block;
  constexpr std::array<double, 4> exchange{1, -1, -1, 1};
  for (Index f = 0; f < static_cast<Index>(fractures.size()); ++f) {
    fracture_element(f, element);
    const std::size_t width = element.unknowns.size();
    block.resize(width * width);
    physics::element_matrix(unit_transmissibilities(f), static_cast<int>(width) - 1, block);
    add(element, block, width, fractures[f].along);
    for (Index side : sides(f)) {
      element = is_drop(side) ? Element{{side}, {0}} : Element{{side, layout_.fracture(f)}, {0, 1}};
      add(element, exchange, 2, areas_[f] * fractures[f].through);
    }
  }
  matrix_->end_writing();
}

double FlowOperator::fracture_form(Index f, std::span<const double> q) const {
  const auto ridges = mesh_.flow.fracture_ridges[f];
  const auto T = unit_transmissibilities(f);
  const double q_f = q[layout_.fracture(f)];
  double form = 0;
  for (std::size_t i = 0; i < ridges.size(); ++i)
    for (std::size_t j = 0; j < ridges.size(); ++j)
      form += (q[layout_.ridge(ridges[i])] - q_f) * T[i * ridges.size() + j] * (q[layout_.ridge(ridges[j])] - q_f);
  return form;
}

void FlowOperator::ridge_fluxes(Index f, std::span<const double> q, std::vector<double>& fluxes) const {
  const auto ridges = mesh_.flow.fracture_ridges[f];
  const auto T = unit_transmissibilities(f);
  fluxes.assign(ridges.size(), 0.0);
  for (std::size_t i = 0; i < ridges.size(); ++i)
    for (std::size_t j = 0; j < ridges.size(); ++j)
      fluxes[i] += conductivities_[f].along * T[i * ridges.size() + j] * (q[layout_.fracture(f)] - q[layout_.ridge(ridges[j])]);
}

Dissipation FlowOperator::dissipation(Vec q) const {
  std::vector<double> local(static_cast<std::size_t>(layout_.local_size()));
  layout_.gather(q, local);
  std::array<double, 2> parts{};
  for (Index f = 0; !conductivities_.empty() && f < mesh_.fractures.owned; ++f) {
    parts[0] += conductivities_[f].along * fracture_form(f, local);
    for (Index side : sides(f)) {
      const double drop = is_drop(side) ? local[side] : local[side] - local[layout_.fracture(f)];
      parts[1] += areas_[f] * conductivities_[f].through * drop * drop;
    }
  }
  mpi::sum_in_place(mesh_.comm, parts);
  la::Handle<Vec> flux = layout_.create_vector();
  PetscScalar total = 0;
  POLYSLIP_PETSC(MatMult(matrix(), q, flux));
  POLYSLIP_PETSC(VecDot(q, flux, &total));
  return {total - parts[0] - parts[1], parts[1], parts[0]};
}

void FlowOperator::aperture_derivative(Index f, std::span<const double> q, std::vector<Index>& rows,
                                       std::vector<double>& values) const {
  rows.assign(1, layout_.fracture(f));
  for (Index ridge : mesh_.flow.fracture_ridges[f]) rows.push_back(layout_.ridge(ridge));
  values.assign(rows.size(), 0.0);
  const auto T = unit_transmissibilities(f);
  const std::size_t n = rows.size() - 1;
  const double q_f = q[rows[0]];
  for (std::size_t i = 0; i < n; ++i) {
    double flux = 0;  // out of the face, at unit conductivity
    for (std::size_t j = 0; j < n; ++j) flux += T[i * n + j] * (q_f - q[rows[j + 1]]);
    values[0] += conductivities_[f].d_along * flux;
    values[i + 1] = -conductivities_[f].d_along * flux;
  }
  for (Index side : sides(f)) {
    const double into = areas_[f] * conductivities_[f].d_through * (is_drop(side) ? q[side] : q[side] - q_f);
    if (!is_drop(side)) values[0] -= into;
    rows.push_back(side);
    values.push_back(into);
  }
}

}  // namespace polyslip::assembly
