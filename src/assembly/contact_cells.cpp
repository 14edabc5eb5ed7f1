#include "polyslip/assembly/contact_cells.hpp"

#include <Eigen/LU>
#include <algorithm>

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
  jump_.resize(jump_.size() + static_cast<std::size_t>(n_faces) * n_ext, 0.0);
  std::vector<double> stiffness(k * k);
  physics::local_stiffness(dim_, vem, lame, gamma, stiffness);
  stiffness_.insert(stiffness_.end(), stiffness.begin() + static_cast<std::ptrdiff_t>(k) * cells_[p].n_own, stiffness.end());

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
  std::size_t internal = 0, coupling = 0, pressing = 0;
  for (Index p = 0; p < size(); ++p) {
    const auto e = static_cast<std::size_t>(block_size(p)), i = static_cast<std::size_t>(internal_size(p));
    cells_[p].internal = internal;
    cells_[p].coupling = coupling;
    cells_[p].pressing = pressing;
    internal += i * i;
    coupling += e * i;
    pressing += pressures(p).size() * i;
  }
  inverse_.assign(internal, 0.0);
  coupling_.assign(coupling, 0.0);
  pressing_.assign(pressing, 0.0);
  recovery_.assign(coupling, 0.0);
  held_recovery_.clear();
  is_stale_.assign(cells_.size(), 1);
}

const double* ContactCells::recovery(Index p, Friction friction) const {
  return &(friction == Friction::held && cell_differs_[p] != 0 ? held_recovery_ : recovery_)[cells_[p].coupling];
}

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
    const int own = cell.n_own, nb = dim_ * cell.n_faces, n = own + nb;
    const double* stiffness = &stiffness_[cell.stiffness];
    v.resize(n);
    r.setZero(n);
    for (int i = 0; i < own; ++i) v[i] = state.displacement[displacements[i]];
    for (int f = 0; f < cell.n_faces; ++f)
      for (int a = 0; a < dim_; ++a) v[own + dim_ * f + a] = state.bubble[static_cast<std::size_t>(dim_) * faces[f] + a];
    la::multiply(nb, n, stiffness, n, v.data(), r.data() + own);
    la::add_transposed(nb, own, 1, stiffness, n, v.data() + own, r.data());
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

void ContactCells::internal_block(Index p, std::span<const physics::ContactLinearisation> law, Eigen::Ref<RowMajor> ii) const {
  const Cell& cell = cells_[p];
  const auto faces = cell_faces_[p];
  const int d = dim_, nb = d * cell.n_faces, n = cell.n_own + nb;
  ii.setZero();
  ii.topLeftCorner(nb, nb) = ConstMap(&stiffness_[cell.stiffness], nb, n).rightCols(nb);
  for (int f = 0; f < cell.n_faces; ++f) {
    const ContactFace& contact = faces_[faces[f]];
    const auto frame = contact.frame.topLeftCorner(d, d);
    ii.block(d * f, nb + d * f, d, d) = contact.area * frame.transpose();
    ii.block(nb + d * f, d * f, d, d) = contact.area * law[faces[f]].d_jump.topLeftCorner(d, d).lazyProduct(frame);
    ii.block(nb + d * f, nb + d * f, d, d) = contact.area * law[faces[f]].d_lam.topLeftCorner(d, d);
  }
}

void ContactCells::blocks(Index p, std::span<const physics::ContactLinearisation> law, SaddleBlocks& m) const {
  const Cell& cell = cells_[p];
  const auto faces = cell_faces_[p];
  const int d = dim_, ne = block_size(p), own = cell.n_own, nb = d * cell.n_faces;
  const auto k_be = ConstMap(&stiffness_[cell.stiffness], nb, own + nb).leftCols(own);
  m.ee.setZero(ne, ne);
  m.ei.setZero(ne, 2 * nb);
  m.ei.topLeftCorner(own, nb) = k_be.transpose();
  m.ie.setZero(2 * nb, ne);
  m.ie.topLeftCorner(nb, own) = k_be;
  m.ii.resize(2 * nb, 2 * nb);
  internal_block(p, law, m.ii);
  for (int f = 0; f < cell.n_faces; ++f) {
    const double* j = &jump_[cell.jump + static_cast<std::size_t>(f) * cell.n_ext];
    const Components traction = m.ii.block(d * f, nb + d * f, d, d), d_jump = m.ii.block(nb + d * f, d * f, d, d);
    for (int e = 0; e < cell.n_ext; ++e) {
      if (j[e] == 0) continue;
      m.ei.block(position(cell, e), nb + d * f, d, d) = j[e] * traction;
      m.ie.block(nb + d * f, position(cell, e), d, d) = j[e] * d_jump;
    }
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

/// Of M_II, ni x ni entries (Eigen::Dynamic where the compiler does not know that).
template <int ni>
using Internal = Eigen::Matrix<double, ni, ni, Eigen::RowMajor>;

/// Inverse of M_II, with the multiplier columns in units of their face's stiffness, so that pivots compare like with like.
template <int ni>
Internal<ni> inverse_internal(const Internal<ni>& ii, const Eigen::Matrix<double, ni, 1>& column_scale) {
  const Eigen::PartialPivLU<Eigen::Matrix<double, ni, ni>> factors(ii * column_scale.asDiagonal());
  Internal<ni> inverse(ii.rows(), ii.cols());
  for (Eigen::Index k = 0; k < ii.cols(); ++k)  // Eigen unrolls the solution for a vector, not that for a matrix
    inverse.col(k) = column_scale.cwiseProduct(factors.solve(Eigen::Matrix<double, ni, 1>::Unit(ii.rows(), k)));
  return inverse;
}

/// Calls body with the rows and columns of M_II as a constant: nearly all cells have one face, and the compiler unrolls what it knows the size of.
template <class Body>
void with_size(int size, Body&& body) {
  switch (size) {
    case 4: return body.template operator()<4>();
    case 6: return body.template operator()<6>();
    default: return body.template operator()<Eigen::Dynamic>();
  }
}

/// C = A B, row by row; A of ni x ni (`size`) entries, the rows of B and C `step` apart. Not fused: what cancels does so to the bit.
template <int ni>
POLYSLIP_BY_PROCESSOR_UNFUSED void multiply(int size, const double* a, int columns, const double* b, double* __restrict c, int step) {
  const int n = ni == Eigen::Dynamic ? size : ni;
  for (int i = 0; i < n; ++i, a += n, c += step)
    for (int j = 0; j < columns; ++j) {
      double sum = 0;
      for (int k = 0; k < n; ++k) sum += a[k] * b[k * step + j];
      c[j] = sum;
    }
}

/// C -= A^T B of matrices of `columns`, A and B of ni (`size`) rows. A block that is free to slide leaves pivots of 0, not of rounding.
template <int ni>
POLYSLIP_BY_PROCESSOR_UNFUSED void subtract_product(int size, int columns, const double* a, const double* b, double* __restrict c) {
  const int n = ni == Eigen::Dynamic ? size : ni;
  for (int i = 0; i < columns; ++i, ++a, c += columns)
    for (int j = 0; j < columns; ++j) {
      double sum = 0;
      for (int k = 0; k < n; ++k) sum += a[k * columns] * b[k * columns + j];
      c[j] -= sum;
    }
}

}  // namespace

void ContactCells::set_apertures(std::vector<ApertureLinearisation> apertures) {
  for (Index f = 0; f < static_cast<Index>(apertures_.size()); ++f)
    if (faces_[f].cell >= 0 && !(apertures[f] == apertures_[f])) is_stale_[faces_[f].cell] = 1;
  apertures_ = std::move(apertures);
}

/// What no contact law changes: M_EI, and of M_IE the columns of pressures.
void ContactCells::couple(Index p, std::span<const physics::ContactLinearisation> law) {
  const Cell& cell = cells_[p];
  const int nq = static_cast<int>(pressures(p).size());
  SaddleBlocks& m = work_;
  blocks(p, law, m);
  MutableMap(&coupling_[cell.coupling], m.ei.cols(), m.ei.rows()) = m.ei.transpose();
  MutableMap(&pressing_[cell.pressing], m.ie.rows(), nq) = m.ie.rightCols(nq);
}

/// M_II^{-1}, and M_II^{-1} M_IE = M_II^{-1} [diag(1, D_J) M_EI^T, M_Iq] for displacements and pressures.
template <int ni>
void ContactCells::find_recovery(Index p, std::span<const physics::ContactLinearisation> law, double* inverse, double* recovery) const {
  const Cell& cell = cells_[p];
  const auto faces = cell_faces_[p];
  const int size = internal_size(p), ne = block_size(p), e = displacements_.row_size(p), nq = ne - e;
  Internal<ni> ii(size, size);
  internal_block(p, law, ii);
  Eigen::Matrix<double, ni, 1> scale = Eigen::Matrix<double, ni, 1>::Ones(size);
  for (int f = 0; f < cell.n_faces; ++f) scale.segment(size / 2 + dim_ * f, dim_).setConstant(faces_[faces[f]].stiffness);
  const Internal<ni> solved = inverse_internal<ni>(ii, scale);
  Internal<ni> through = solved;
  for (int f = 0; f < cell.n_faces; ++f) {
    const int first = size / 2 + dim_ * f;
    through.middleCols(first, dim_) = solved.middleCols(first, dim_).lazyProduct(law[faces[f]].d_jump.topLeftCorner(dim_, dim_));
  }
  multiply<ni>(size, through.data(), e, &coupling_[cell.coupling], recovery, ne);
  if (nq > 0) MutableMap(recovery, size, ne).rightCols(nq) = solved * ConstMap(&pressing_[cell.pressing], size, nq);
  MutableMap(inverse, size, size) = solved;
}

template <int ni>
void ContactCells::condense_cell(Index p, std::span<const physics::ContactLinearisation> law, std::span<const physics::ContactLinearisation> symmetric) {
  const Cell& cell = cells_[p];
  double* inverse = &inverse_[cell.internal];  // of `law`, which comes last
  if (cell_differs_[p] != 0) {
    held_recovery_.resize(recovery_.size());
    find_recovery<ni>(p, symmetric, inverse, &held_recovery_[cell.coupling]);
  }
  find_recovery<ni>(p, law, inverse, &recovery_[cell.coupling]);
}

void ContactCells::condense(std::span<const physics::ContactLinearisation> law, std::span<const physics::ContactLinearisation> symmetric,
                            std::span<const char> differs) {
  const auto is_as_before = [&](Index f) { return law[f].has_derivatives_of(condensed_law_[f]) && differs[f] == condensed_differs_[f]; };
  const auto is_different = [&](Index f) { return differs[f] != 0; };
  any_difference_ = false;
  for (Index p = 0; p < size(); ++p) {
    const auto faces = cell_faces_[p];
    has_changed_[p] = is_stale_[p] != 0 || !std::all_of(faces.begin(), faces.end(), is_as_before) ? 1 : 0;
    if (has_changed_[p] != 0) {
      if (is_stale_[p] != 0) couple(p, law);
      is_stale_[p] = 0;
      cell_differs_[p] = std::any_of(faces.begin(), faces.end(), is_different) ? 1 : 0;
      with_size(internal_size(p), [&]<int ni>() { condense_cell<ni>(p, law, symmetric); });
    }
    any_difference_ = any_difference_ || cell_differs_[p] != 0;
  }
  condensed_law_.assign(law.begin(), law.end());
  condensed_differs_.assign(differs.begin(), differs.end());
}

void ContactCells::write_block(Index p, Friction friction, std::vector<double>& block) const {
  const int ne = block_size(p);
  block.assign(static_cast<std::size_t>(ne) * static_cast<std::size_t>(ne), 0.0);
  if (!fluid_.empty()) {
    SaddleBlocks& m = work_;
    m.ee.setZero(ne, ne);
    m.ei.setZero(ne, internal_size(p));
    m.ie.setZero(internal_size(p), ne);
    add_fluid_blocks(p, m);
    MutableMap(block.data(), ne, ne) = m.ee;
  }
  with_size(internal_size(p),
            [&]<int ni>() { subtract_product<ni>(internal_size(p), ne, &coupling_[cells_[p].coupling], recovery(p, friction), block.data()); });
}

void ContactCells::add_condensation(Index p, Friction friction, double factor, std::span<const double> x, std::span<double> y) const {
  const int ne = block_size(p), ni = internal_size(p), n = static_cast<int>(x.size());
  std::vector<double>& solved = work_internal_;
  solved.resize(static_cast<std::size_t>(ni));
  la::multiply(ni, n, recovery(p, friction), ne, x.data(), solved.data());
  la::add_transposed(ni, n, -factor, &coupling_[cells_[p].coupling], ne, solved.data(), y.data());
}

double ContactCells::condensed_diagonal(Index p, Friction friction, int i) const {
  const auto ne = static_cast<std::size_t>(block_size(p));
  const double *left = &coupling_[cells_[p].coupling] + i, *right = recovery(p, friction) + i;
  double sum = 0;
  for (int k = 0; k < internal_size(p); ++k, left += ne, right += ne) sum -= *left * *right;
  return sum;
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
    const int ne = block_size(p), ni = internal_size(p);
    internal_residual(p, bubble, contact, internal);
    solved.resize(internal.size());
    external.assign(static_cast<std::size_t>(ne), 0.0);
    la::multiply(ni, ni, &inverse_[cell.internal], ni, internal.data(), solved.data());
    la::add_transposed(ni, ne, 1, &coupling_[cell.coupling], ne, solved.data(), external.data());
    auto r = external.begin();
    for (const Index i : displacements_[p]) displacement[i] -= *r++;
    for (const Index k : pressures(p)) flow[k] -= *r++;
  }
}

void ContactCells::recover(std::span<const double> bubble, std::span<const double> contact, MechanicalState& delta) const {
  std::vector<double> internal, of_external, external, solved;
  for (Index p = 0; p < size(); ++p) {
    const Cell& cell = cells_[p];
    const int ne = block_size(p), ni = internal_size(p);
    external.clear();
    for (const Index i : displacements_[p]) external.push_back(delta.displacement[i]);
    for (const Index k : pressures(p)) external.push_back(delta.pressure[k]);
    internal_residual(p, bubble, contact, internal);
    of_external.resize(internal.size());
    solved.resize(internal.size());
    la::multiply(ni, ni, &inverse_[cell.internal], ni, internal.data(), solved.data());
    la::multiply(ni, ne, recovery(p, Friction::moving), ne, external.data(), of_external.data());
    auto of_residual = solved.begin(), of_displacement = of_external.begin();
    for (std::vector<double>* part : {&delta.bubble, &delta.multiplier})
      for (const Index face : cell_faces_[p])
        for (int a = 0; a < dim_; ++a) (*part)[static_cast<std::size_t>(dim_) * face + a] = *of_residual++ - *of_displacement++;
  }
}

}  // namespace polyslip::assembly
