#include "polyslip/assembly/mechanics_system.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "polyslip/assembly/cell_batches.hpp"
#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/la/dense.hpp"
#include "polyslip/la/vec_access.hpp"

namespace polyslip::assembly {

using physics::ContactLinearisation;
using physics::ContactPoint;
using physics::ContactState;
using physics::FrictionLaw;

namespace {

/// The law of each fracture face from the rules (later ones win).
void assign_laws(const mesh::DistributedMesh& mesh, const physics::MechanicsProblem& problem, ContactCells& cells) {
  for (Index f = 0; f < mesh.fractures.local(); ++f) {
    ContactFace& face = cells.faces()[f];
    if (face.cell < 0) continue;
    const Index mesh_face = mesh.fracture_faces[f], fracture = mesh.mesh.face_fracture[mesh_face];
    const EvalPoint at{face.centre, 0, mesh.mesh.face_tip_distance[mesh_face], mesh.mesh.fracture_length[fracture]};
    for (const physics::ContactRule& rule : problem.contact) {
      if (!rule.fracture.empty() && rule.fracture != mesh.mesh.fracture_names[fracture]) continue;
      face.law = {rule.law, rule.law == FrictionLaw::frictionless ? 0.0 : rule.friction(at)};
      if (face.law.friction < 0)
        throw InputError(fmt::format("friction {:g} is negative at ({:g}, {:g}, {:g})", face.law.friction, at.x.x(), at.x.y(), at.x.z()),
                         rule.place, "Give a coefficient (coulomb) or bound (tresca) of at least 0");
    }
  }
}

/// Entities of the condensed block of each + cell.
Csr contact_entities(const Layout& layout, const ContactCells& contact) {
  Csr groups;
  for (Index p = 0; p < contact.size(); ++p) {
    const auto displacements = contact.displacements(p);
    for (std::size_t i = 0; i < displacements.size(); i += static_cast<std::size_t>(layout.width(groups.values.back())))
      groups.values.push_back(layout.entity_of(displacements[i]));
    groups.offsets.push_back(static_cast<Index>(groups.values.size()));
  }
  return groups;
}

/// Couplings of each owned entity: all entities of the cells that see it, and of the + cells (numbered behind the cells) whose condensed block
/// holds it.
Csr matrix_graph(const mesh::DistributedMesh& mesh, const Layout& layout, const Csr& contact) {
  const Index cells = mesh.mesh.n_cells(), owned = layout.owned_entities();
  const auto visit_group = [&](Index group, auto&& visit) {
    if (group < cells) return layout.visit_entities(mesh.mesh, group, visit);
    for (const Index entity : contact[group - cells]) visit(entity);
  };
  const auto for_each = [&](auto&& visit) {
    for (Index group = 0; group < cells + contact.rows(); ++group)
      visit_group(group, [&](Index entity) {
        if (entity < owned) visit(entity, group);
      });
  };
  Csr groups_of;  // by owned entity
  groups_of.offsets.assign(static_cast<std::size_t>(owned) + 1, 0);
  for_each([&](Index entity, Index) { ++groups_of.offsets[entity + 1]; });
  for (Index i = 0; i < owned; ++i) groups_of.offsets[i + 1] += groups_of.offsets[i];
  groups_of.values.resize(static_cast<std::size_t>(groups_of.offsets[owned]));
  std::vector<Index> next(groups_of.offsets.begin(), groups_of.offsets.end() - 1);
  for_each([&](Index entity, Index group) { groups_of.values[next[entity]++] = group; });

  Csr graph;
  graph.offsets.reserve(static_cast<std::size_t>(owned) + 1);
  std::vector<Index> seen_by(static_cast<std::size_t>(layout.local_entities()), -1);
  for (Index row = 0; row < owned; ++row) {
    for (const Index group : groups_of[row])
      visit_group(group, [&](Index entity) {
        if (std::exchange(seen_by[entity], row) != row) graph.values.push_back(entity);
      });
    graph.offsets.push_back(static_cast<Index>(graph.values.size()));
  }
  return graph;
}

/// The matrix of a cell by blocks of entities.
class CellBlocks {
 public:
  enum class OfFixed { diagonal, nothing };  ///< What is left of prescribed displacements.
  CellBlocks(const Layout& layout, std::span<const char> fixed, OfFixed left) : layout_(layout), fixed_(fixed), left_(left) {}

  /// Of these entities; `matrix` is the leading part of rows of `width` entries.
  void assign(std::span<const Index> entities, std::span<const double> matrix, int width) {
    entities_ = entities;
    matrix_ = matrix.data();
    width_ = width;
    begin_.clear();
    bool is_fixed = false;
    int begin = 0;
    for (const Index entity : entities) {
      const Index first = layout_.first_displacement(entity);
      const int components = layout_.width(entity);
      for (int a = 0; a < components; ++a) is_fixed = is_fixed || fixed_[first + a] != 0;
      begin_.push_back(begin);
      begin += components;
    }
    if (is_fixed) mask();
  }
  [[nodiscard]] std::span<const Index> entities() const { return entities_; }
  [[nodiscard]] const double* block(std::size_t k, std::size_t l) const { return matrix_ + begin_[k] * width_ + begin_[l]; }
  [[nodiscard]] int width() const { return width_; }

 private:
  void mask() {
    displacements_.clear();
    for (const Index entity : entities_) layout_.append_components(entity, displacements_);
    masked_.assign(matrix_, matrix_ + displacements_.size() * static_cast<std::size_t>(width_));
    double* entry = masked_.data();
    for (std::size_t i = 0; i < displacements_.size(); ++i, entry += width_)
      for (std::size_t j = 0; j < displacements_.size(); ++j)
        if ((i != j || left_ == OfFixed::nothing) && (fixed_[displacements_[i]] || fixed_[displacements_[j]])) entry[j] = 0;
    matrix_ = masked_.data();
  }

  const Layout& layout_;
  std::span<const char> fixed_;
  OfFixed left_;
  std::span<const Index> entities_;
  std::vector<int> begin_;  ///< First row of each.
  const double* matrix_ = nullptr;
  int width_ = 0;
  std::vector<Index> displacements_;
  std::vector<double> masked_;
};

/// Adds the blocks of a cell in the rows (owned entities) that are `wanted`; `places` are those in all of its owned rows.
void add_rows(const CellBlocks& cell, std::span<const char> wanted, std::span<const Index> places, la::BlockMatrix& matrix) {
  const auto entities = cell.entities();
  auto place = places.begin();
  for (std::size_t k = 0; k < entities.size(); ++k) {
    if (entities[k] >= matrix.owned()) continue;
    for (std::size_t l = 0; l < entities.size(); ++l, ++place)
      if (wanted[entities[k]] != 0) matrix.add_at(*place, entities[k], entities[l], cell.block(k, l), cell.width());
  }
}

/// Entities of a cell, each with its position there.
using Positions = std::vector<std::pair<Index, std::size_t>>;

/// Adds the blocks of a cell to those that are held; by halves, its lower ones serve for the others as well. Returns how many it has added.
/// `order` is work space.
double add_bulk(const CellBlocks& cell, Positions& order, la::BlockOperator& bulk) {
  const auto entities = cell.entities();
  order.clear();
  for (std::size_t k = 0; k < entities.size(); ++k) order.push_back({entities[k], k});
  if (order.size() > 4) std::sort(order.begin(), order.end());  // the matrix finds the next place fast; for a few it saves less than it takes
  const int width = cell.width();
  double added = 0;
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = 0; j < (bulk.by_halves() ? i + 1 : order.size()); ++j) {
      const auto& [row, k] = order[i];
      const auto& [column, l] = order[j];
      const bool is_transposed = bulk.by_halves() && l > k;  // of the cell's matrix the lower blocks alone are there
      const double* block = is_transposed ? cell.block(l, k) : cell.block(k, l);
      const int row_step = is_transposed ? 1 : width, column_step = is_transposed ? width : 1;
      if (bulk.holds(row, column))
        bulk.add(row, column, block, row_step, column_step);
      else if (bulk.by_halves() && bulk.holds(column, row))  // the row of a ghost
        bulk.add(column, row, block, column_step, row_step);
      else
        continue;
      ++added;
    }
  return added;
}

/// Whether cells do not ask for the weights of faces, but for those at fractures.
bool consists_of_simplices(const mesh::PolyMesh& mesh) {
  for (Index cell = 0; cell < mesh.n_cells(); ++cell)
    if (mesh.cell_nodes.row_size(cell) != mesh.dim + 1) return false;
  return true;
}

/// A cell of a batch.
struct StiffnessSlot {
  spaces::VemCell vem;
  Index cell = -1;
  std::vector<Index> entities;
  std::vector<double> matrix;
};

/// Hands each of the cells with these blocks to `insert(slot)`, which returns its floating-point operations. In + cells bubbles come last, which
/// are not among the entities. `weights` pay where the cells are most of all.
template <class Insert>
void visit_stiffness(const MechanicsSystem& system, std::span<const Index> cells, physics::Blocks blocks, const spaces::FaceWeights* weights,
                     la::KernelLog& log, Insert&& insert) {
  const mesh::PolyMesh& mesh = system.mesh().mesh;
  const Layout& layout = system.layout();
  const double components = layout.dim() * static_cast<double>(mesh.cell_nodes.values.size()) / std::max(1, mesh.n_cells());
  std::vector<StiffnessSlot> slots(cells_per_batch(components * components),
                                   StiffnessSlot{spaces::VemCell(mesh, layout.bubbles(), weights), -1, {}, {}});
  const auto geometry = [](StiffnessSlot& slot) {
    slot.vem.build(slot.cell);
    return slot.vem.flops();
  };
  const auto matrix = [&](StiffnessSlot& slot) {
    const auto n = static_cast<std::size_t>(slot.vem.components());
    slot.matrix.resize(n * n);
    const physics::Lame& lame = system.moduli()[slot.cell];
    const double gamma = physics::stabilisation_factor(lame, system.problem().stabilisation);
    physics::local_stiffness(layout.dim(), slot.vem, lame, gamma, slot.matrix, blocks);
    return physics::stiffness_flops(layout.dim(), slot.vem, blocks);
  };
  in_batches(cells, slots, log, geometry, matrix, [&](StiffnessSlot& slot) {
    slot.entities.clear();
    layout.visit_entities(mesh, slot.cell, [&](Index entity) { slot.entities.push_back(entity); });
    return insert(std::as_const(slot));
  });
}

/// Rigid-body modes of the owned copies, for algebraic multigrid.
la::Handle<MatNullSpace> rigid_body_modes(const mesh::DistributedMesh& mesh, const Layout& layout) {
  const la::Handle<Vec> coordinates = layout.create_nodal_vector();
  {
    const la::VecWrite x(coordinates);
    const int dim = mesh.mesh.dim;
    for (Index copy = 0; copy < mesh.copies.owned; ++copy)
      for (int a = 0; a < dim; ++a) x[dim * copy + a] = mesh.mesh.nodes[mesh.mesh.copy_node[copy]][a];
  }
  la::Handle<MatNullSpace> modes;
  POLYSLIP_PETSC(MatNullSpaceCreateRigidBody(coordinates, modes.put()));
  return modes;
}

}  // namespace

MechanicsSystem::MechanicsSystem(const mesh::DistributedMesh& mesh, const physics::MechanicsProblem& problem)
    : mesh_(mesh),
      problem_(problem),
      moduli_(mpi::made_together(mesh.comm, [&] { return physics::cell_moduli(mesh.mesh, problem.materials); })),
      layout_(mesh, problem.bubbles),
      cells_(mesh, layout_, moduli_, problem.stabilisation),
      load_assembler_(mesh, problem, layout_, cells_),
      beta_scale_(problem.beta_scale),
      initial_(static_cast<std::size_t>(mesh.fractures.local()), Vec3::Zero()),
      previous_(static_cast<std::size_t>(mesh.fractures.local()), Vec3::Zero()),
      law_(static_cast<std::size_t>(mesh.fractures.local())),
      is_outdated_(static_cast<std::size_t>(cells_.size()), 1),
      work_(layout_.create_state()),
      work2_(layout_.create_state()) {
  mpi::together(mesh.comm, [&] { assign_laws(mesh, problem, cells_); });
  assemble_bulk();
  keep_bulk_diagonal();
}

/// The size of the terms that cancel in a momentum row.
void MechanicsSystem::keep_bulk_diagonal() {
  bulk_diagonal_ = bulk_->diagonal();
  for (Index i = 0; i < layout_.displacement_size(); ++i)
    if (fixed()[i]) bulk_diagonal_[i] = 0;
}

template <class Wanted>
std::vector<Index> MechanicsSystem::our_cells(Wanted&& wanted) const {
  std::vector<Index> chosen;
  for (Index cell = 0; cell < mesh_.mesh.n_cells(); ++cell) {
    if (is_ours(cell) && wanted(cell)) chosen.push_back(cell);
  }
  return chosen;
}

void MechanicsSystem::assemble_bulk() {
  contact_entities_ = contact_entities(layout_, cells_);
  std::copy_if(contact_entities_.values.begin(), contact_entities_.values.end(), std::back_inserter(contact_rows_),
               [&](Index entity) { return entity < layout_.owned_entities(); });
  std::sort(contact_rows_.begin(), contact_rows_.end());
  contact_rows_.erase(std::unique(contact_rows_.begin(), contact_rows_.end()), contact_rows_.end());
  constexpr double flattest_mirrored = 1e4;  // beyond, fewer digits are left
  const Csr graph = matrix_graph(mesh_, layout_, contact_entities_);
  if (mpi::any(mesh_.comm, sum_up_bulk(graph, physics::Blocks::lower) > flattest_mirrored)) sum_up_bulk(graph, physics::Blocks::all);
  describe_fields();
  const auto is_contact_row = [this](Index row) { return std::binary_search(contact_rows_.begin(), contact_rows_.end(), row); };
  create_matrix(is_contact_row);
}

double MechanicsSystem::sum_up_bulk(const Csr& graph, physics::Blocks blocks) {
  const std::vector<Index> cells = our_cells([](Index) { return true; });
  bulk_.reset();
  bulk_ = std::make_unique<la::BlockOperator>(layout_.matrix_layout(), graph, blocks == physics::Blocks::lower);
  std::optional<spaces::FaceWeights> weights;
  if (!consists_of_simplices(mesh_.mesh) || layout_.bubbles() == spaces::Bubbles::all) {
    la::KernelScope scope(kernels_, la::Kernel::geometry);
    weights.emplace(mesh_.mesh);
    scope.add_flops(weights->flops());
  }
  double flattest = 0;
  CellBlocks cell_blocks(layout_, fixed(), CellBlocks::OfFixed::diagonal);
  Positions order;
  visit_stiffness(*this, cells, blocks, weights ? &*weights : nullptr, kernels_, [&](const StiffnessSlot& slot) {
    flattest = std::max(flattest, slot.vem.flatness());
    cell_blocks.assign(slot.entities, slot.matrix, slot.vem.components());
    return add_bulk(cell_blocks, order, *bulk_) * layout_.dim() * layout_.dim();  // nearly: bubbles along normals are narrower
  });
  kernels_.add_bytes(la::Kernel::geometry, bytes_of_geometry(mesh_.mesh) + (weights ? 2 * weights->bytes() : 0));
  kernels_.add_bytes(la::Kernel::local_matrices, static_cast<double>(moduli_.size() * sizeof(physics::Lame)));
  kernels_.add_bytes(la::Kernel::insertion, 2 * bulk_->bytes());  // read and written
  return flattest;
}

template <class Wanted>
void MechanicsSystem::create_matrix(Wanted&& wanted) {
  Csr graph;
  std::vector<Index> row;
  for (Index i = 0; i < layout_.owned_entities(); ++i) {
    row.clear();
    const bool is_wanted = wanted(i);
    bulk_->visit_columns(i, [&](Index column) {
      if (is_wanted || column >= layout_.owned_entities()) row.push_back(column);
    });
    graph.push_row(row);
  }
  matrix_ = std::make_unique<la::BlockMatrix>(layout_.matrix_layout(), graph);
  find_contact_places();
  la::replace_operations(matrix_->get(), operations_);
  if (layout_.bubbles() == spaces::Bubbles::fracture) POLYSLIP_PETSC(MatSetNearNullSpace(matrix_->get(), modes_));
  write_bulk();
  kernels_.add_bytes(la::Kernel::insertion, 2 * bytes_of_entries(matrix_->get()));  // read from A, written
}

void MechanicsSystem::find_contact_places() {
  contact_places_ = {};
  std::vector<Index> places;
  for (Index p = 0; p < cells_.size(); ++p) {
    const auto entities = std::as_const(contact_entities_)[p];
    places.clear();
    for (const Index row : entities)
      for (std::size_t k = 0; row < layout_.owned_entities() && k < entities.size(); ++k) places.push_back(matrix_->place(row, entities[k]));
    contact_places_.push_row(places);
  }
}

void MechanicsSystem::hold_all_rows() {
  if (holds_all_rows_) return;
  holds_all_rows_ = true;
  const MatrixContent content = content_;
  create_matrix([](Index) { return true; });
  write_contact_rows(content);
}

void MechanicsSystem::write_bulk() {
  la::lend_rows(matrix_->get(), *bulk_);
  {
    const la::KernelScope scope(kernels_, la::Kernel::insertion);
    matrix_->begin_writing();
    bulk_->write_to(*matrix_);
  }
  bulk_rows_.clear();
  const auto visit = [&](auto&& take) {
    for (Index row : contact_rows_)
      for (auto values : {matrix_->diagonal_row(row), matrix_->offdiagonal_row(row)}) take(values);
  };
  std::size_t size = 0;
  visit([&](std::span<const double> values) { size += values.size(); });
  bulk_rows_.reserve(size);
  visit([&](std::span<const double> values) { bulk_rows_.insert(bulk_rows_.end(), values.begin(), values.end()); });
  matrix_->end_writing();
  content_ = MatrixContent::bulk;
}

void MechanicsSystem::multiply_whole_rows() {
  if (!bulk_->by_halves()) return;
  sum_up_bulk(bulk_->graph(), physics::Blocks::all);
  write_bulk();
}

bool MechanicsSystem::is_ours(Index cell) const {
  bool is = false;
  layout_.visit_entities(mesh_.mesh, cell, [&](Index entity) { is = is || entity < layout_.owned_entities(); });
  return is;
}

void MechanicsSystem::describe_fields() {
  modes_ = rigid_body_modes(mesh_, layout_);
  if (layout_.bubbles() == spaces::Bubbles::fracture) return;
  const GlobalIndex first = layout_.first();
  POLYSLIP_PETSC(ISCreateStride(mesh_.comm, layout_.nodal_size(), first, 1, nodal_field_.put()));
  POLYSLIP_PETSC(ISSetBlockSize(nodal_field_, layout_.dim()));
  POLYSLIP_PETSC(PetscObjectCompose(reinterpret_cast<PetscObject>(nodal_field_.get()), "nearnullspace",
                                    reinterpret_cast<PetscObject>(modes_.get())));
  POLYSLIP_PETSC(ISCreateStride(mesh_.comm, layout_.displacement_size() - layout_.nodal_size(), first + layout_.nodal_size(), 1,
                                normal_field_.put()));
}

/// Writes the rows of + cells whose blocks are others than those in P.
void MechanicsSystem::write_contact_rows(MatrixContent content) {
  if (fracture_faces() == 0) return;  // the same on all ranks: what follows is collective
  const bool all = content == MatrixContent::bulk || content_ == MatrixContent::bulk;
  std::vector<char> is_new(static_cast<std::size_t>(layout_.owned_entities()), 0);
  for (Index p = 0; p < cells_.size(); ++p)
    if (all || is_outdated_[p] != 0 || (content != content_ && cells_.differs(p)))
      for (const Index entity : std::as_const(contact_entities_)[p])
        if (entity < layout_.owned_entities()) is_new[entity] = 1;
  matrix_->begin_writing();
  auto saved = bulk_rows_.begin();
  for (Index row : contact_rows_)
    for (auto values : {matrix_->diagonal_row(row), matrix_->offdiagonal_row(row)}) {
      if (is_new[row] != 0) std::copy_n(saved, values.size(), values.begin());
      saved += static_cast<std::ptrdiff_t>(values.size());
    }
  CellBlocks blocks(layout_, fixed(), CellBlocks::OfFixed::nothing);
  std::vector<double> block;
  for (Index p = 0; content != MatrixContent::bulk && p < cells_.size(); ++p) {
    const auto entities = std::as_const(contact_entities_)[p];
    if (std::none_of(entities.begin(), entities.end(), [&](Index i) { return i < layout_.owned_entities() && is_new[i] != 0; })) continue;
    cells_.write_block(p, friction_of(content), block);
    blocks.assign(entities, block, cells_.block_size(p));
    add_rows(blocks, is_new, std::as_const(contact_places_)[p], *matrix_);
  }
  matrix_->end_writing();
  content_ = content;
  is_outdated_.assign(is_outdated_.size(), 0);
}

void MechanicsSystem::set_loads(Loads loads) {
  loads_ = std::move(loads);
  compute_lift();
  double squares = 0;
  for (Index i = 0; i < layout_.displacement_size(); ++i) squares += std::pow(loads_.displacement[i], 2) + std::pow(lift_[i], 2);
  for (Index f = 0; f < mesh_.fractures.owned; ++f) squares += std::pow(cells_.faces()[f].area * loads_.fracture_pressure[f], 2);
  load_scale_ = std::sqrt(mpi::sum(mesh_.comm, squares));
}

void MechanicsSystem::compute_lift() {
  lift_.assign(static_cast<std::size_t>(layout_.displacement_size()), 0.0);
  std::vector<Index> displacements;
  const std::vector<Index> cells = our_cells([&](Index cell) {
    displacements.clear();
    layout_.append_displacements(mesh_.mesh, cell, displacements);
    return std::any_of(displacements.begin(), displacements.end(), [&](Index i) { return loads_.dirichlet[i] != 0; });
  });
  la::KernelLog log("lift");
  visit_stiffness(*this, cells, physics::Blocks::all, nullptr, log, [&](const StiffnessSlot& slot) {
    displacements.clear();
    for (const Index entity : slot.entities) layout_.append_components(entity, displacements);
    const std::size_t n = displacements.size(), width = static_cast<std::size_t>(slot.vem.components());
    for (std::size_t i = 0; i < n; ++i) {
      if (displacements[i] >= layout_.displacement_size() || fixed()[displacements[i]]) continue;
      for (std::size_t j = 0; j < n; ++j) lift_[displacements[i]] += slot.matrix[i * width + j] * loads_.dirichlet[displacements[j]];
    }
    return 2.0 * static_cast<double>(n * n);
  });
}

void MechanicsSystem::impose_dirichlet(Vec x) const {
  const la::VecWrite a(x);
  for (Index i = 0; i < layout_.displacement_size(); ++i)
    if (fixed()[i]) a[i] = loads_.dirichlet[i];
}

void MechanicsSystem::set_previous_jumps(Vec x) {
  gather(x, work_);
  for (Index f = 0; f < mesh_.fractures.local(); ++f)
    if (cells_.faces()[f].cell >= 0) previous_[f] = cells_.jump(f, work_);
}

void MechanicsSystem::set_previous_jumps(std::span<const Vec3> jumps) { previous_.assign(jumps.begin(), jumps.end()); }

physics::ContactLaw MechanicsSystem::law_of(Index face) const {
  physics::ContactLaw law = cells_.faces()[face].law;
  law.friction *= friction_factor_;
  if (friction_is_lagged_ && law.kind == FrictionLaw::coulomb) law = {FrictionLaw::tresca, lagged_bounds_[face]};
  return law;
}

double MechanicsSystem::update_lagged_friction(Vec x, double weight) {
  gather(x, work_);
  lagged_bounds_.resize(static_cast<std::size_t>(mesh_.fractures.local()), 0.0);
  double change = 0, largest = 0;
  for (Index face = 0; face < mesh_.fractures.local(); ++face) {
    const double bound = cells_.faces()[face].law.friction * std::max(0.0, work_.multiplier[static_cast<std::size_t>(layout_.dim()) * face]);
    const double before = lagged_bounds_[face];
    lagged_bounds_[face] += weight * (bound - before);
    change = std::max(change, std::abs(bound - before));
    largest = std::max(largest, bound);
  }
  largest = mpi::max(mesh_.comm, largest);
  return largest > 0 ? mpi::max(mesh_.comm, change) / largest : 0;
}

ContactPoint MechanicsSystem::point(Index face, const MechanicalState& state) const {
  ContactPoint p{Vec3::Zero(), cells_.jump(face, state), previous_[face]};
  const int dim = layout_.dim();
  for (int a = 0; a < dim; ++a) p.lam[a] = state.multiplier[static_cast<std::size_t>(dim) * face + a];
  return p;
}

void MechanicsSystem::multiply(std::span<const double> x, MatrixContent content, std::span<double> y) const {
  bulk_->multiply(x, y);
  if (content == MatrixContent::bulk) return;
  std::vector<double> local, rows;
  for (Index p = 0; p < cells_.size(); ++p) {
    const auto displacements = cells_.displacements(p);
    local.clear();
    for (const Index k : displacements) local.push_back(fixed()[k] ? 0.0 : x[k]);
    rows.assign(local.size(), 0.0);
    cells_.add_condensation(p, friction_of(content), 1, local, rows);
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (const Index k = displacements[i]; k < layout_.displacement_size() && !fixed()[k]) y[k] += rows[i];
  }
}

void MechanicsSystem::diagonal(Vec y) const {
  const std::vector<double> bulk = bulk_->diagonal();
  const la::VecWrite entries(y);
  std::copy(bulk.begin(), bulk.end(), entries.data());
  for (Index p = 0; content_ != MatrixContent::bulk && p < cells_.size(); ++p) {
    const auto displacements = cells_.displacements(p);
    for (std::size_t i = 0; i < displacements.size(); ++i)
      if (const Index k = displacements[i]; k < layout_.displacement_size() && !fixed()[k])
        entries[k] += cells_.condensed_diagonal(p, friction_of(content_), static_cast<int>(i));
  }
}

void MechanicsSystem::momentum_action(Vec y, Vec r) const { momentum_rows(y, {}, r); }

void MechanicsSystem::momentum_rows(Vec y, std::span<const double> fracture_pressure, Vec r) const {
  gather(y, work_);
  auto& rows = work2_;
  std::fill(rows.displacement.begin(), rows.displacement.end(), 0.0);
  std::fill(rows.bubble.begin(), rows.bubble.end(), 0.0);
  std::fill(rows.multiplier.begin(), rows.multiplier.end(), 0.0);
  bulk_->multiply(work_.displacement, {rows.displacement.data(), static_cast<std::size_t>(layout_.displacement_size())});
  cells_.add_momentum(work_, fracture_pressure, rows.displacement, rows.bubble);
  for (Index i = 0; i < layout_.displacement_size(); ++i)
    if (fixed()[i]) rows.displacement[i] = work_.displacement[i];
  scatter(rows, r);
}

void MechanicsSystem::residual(Vec x, Vec f) const {
  momentum_rows(x, loads_.fracture_pressure, f);
  const la::VecWrite rows(f);
  for (Index i = 0; i < layout_.displacement_size(); ++i) rows[i] += fixed()[i] ? -loads_.dirichlet[i] : lift_[i] - loads_.displacement[i];
  for (Index i = 0; i < layout_.fracture_size(); ++i) rows[layout_.bubble_start() + i] -= loads_.bubble[static_cast<std::size_t>(i)];
  write_contact_residual(work_, rows);
}

void MechanicsSystem::write_contact_residual(const MechanicalState& state, const la::VecWrite& rows) const {
  const int dim = layout_.dim();
  for (Index face = 0; face < mesh_.fractures.owned; ++face) {
    const Vec3 r = cells_.faces()[face].area * physics::contact_residual(law_of(face), point(face, state), augmentation(face));
    for (int a = 0; a < dim; ++a) rows[layout_.multiplier_start() + dim * face + a] = r[a];
  }
}

void MechanicsSystem::move(Vec x, Vec d, std::span<const Index> moved, Vec f) const {
  gather(d, work_);
  MechanicalState& change = work2_;
  std::fill(change.displacement.begin(), change.displacement.end(), 0.0);
  std::fill(change.bubble.begin(), change.bubble.end(), 0.0);
  bulk_->multiply_rows(bulk_->rows_near(moved), work_.displacement,
                       {change.displacement.data(), static_cast<std::size_t>(layout_.displacement_size())});
  cells_.add_momentum(work_, {}, change.displacement, change.bubble);
  POLYSLIP_PETSC(VecAXPY(x, -1.0, d));
  gather(x, work_);
  const la::VecWrite rows(f);
  for (Index i = 0; i < layout_.displacement_size(); ++i)
    if (!fixed()[i]) rows[i] -= change.displacement[i];
  for (Index i = 0; i < layout_.fracture_size(); ++i) rows[layout_.bubble_start() + i] -= change.bubble[static_cast<std::size_t>(i)];
  write_contact_residual(work_, rows);
}

ContactLine MechanicsSystem::contact_line(Vec x, Vec y) const {
  ContactLine line;
  gather(x, work_);
  gather(y, work2_);
  for (Index face = 0; face < mesh_.fractures.owned; ++face) {
    line.at.push_back(point(face, work_));
    line.direction.push_back(point(face, work2_));
  }
  return line;
}

namespace {
ContactPoint along(const ContactLine& line, std::size_t face, double alpha) {
  const ContactPoint &p = line.at[face], &d = line.direction[face];
  return {p.lam - alpha * d.lam, p.jump - alpha * d.jump, p.previous};
}
}  // namespace

double MechanicsSystem::contact_merit(const ContactLine& line, double alpha) const {
  double squares = 0;
  for (std::size_t face = 0; face < line.at.size(); ++face) {
    const auto f = static_cast<Index>(face);
    squares += std::pow(cells_.faces()[f].area, 2) * physics::contact_residual(law_of(f), along(line, face, alpha), augmentation(f)).squaredNorm();
  }
  return mpi::sum(mesh_.comm, squares);
}

void MechanicsSystem::set_contact_rows(const ContactLine& line, double alpha, Vec f) const {
  const la::VecWrite rows(f);
  const int dim = layout_.dim();
  for (std::size_t face = 0; face < line.at.size(); ++face) {
    const auto k = static_cast<Index>(face);
    const Vec3 r = cells_.faces()[k].area * physics::contact_residual(law_of(k), along(line, face, alpha), augmentation(k));
    for (int a = 0; a < dim; ++a) rows[layout_.multiplier_start() + dim * k + a] = r[a];
  }
}

ResidualNorms MechanicsSystem::norms(Vec x, Vec f) const {
  gather(x, work_);
  const la::VecRead rows(f);
  std::array<double, 4> squares{};
  for (Index i = 0; i < layout_.multiplier_start(); ++i)
    if (i >= layout_.displacement_size() || !fixed()[i]) squares[0] += rows[i] * rows[i];
  for (Index i = 0; i < layout_.displacement_size(); ++i) squares[3] += std::pow(bulk_diagonal_[i] * work_.displacement[i], 2);
  for (Index face = 0; face < mesh_.fractures.owned; ++face) {
    const ContactFace& contact = cells_.faces()[face];
    const ContactPoint p = point(face, work_);
    const double area2 = contact.area * contact.area;
    squares[1] += area2 * physics::contact_residual(law_of(face), p, {contact.stiffness}).squaredNorm();
    squares[2] += area2 * (p.lam.squaredNorm() + std::pow(contact.stiffness, 2) * p.jump.squaredNorm());
  }
  mpi::sum_in_place(mesh_.comm, squares);
  const double contact_force = std::sqrt(squares[2]);
  ResidualNorms n;
  n.momentum = std::sqrt(squares[0]);
  n.momentum_scale = std::max(load_scale_, contact_force);
  n.momentum_floor = 4 * std::numeric_limits<double>::epsilon() * std::sqrt(squares[3]);
  n.contact = std::sqrt(squares[1]);
  n.contact_scale = std::max(contact_force, 1e-6 * load_scale_);
  return n;
}

std::vector<ContactState> MechanicsSystem::states(Vec x) const {
  gather(x, work_);
  std::vector<ContactState> states;
  for (Index face = 0; face < mesh_.fractures.owned; ++face)
    states.push_back(physics::contact_state(law_of(face), point(face, work_), augmentation(face)));
  return states;
}

StateCounts MechanicsSystem::count(std::span<const ContactState> states) const {
  StateCounts counts;
  for (ContactState s : states) ++counts.faces[static_cast<std::size_t>(s)];
  mpi::sum_in_place(mesh_.comm, counts.faces);
  return counts;
}

void MechanicsSystem::condense_contact(Vec x) {
  gather(x, work_);
  for (Index face = 0; face < mesh_.fractures.local(); ++face)
    if (cells_.faces()[face].cell >= 0) law_[face] = physics::linearise_contact(law_of(face), point(face, work_), augmentation(face));
  condense_law();
}

void MechanicsSystem::linearise_contact(Vec x, MatrixContent content) {
  condense_contact(x);
  write_law(content);
}

void MechanicsSystem::with_open_faces(const std::function<void()>& work) {
  const ContactLinearisation open{
      .residual = Vec3::Zero(), .d_lam = Eigen::Matrix3d::Identity(), .d_jump = Eigen::Matrix3d::Zero(), .state = ContactState::open};
  const MatrixContent content = content_;
  std::vector<ContactLinearisation> law = std::exchange(law_, std::vector(law_.size(), open));
  condense_law();
  write_law(content);
  work();
  law_ = std::move(law);
  condense_law();
  write_law(content);
}

void MechanicsSystem::condense_law() {
  const Index n = mesh_.fractures.local();
  std::vector<ContactLinearisation> symmetric(static_cast<std::size_t>(n));
  std::vector<char> differs(static_cast<std::size_t>(n), 0);
  for (Index face = 0; face < n; ++face) {
    if (cells_.faces()[face].cell < 0) continue;
    symmetric[face] = law_[face];
    if (law_[face].state != ContactState::slip || law_of(face).kind != FrictionLaw::coulomb || law_of(face).friction == 0) continue;
    differs[face] = 1;  // only in that the normal traction moves the friction bound; across the direction of slip faces stay held
    symmetric[face].d_lam.block<2, 1>(1, 0).setZero();
    symmetric[face].d_jump.block<2, 1>(1, 0).setZero();
  }
  cells_.condense(law_, symmetric, differs);
  for (Index p = 0; p < cells_.size(); ++p)
    if (cells_.has_changed(p)) is_outdated_[p] = 1;
}

void MechanicsSystem::write_law(MatrixContent content) {
  symmetric_everywhere_ = !mpi::any(mesh_.comm, cells_.any_difference());
  matrix_is_exact_ = symmetric_everywhere_ || content == MatrixContent::exact;
  write_contact_rows(content);
}

std::vector<PetscInt> MechanicsSystem::changing_rows() const {
  std::vector<PetscInt> rows;
  for (Index p = 0; p < cells_.size(); ++p)
    for (Index i : cells_.displacements(p))
      if (i < layout_.displacement_size()) rows.push_back(i);
  std::sort(rows.begin(), rows.end());
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
  return rows;
}

void MechanicsSystem::apply(MatrixContent content, Vec x, Vec y) const {
  {
    const la::VecRead a(x);
    std::copy_n(a.data(), layout_.displacement_size(), work_.displacement.begin());
  }
  layout_.exchange(work_.displacement);
  const la::VecWrite rows(y);
  multiply(work_.displacement, content, {rows.data(), static_cast<std::size_t>(layout_.displacement_size())});
}

void MechanicsSystem::condense_residual(Vec f, Vec displacement) const {
  gather(f, work_);
  cells_.condense_residual(work_.bubble, work_.multiplier, work_.displacement);
  const la::VecWrite rows(displacement);
  for (Index i = 0; i < layout_.displacement_size(); ++i) rows[i] = fixed()[i] ? 0.0 : work_.displacement[i];
}

void MechanicsSystem::recover(Vec f, Vec displacement, Vec direction) const {
  gather(f, work_);
  {
    const la::VecRead a(displacement);
    for (Index i = 0; i < layout_.displacement_size(); ++i) work2_.displacement[i] = fixed()[i] ? 0.0 : a[i];
  }
  layout_.exchange(work2_.displacement);
  cells_.recover(work_.bubble, work_.multiplier, work2_);
  scatter(work2_, direction);
}

}  // namespace polyslip::assembly
