#include "polyslip/assembly/flow_operator.hpp"

#include <algorithm>

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
                           std::span<const physics::HydraulicProperties> rock, double viscosity)
    : mesh_(mesh), layout_(layout), points_(static_cast<std::size_t>(layout.size())) {
  const mesh::Numbering& numbers = layout.numbering();
  matrix_ = std::make_unique<la::BlockMatrix>(la::BlockMatrix::Layout{mesh.comm, 1, numbers.owned, numbers.first, numbers.ghosts},
                                              graph());
  matrix_->begin_writing();
  mpi::together(mesh.comm, [&] {
    assemble_rock(rock, viscosity);
    if (layout.with_fractures()) measure_fractures();
  });
  keep_rock_rows();
  matrix_->end_writing();
  place_points();
}

void FlowOperator::cell_unknowns(Index cell, std::vector<Index>& unknowns) const {
  unknowns.assign(1, layout_.cell(cell));
  for (Index face : mesh_.mesh.cell_faces[cell])
    unknowns.push_back(layout_.trace(mesh_.flow.face_traces[face][mesh_.mesh.face_cells[face][0] == cell ? 0 : 1]));
}

void FlowOperator::fracture_unknowns(Index fracture_face, std::vector<Index>& unknowns) const {
  unknowns.assign(1, layout_.fracture(fracture_face));
  for (Index ridge : mesh_.flow.fracture_ridges[fracture_face]) unknowns.push_back(layout_.ridge(ridge));
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
  std::vector<Index> unknowns;
  const auto add_group = [&](const auto& group) {
    if (any_owned(group)) groups.push_row(group);
  };
  for (Index cell = 0; cell < mesh_.mesh.n_cells(); ++cell) {
    cell_unknowns(cell, unknowns);
    add_group(unknowns);
  }
  for (Index f = 0; layout_.with_fractures() && f < mesh_.fractures.local(); ++f) {
    fracture_unknowns(f, unknowns);
    add_group(unknowns);
    for (Index side : sides(f)) add_group(std::array{layout_.fracture(f), side});
  }
  return graph_of_groups(groups, layout_.size(), layout_.local_size());
}

void FlowOperator::add(std::span<const Index> unknowns, std::span<const double> block, double scale) {
  const std::size_t n = unknowns.size();
  for (std::size_t i = 0; i < n; ++i) {
    if (unknowns[i] >= layout_.size()) continue;
    for (std::size_t j = 0; j < n; ++j) {
      const double value = scale * block[i * n + j];
      matrix_->add(unknowns[i], unknowns[j], &value, 1);
    }
  }
}

void FlowOperator::assemble_rock(std::span<const physics::HydraulicProperties> rock, double viscosity) {
  spaces::HfvCell hfv(mesh_.mesh);
  std::vector<Index> unknowns;
  std::vector<double> T, block;
  volumes_.resize(static_cast<std::size_t>(mesh_.cells.owned));
  for (Index cell = 0; cell < mesh_.mesh.n_cells(); ++cell) {
    cell_unknowns(cell, unknowns);
    if (!any_owned(unknowns)) continue;
    hfv.build(cell);
    const std::size_t n = unknowns.size() - 1;
    T.resize(n * n);
    block.resize((n + 1) * (n + 1));
    physics::local_transmissibilities(hfv, rock[cell].permeability / viscosity, T);
    physics::element_matrix(T, static_cast<int>(n), block);
    add(unknowns, block, 1.0);
    for (std::size_t i = 0; i < n; ++i)
      if (unknowns[i + 1] < layout_.size()) points_[unknowns[i + 1]] = hfv.faces()[i].centre;
    if (cell >= mesh_.cells.owned) continue;
    points_[unknowns[0]] = hfv.centre();
    volumes_[cell] = hfv.measure();
  }
}

void FlowOperator::measure_fractures() {
  spaces::HfvCell hfv(mesh_.mesh);
  unit_T_offsets_.assign(1, 0);
  for (Index f = 0; f < mesh_.fractures.local(); ++f) {
    hfv.build_fracture_face(mesh_.fracture_faces[f]);
    areas_.push_back(hfv.measure());
    const std::size_t n = hfv.faces().size(), start = unit_T_.size();
    unit_T_.resize(start + n * n);
    physics::local_transmissibilities(hfv, Eigen::Matrix3d::Identity(), {&unit_T_[start], n * n});
    unit_T_offsets_.push_back(unit_T_.size());
  }
}

void FlowOperator::keep_rock_rows() {
  if (!layout_.with_fractures()) return;
  std::vector<Index> unknowns;
  for (Index f = 0; f < mesh_.fractures.local(); ++f) {
    fracture_unknowns(f, unknowns);
    const auto both = sides(f);
    unknowns.insert(unknowns.end(), both.begin(), both.end());
    std::copy_if(unknowns.begin(), unknowns.end(), std::back_inserter(fracture_rows_), [&](Index i) { return i < layout_.size(); });
  }
  std::sort(fracture_rows_.begin(), fracture_rows_.end());
  fracture_rows_.erase(std::unique(fracture_rows_.begin(), fracture_rows_.end()), fracture_rows_.end());
  for (Index row : fracture_rows_)
    for (auto values : {matrix_->diagonal_row(row), matrix_->offdiagonal_row(row)})
      rock_rows_.insert(rock_rows_.end(), values.begin(), values.end());
}

void FlowOperator::place_points() {
  if (!layout_.with_fractures()) return;
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
  std::vector<Index> unknowns;
  std::vector<double> block;
  constexpr std::array<double, 4> exchange{1, -1, -1, 1};
  for (Index f = 0; f < static_cast<Index>(fractures.size()); ++f) {
    fracture_unknowns(f, unknowns);
    block.resize(unknowns.size() * unknowns.size());
    physics::element_matrix(unit_transmissibilities(f), static_cast<int>(unknowns.size()) - 1, block);
    add(unknowns, block, fractures[f].along);
    for (Index side : sides(f)) add(std::array{layout_.fracture(f), side}, exchange, areas_[f] * fractures[f].through);
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

Dissipation FlowOperator::dissipation(Vec q) const {
  std::vector<double> local(static_cast<std::size_t>(layout_.local_size()));
  layout_.gather(q, local);
  std::array<double, 2> parts{};
  for (Index f = 0; !conductivities_.empty() && f < mesh_.fractures.owned; ++f) {
    parts[0] += conductivities_[f].along * fracture_form(f, local);
    for (Index side : sides(f)) {
      const double drop = local[side] - local[layout_.fracture(f)];
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
  fracture_unknowns(f, rows);
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
    const double into = areas_[f] * conductivities_[f].d_through * (q[side] - q_f);
    values[0] -= into;
    rows.push_back(side);
    values.push_back(into);
  }
}

}  // namespace polyslip::assembly
