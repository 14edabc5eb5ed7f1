#include "polyslip/assembly/contact_cells.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <functional>

#include "polyslip/common/processor.hpp"
#include "polyslip/geometry/faces.hpp"
#include "polyslip/la/dense.hpp"

namespace polyslip::assembly {

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ConstMap = Eigen::Map<const RowMajor>;
using MutableMap = Eigen::Map<RowMajor>;
using Components = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;  ///< Of vectors: dim x dim.

/// Whether this rank needs the blocks of a + cell: it owns the cell, or a displacement of E.
bool is_needed(const mesh::DistributedMesh& mesh, const Layout& layout, Index cell, std::span<const Index> displacements) {
  if (cell < mesh.cells.owned || !mesh.flow.empty()) return true;  // flow: rows of owned ridges may depend on any of them
  return std::any_of(displacements.begin(), displacements.end(), [&](Index i) { return i < layout.displacement_size(); });
}

Index copy_at(const mesh::PolyMesh& mesh, Index cell, Index node) {
  const auto nodes = mesh.cell_nodes[cell];
  const auto s = std::find(nodes.begin(), nodes.end(), node) - nodes.begin();
  return mesh.copies_of(cell)[static_cast<std::size_t>(s)];
}

}  // namespace

ContactCells::ContactCells(const mesh::DistributedMesh& mesh, const Layout& layout, std::span<const physics::Lame> moduli,
                           physics::Stabilisation stabilisation)
    : dim_(mesh.mesh.dim), is_contact_cell_(static_cast<std::size_t>(mesh.mesh.n_cells()), 0), faces_(mesh.fracture_faces.size()) {
  if (mesh.fracture_faces.empty()) return;
  const std::vector<Index> number = mesh::fracture_numbers(mesh);
  spaces::VemCell vem(mesh.mesh, layout.bubbles());
  std::vector<Index> plus;
  for (Index face : mesh.fracture_faces) plus.push_back(mesh.mesh.face_cells[face][0]);
  std::sort(plus.begin(), plus.end());
  plus.erase(std::unique(plus.begin(), plus.end()), plus.end());
  for (Index cell : plus) {
    vem.build(cell);
    const auto bubbles = vem.bubble_faces();
    // Cells at the rim of the ghost layer may lack a - side; none of their copies is ours.
    if (std::any_of(bubbles.begin(), bubbles.end(), [&](Index face) { return number[face] < 0; })) continue;
    add_cell(mesh, layout, vem, moduli[cell], physics::stabilisation_factor(moduli[cell], stabilisation), number);
  }
  cell_differs_.assign(cells_.size(), 0);
  has_changed_ = cell_differs_;
  allocate_condensed();
}

void ContactCells::add_cell(const mesh::DistributedMesh& mesh, const Layout& layout, spaces::VemCell& vem, const physics::Lame& lame,
                            double gamma, std::span<const Index> fracture_of_face) {
  const mesh::PolyMesh& m = mesh.mesh;
  const auto own = m.copies_of(vem.cell());
  std::vector<Index> external(own.begin(), own.end()), displacements;
  layout.append_displacements(m, vem.cell(), displacements);
  for (Index face : vem.bubble_faces())
    for (Index node : m.face_nodes[face]) {
      const Index copy = copy_at(m, m.face_cells[face][1], node);
      if (std::find(external.begin(), external.end(), copy) != external.end()) continue;
      external.push_back(copy);
      for (int a = 0; a < dim_; ++a) displacements.push_back(layout.of_copy(copy) + a);
    }
  if (!is_needed(mesh, layout, vem.cell(), displacements)) return;

  const int n_ext = static_cast<int>(external.size()), n_faces = vem.n_bubbles();
  const auto k = static_cast<std::size_t>(vem.components());
  const Index p = size();
  cells_.push_back({vem.cell(), dim_ * vem.n_nodes() + vem.n_normals(), vem.n_nodes(), n_ext, vem.n_normals(), n_faces,
                    stiffness_.size(), jump_.size(), 0, 0, 0});
  is_contact_cell_[vem.cell()] = 1;
  stiffness_.resize(stiffness_.size() + k * k);
  jump_.resize(jump_.size() + static_cast<std::size_t>(n_faces) * n_ext, 0.0);
  physics::local_stiffness(dim_, vem, lame, gamma, {&stiffness_[cells_[p].stiffness], k * k});

  std::vector<Vec3> points, g;
  std::vector<double> w;
  std::vector<Index> local_faces;
  for (int f = 0; f < n_faces; ++f) {
    const Index face = vem.bubble_faces()[f];
    spaces::face_points(m, face, points);
    g.resize(points.size());
    w.resize(points.size());
    geometry::vector_weights(dim_, points, g);
    const auto geometry = geometry::face_geometry(points, g, w);
    double* j = &jump_[cells_[p].jump + static_cast<std::size_t>(f) * n_ext];
    for (std::size_t s = 0; s < points.size(); ++s) {
      const Index node = m.face_nodes[face][s];
      for (int side : {0, 1}) {
        const Index copy = copy_at(m, m.face_cells[face][side], node);
        j[std::find(external.begin(), external.end(), copy) - external.begin()] += side == 0 ? w[s] : -w[s];
      }
    }
    ContactFace& contact = faces_[fracture_of_face[face]];
    contact.cell = p;
    contact.position = f;
    contact.area = geometry.area;
    contact.stiffness = (2 * lame.mu + lame.lambda) / vem.diameter();
    contact.centre = geometry.centre;
    contact.frame = geometry::face_frame(dim_, geometry.normal);
    local_faces.push_back(fracture_of_face[face]);
  }
  displacements_.push_row(displacements);
  cell_faces_.push_row(local_faces);
}

void ContactCells::attach_fluid(std::vector<ContactFluid> fluid) {
  fluid_ = std::move(fluid);
  allocate_condensed();
}

void ContactCells::allocate_condensed() {
  std::size_t condensed = 0, internal = 0, coupling = 0;
  for (Index p = 0; p < size(); ++p) {
    const auto e = static_cast<std::size_t>(block_size(p)), i = static_cast<std::size_t>(2 * dim_) * cells_[p].n_faces;
    cells_[p].condensed = condensed;
    cells_[p].internal = internal;
    cells_[p].coupling = coupling;
    condensed += e * e;
    internal += i * i;
    coupling += e * i;
  }
  condensed_.assign(condensed, 0.0);
  symmetric_.clear();
  inverse_.assign(internal, 0.0);
  m_ei_.assign(coupling, 0.0);
  m_ie_.assign(coupling, 0.0);
  is_stale_.assign(cells_.size(), 1);
}

std::span<const double> ContactCells::matrix(const std::vector<double>& pool, Index p) const {
  const auto e = static_cast<std::size_t>(block_size(p));
  return {&pool[cells_[p].condensed], e * e};
}

std::span<const double> ContactCells::symmetric_block(Index p) const { return matrix(cell_differs_[p] ? symmetric_ : condensed_, p); }

Vec3 ContactCells::jump(Index face, const MechanicalState& state) const {
  const ContactFace& contact = faces_[face];
  const Cell& cell = cells_[contact.cell];
  const Index* displacements = displacements_[contact.cell].data();
  const double* j = &jump_[cell.jump + static_cast<std::size_t>(contact.position) * cell.n_ext];
  Vec3 v = Vec3::Zero();
  for (int a = 0; a < dim_; ++a) v[a] = state.bubble[static_cast<std::size_t>(dim_) * face + a];
  for (int e = 0; e < cell.n_ext; ++e)
    for (int a = 0; a < dim_; ++a) v[a] += j[e] * state.displacement[displacements[position(cell, e) + a]];
  return contact.frame * v;
}

void ContactCells::add_momentum(const MechanicalState& state, std::span<const double> fracture_pressure, std::span<double> displacement,
                                std::span<double> bubble) const {
  Eigen::VectorXd v, r;
  for (Index p = 0; p < size(); ++p) {
    const Cell& cell = cells_[p];
    const auto displacements = displacements_[p];
    const auto faces = cell_faces_[p];
    const int own = cell.n_own, n = own + dim_ * cell.n_faces;
    v.resize(n);
    r.resize(n);
    for (int i = 0; i < own; ++i) v[i] = state.displacement[displacements[i]];
    for (int f = 0; f < cell.n_faces; ++f)
      for (int a = 0; a < dim_; ++a) v[own + dim_ * f + a] = state.bubble[static_cast<std::size_t>(dim_) * faces[f] + a];
    la::multiply(n, n, &stiffness_[cell.stiffness], n, v.data(), r.data());
    for (int i = 0; i < own; ++i) displacement[displacements[i]] += r[i];
    for (int f = 0; f < cell.n_faces; ++f) {
      const ContactFace& contact = faces_[faces[f]];
      Vec3 lam = Vec3::Zero();
      for (int a = 0; a < dim_; ++a) lam[a] = state.multiplier[static_cast<std::size_t>(dim_) * faces[f] + a];
      if (!fracture_pressure.empty()) lam[0] += fracture_pressure[faces[f]];
      const Vec3 force = contact.area * (contact.frame.transpose() * lam);
      const double* j = &jump_[cell.jump + static_cast<std::size_t>(f) * cell.n_ext];
      for (int e = 0; e < cell.n_ext; ++e)
        for (int a = 0; a < dim_; ++a) displacement[displacements[position(cell, e) + a]] += j[e] * force[a];
      for (int a = 0; a < dim_; ++a) bubble[static_cast<std::size_t>(dim_) * faces[f] + a] += r[own + dim_ * f + a] + force[a];
    }
  }
}

void ContactCells::blocks(Index p, std::span<const physics::ContactLinearisation> law, SaddleBlocks& m) const {
  const Cell& cell = cells_[p];
  const auto faces = cell_faces_[p];
  const int d = dim_, ne = block_size(p), own = cell.n_own, nb = d * cell.n_faces, n = own + nb;
  const ConstMap k(&stiffness_[cell.stiffness], n, n);
  m.ee.setZero(ne, ne);
  m.ee.topLeftCorner(own, own) = k.topLeftCorner(own, own);
  m.ei.setZero(ne, 2 * nb);
  m.ei.topLeftCorner(own, nb) = k.topRightCorner(own, nb);
  m.ie.setZero(2 * nb, ne);
  m.ie.topLeftCorner(nb, own) = k.bottomLeftCorner(nb, own);
  m.ii.setZero(2 * nb, 2 * nb);
  m.ii.topLeftCorner(nb, nb) = k.bottomRightCorner(nb, nb);
  for (int f = 0; f < cell.n_faces; ++f) {
    const ContactFace& contact = faces_[faces[f]];
    const auto frame = contact.frame.topLeftCorner(d, d);
    const Components traction = contact.area * frame.transpose();
    const Components d_jump = contact.area * law[faces[f]].d_jump.topLeftCorner(d, d) * frame;
    const double* j = &jump_[cell.jump + static_cast<std::size_t>(f) * cell.n_ext];
    for (int e = 0; e < cell.n_ext; ++e) {
      if (j[e] == 0) continue;
      m.ei.block(position(cell, e), nb + d * f, d, d) = j[e] * traction;
      m.ie.block(nb + d * f, position(cell, e), d, d) = j[e] * d_jump;
    }
    m.ii.block(d * f, nb + d * f, d, d) = traction;
    m.ii.block(nb + d * f, d * f, d, d) = d_jump;
    m.ii.block(nb + d * f, nb + d * f, d, d) = contact.area * law[faces[f]].d_lam.topLeftCorner(d, d);
  }
  if (!fluid_.empty()) add_fluid_blocks(p, m);
}

void ContactCells::add_fluid_blocks(Index p, SaddleBlocks& m) const {
  const Cell& cell = cells_[p];
  const ContactFluid& fluid = fluid_[p];
  const int d = dim_, q_K = displacements_.row_size(p), own = cell.n_own, nb = d * cell.n_faces;
  const Eigen::Map<const Eigen::VectorXd> biot(fluid.biot.data(), own + nb);
  m.ee.col(q_K).head(own) = -biot.head(own);
  m.ee.row(q_K).head(own) = biot.head(own);
  m.ie.col(q_K).head(nb) = -biot.tail(nb);
  m.ei.row(q_K).head(nb) = biot.tail(nb);
  if (fluid.unknowns.size() == 1) return;  // fractures carry no fluid
  const auto faces = cell_faces_[p];
  const auto add_row = [&](int row, int f, const Eigen::VectorXd& gradient) {  // d row/d(J_sigma), Cartesian
    const double* j = &jump_[cell.jump + static_cast<std::size_t>(f) * cell.n_ext];
    for (int e = 0; e < cell.n_ext; ++e) m.ee.row(row).segment(position(cell, e), d) += j[e] * gradient.transpose();
    m.ei.row(row).segment(d * f, d) += gradient.transpose();
  };
  for (int f = 0; f < cell.n_faces; ++f) {
    const ContactFace& contact = faces_[faces[f]];
    const ApertureLinearisation& aperture = apertures_[faces[f]];
    const double* j = &jump_[cell.jump + static_cast<std::size_t>(f) * cell.n_ext];
    const Eigen::VectorXd push = contact.area * contact.frame.row(0).head(d).transpose();
    for (int e = 0; e < cell.n_ext; ++e) m.ee.col(q_K + 1 + f).segment(position(cell, e), d) = j[e] * push;
    m.ie.col(q_K + 1 + f).segment(d * f, d) = push;
    const Eigen::VectorXd gradient = (contact.frame.transpose() * aperture.d_jump).head(d);
    add_row(q_K + 1 + f, f, contact.area * gradient);
    for (std::size_t k = 0; k < aperture.rows.size(); ++k) {
      const auto at = std::find(fluid.unknowns.begin(), fluid.unknowns.end(), aperture.rows[k]);
      add_row(q_K + static_cast<int>(at - fluid.unknowns.begin()), f, aperture.values[k] * gradient);
    }
  }
}

void ContactCells::add_fluid_forces(std::span<const double> q, std::span<double> displacement, std::span<double> bubble) const {
  for (Index p = 0; p < size(); ++p) {
    const Cell& cell = cells_[p];
    const ContactFluid& fluid = fluid_[p];
    const auto displacements = displacements_[p];
    const auto faces = cell_faces_[p];
    const double q_K = q[fluid.unknowns[0]];
    for (int i = 0; i < cell.n_own; ++i) displacement[displacements[i]] -= fluid.biot[i] * q_K;
    for (int f = 0; f < cell.n_faces; ++f) {
      const ContactFace& contact = faces_[faces[f]];
      const double q_f = fluid.unknowns.size() > 1 ? q[fluid.unknowns[1 + f]] : 0.0;
      const double* j = &jump_[cell.jump + static_cast<std::size_t>(f) * cell.n_ext];
      for (int a = 0; a < dim_; ++a) {
        const double push = contact.area * q_f * contact.frame(0, a);
        for (int e = 0; e < cell.n_ext; ++e) displacement[displacements[position(cell, e) + a]] += j[e] * push;
        bubble[static_cast<std::size_t>(dim_) * faces[f] + a] += push - fluid.biot[cell.n_own + dim_ * f + a] * q_K;
      }
    }
  }
}

double ContactCells::pore_volume(Index p, const MechanicalState& state) const {
  const Cell& cell = cells_[p];
  const auto displacements = displacements_[p];
  const auto faces = cell_faces_[p];
  double volume = 0;
  for (int i = 0; i < cell.n_own; ++i) volume += fluid_[p].biot[i] * state.displacement[displacements[i]];
  for (int f = 0; f < cell.n_faces; ++f)
    for (int a = 0; a < dim_; ++a)
      volume += fluid_[p].biot[cell.n_own + dim_ * f + a] * state.bubble[static_cast<std::size_t>(dim_) * faces[f] + a];
  return volume;
}

ContactCells::SaddleBlocks ContactCells::saddle_blocks(Index p, std::span<const physics::ContactLinearisation> law) const {
  SaddleBlocks m;
  blocks(p, law, m);
  return m;
}

namespace {

/// Inverse of M_II, ni x ni, with the multiplier columns in units of their face's stiffness, so that pivots compare like with like.
template <int ni>
Eigen::Matrix<double, ni, ni> inverse_internal(const RowMajor& ii, const Eigen::VectorXd& column_scale) {
  const Eigen::Matrix<double, ni, ni> scaled = ii * column_scale.asDiagonal();
  return column_scale.asDiagonal() * scaled.partialPivLu().inverse();
}

/// result = a - b c of rows of n entries (those of b: ni), none of them the same. A block that is free to slide leaves pivots of 0, not of rounding.
template <int ni>
POLYSLIP_BY_PROCESSOR_UNFUSED void subtract_product(int n, const double* a, const double* b, const double* c, double* __restrict result) {
  for (int i = 0; i < n; ++i, a += n, b += ni, result += n)
    for (int j = 0; j < n; ++j) {
      double product = 0;
      for (int k = 0; k < ni; ++k) product += b[k] * c[k * n + j];
      result[j] = a[j] - product;
    }
}

}  // namespace

void ContactCells::set_apertures(std::vector<ApertureLinearisation> apertures) {
  for (Index f = 0; f < static_cast<Index>(apertures_.size()); ++f)
    if (faces_[f].cell >= 0 && !(apertures[f] == apertures_[f])) is_stale_[faces_[f].cell] = 1;
  apertures_ = std::move(apertures);
}

template <int ni>
void ContactCells::condense_cell(Index p, std::span<const physics::ContactLinearisation> law,
                                 std::span<const physics::ContactLinearisation> symmetric, SaddleBlocks& m) {
  const Cell& cell = cells_[p];
  const auto faces = cell_faces_[p];
  const int ne = block_size(p), size = 2 * dim_ * cell.n_faces;
  Eigen::VectorXd scale = Eigen::VectorXd::Ones(size);
  for (int f = 0; f < cell.n_faces; ++f) scale.segment(size / 2 + dim_ * f, dim_).setConstant(faces_[faces[f]].stiffness);
  const auto condense = [&](const Eigen::Matrix<double, ni, ni>& inverse, double* block) {
    const Eigen::Matrix<double, ni, Eigen::Dynamic, Eigen::RowMajor> recovered = inverse * m.ie;
    if constexpr (ni == Eigen::Dynamic)
      MutableMap(block, ne, ne) = m.ee - m.ei * recovered;
    else
      subtract_product<ni>(ne, m.ee.data(), m.ei.data(), recovered.data(), block);
  };
  blocks(p, law, m);
  const Eigen::Matrix<double, ni, ni> inverse = inverse_internal<ni>(m.ii, scale);
  MutableMap(&inverse_[cell.internal], size, size) = inverse;
  MutableMap(&m_ei_[cell.coupling], ne, size) = m.ei;
  MutableMap(&m_ie_[cell.coupling], size, ne) = m.ie;
  condense(inverse, &condensed_[cell.condensed]);
  if (cell_differs_[p] == 0) return;
  symmetric_.resize(condensed_.size());
  blocks(p, symmetric, m);
  condense(inverse_internal<ni>(m.ii, scale), &symmetric_[cell.condensed]);
}

void ContactCells::condense(std::span<const physics::ContactLinearisation> law, std::span<const physics::ContactLinearisation> symmetric,
                            std::span<const char> differs) {
  const auto is_as_before = [&](Index f) { return law[f].has_derivatives_of(condensed_law_[f]) && differs[f] == condensed_differs_[f]; };
  const auto is_different = [&](Index f) { return differs[f] != 0; };
  SaddleBlocks m;
  any_difference_ = false;
  for (Index p = 0; p < size(); ++p) {
    const auto faces = cell_faces_[p];
    has_changed_[p] = is_stale_[p] != 0 || !std::all_of(faces.begin(), faces.end(), is_as_before) ? 1 : 0;
    if (has_changed_[p] != 0) {
      cell_differs_[p] = std::any_of(faces.begin(), faces.end(), is_different) ? 1 : 0;
      switch (2 * dim_ * cells_[p].n_faces) {  // nearly all cells have one face: the compiler unrolls what it knows the size of
        case 4: condense_cell<4>(p, law, symmetric, m); break;
        case 6: condense_cell<6>(p, law, symmetric, m); break;
        default: condense_cell<Eigen::Dynamic>(p, law, symmetric, m);
      }
      is_stale_[p] = 0;
    }
    any_difference_ = any_difference_ || cell_differs_[p] != 0;
  }
  condensed_law_.assign(law.begin(), law.end());
  condensed_differs_.assign(differs.begin(), differs.end());
}

void ContactCells::internal_residual(Index p, std::span<const double> bubble, std::span<const double> contact, std::vector<double>& r) const {
  r.clear();
  for (const std::span<const double> rows : {bubble, contact})
    for (const Index face : cell_faces_[p])
      for (int a = 0; a < dim_; ++a) r.push_back(rows[static_cast<std::size_t>(dim_) * face + a]);
}

void ContactCells::condense_residual(std::span<const double> bubble, std::span<const double> contact, std::span<double> displacement,
                                     std::span<double> flow) const {
  std::vector<double> internal, solved, external;
  for (Index p = 0; p < size(); ++p) {
    const Cell& cell = cells_[p];
    const int ne = block_size(p), ni = 2 * dim_ * cell.n_faces;
    internal_residual(p, bubble, contact, internal);
    solved.resize(internal.size());
    external.resize(static_cast<std::size_t>(ne));
    la::multiply(ni, ni, &inverse_[cell.internal], ni, internal.data(), solved.data());
    la::multiply(ne, ni, &m_ei_[cell.coupling], ni, solved.data(), external.data());
    auto r = external.begin();
    for (const Index i : displacements_[p]) displacement[i] -= *r++;
    for (const Index k : pressures(p)) flow[k] -= *r++;
  }
}

void ContactCells::recover(std::span<const double> bubble, std::span<const double> contact, MechanicalState& delta) const {
  std::vector<double> internal, of_external, external, solved;
  for (Index p = 0; p < size(); ++p) {
    const Cell& cell = cells_[p];
    const int ne = block_size(p), ni = 2 * dim_ * cell.n_faces;
    external.clear();
    for (const Index i : displacements_[p]) external.push_back(delta.displacement[i]);
    for (const Index k : pressures(p)) external.push_back(delta.pressure[k]);
    internal_residual(p, bubble, contact, internal);
    of_external.resize(internal.size());
    solved.resize(internal.size());
    la::multiply(ni, ne, &m_ie_[cell.coupling], ne, external.data(), of_external.data());
    std::transform(internal.begin(), internal.end(), of_external.begin(), internal.begin(), std::minus<>());
    la::multiply(ni, ni, &inverse_[cell.internal], ni, internal.data(), solved.data());
    auto value = solved.begin();
    for (std::vector<double>* part : {&delta.bubble, &delta.multiplier})
      for (const Index face : cell_faces_[p])
        for (int a = 0; a < dim_; ++a) (*part)[static_cast<std::size_t>(dim_) * face + a] = *value++;
  }
}

}  // namespace polyslip::assembly
