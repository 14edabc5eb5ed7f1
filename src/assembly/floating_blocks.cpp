#include "polyslip/assembly/floating_blocks.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "polyslip/common/mpi.hpp"

namespace polyslip::assembly {

namespace {

constexpr double negligible = 1e-12;  ///< Eigenvalue of G over its largest one: nothing stops this motion.
constexpr std::size_t most = 100;     ///< Floating blocks for which G, a full matrix on every rank, is still cheap.

/// Eigenvalues in rising order.
Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> decompose(const Eigen::MatrixXd& gram) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(gram);
}

bool is_singular(const Eigen::VectorXd& eigenvalues) {
  return eigenvalues[0] <= negligible * eigenvalues[eigenvalues.size() - 1];
}

}  // namespace

std::string FloatingBlocks::text(const mesh::Block& block) {
  return fmt::format("the block of {} cell{} about ({:.4g}, {:.4g}, {:.4g})", block.cells, block.cells == 1 ? "" : "s", block.point.x(),
                     block.point.y(), block.point.z());
}

FloatingBlocks::FloatingBlocks(const MechanicsSystem& system) : system_(system), modes_(system.layout().dim() == 2 ? 3 : 6) {
  const mesh::Blocks blocks = mesh::find_blocks(system.mesh());
  of_cell_ = blocks.of_cell;
  const mesh::DistributedMesh& mesh = system.mesh();
  std::vector<Index> of_copy(static_cast<std::size_t>(mesh.copies.owned));
  for (Index cell = 0; cell < mesh.mesh.n_cells(); ++cell)
    for (const Index copy : mesh.mesh.copies_of(cell))
      if (copy < mesh.copies.owned) of_copy[copy] = of_cell_[cell];
  measure_blocks(blocks, of_copy);
  add_prescribed(blocks, of_copy);
  keep_floating(blocks);
}

void FloatingBlocks::measure_blocks(const mesh::Blocks& blocks, const std::vector<Index>& of_copy) {
  const mesh::DistributedMesh& mesh = system_.mesh();
  std::vector<double> squares(blocks.blocks.size(), 0.0);  // negative
  for (Index copy = 0; copy < mesh.copies.owned; ++copy) {
    const Index block = of_copy[copy];
    squares[block] = std::min(squares[block], -(mesh.mesh.nodes[mesh.mesh.copy_node[copy]] - blocks.blocks[block].point).squaredNorm());
  }
  mpi::min_in_place(mesh.comm, squares);
  for (std::size_t b = 0; b < squares.size(); ++b) {
    centre_.push_back(blocks.blocks[b].point);
    size_.push_back(std::sqrt(-squares[b]));
  }
}

FloatingBlocks::Row FloatingBlocks::row(Index block, const Vec3& x, const Vec3& direction) const {
  const Vec3 turn = (x - centre_[block]).cross(direction) / size_[block];  // direction . (w x (x - x_B)) = w . ((x - x_B) x direction)
  Row r = Row::Zero();
  r.head<3>() = direction;
  if (system_.layout().dim() == 3)
    r.tail<3>() = turn;
  else
    r[2] = turn.z();
  return r;
}

void FloatingBlocks::add_prescribed(const mesh::Blocks& blocks, const std::vector<Index>& of_copy) {
  const mesh::DistributedMesh& mesh = system_.mesh();
  const mesh::PolyMesh& m = mesh.mesh;
  const auto entries = static_cast<std::size_t>(modes_) * modes_;
  std::vector<double> grams(blocks.blocks.size() * entries, 0.0);
  for (Index copy = 0; copy < mesh.copies.owned; ++copy)
    for (int a = 0; a < m.dim; ++a) {
      if (!system_.fixed()[system_.layout().of_copy(copy) + a]) continue;
      const Row r = row(of_copy[copy], m.nodes[m.copy_node[copy]], Vec3::Unit(a));
      Eigen::Map<Eigen::MatrixXd>(grams.data() + of_copy[copy] * entries, modes_, modes_) += r.head(modes_) * r.head(modes_).transpose();
    }
  mpi::sum_in_place(mesh.comm, grams);
  for (std::size_t b = 0; b < blocks.blocks.size(); ++b) held_.emplace_back(Eigen::Map<Eigen::MatrixXd>(grams.data() + b * entries, modes_, modes_));
}

void FloatingBlocks::keep_floating(const mesh::Blocks& blocks) {
  std::vector<Eigen::MatrixXd> floating;
  for (std::size_t b = 0; b < held_.size(); ++b) {
    const bool is_held = !is_singular(decompose(held_[b]).eigenvalues());
    place_.push_back(is_held ? -1 : static_cast<Index>(floating.size()));
    if (is_held) continue;
    floating.push_back(held_[b]);
    floating_.push_back(blocks.blocks[b]);
  }
  held_ = std::move(floating);
}

void FloatingBlocks::add_face(Index face, const Eigen::Matrix3d& frame, int rows, Eigen::MatrixXd& gram) const {
  const mesh::DistributedMesh& mesh = system_.mesh();
  const auto [plus, minus] = mesh.mesh.face_cells[mesh.fracture_faces[face]];
  const Index blocks[2] = {of_cell_[plus], of_cell_[minus]};
  const Vec3& x = system_.contact_cells().faces()[face].centre;
  for (int i = 0; i < rows; ++i) {
    Eigen::VectorXd jump = Eigen::VectorXd::Zero(gram.rows());
    for (int side = 0; side < 2; ++side)
      if (const Index place = place_[blocks[side]]; place >= 0)
        jump.segment(place * modes_, modes_) += (side == 0 ? 1 : -1) * row(blocks[side], x, frame.row(i).transpose()).head(modes_);
    gram += jump * jump.transpose();
  }
}

std::optional<std::string> FloatingBlocks::free_motion(std::span<const physics::ContactState> states) const {
  if (floating_.empty() || !are_watched()) return std::nullopt;
  const auto n = static_cast<Eigen::Index>(floating_.size()) * modes_;
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(n, n);
  const ContactCells& cells = system_.contact_cells();
  for (Index face = 0; face < static_cast<Index>(states.size()); ++face) {
    const ContactFace& f = cells.faces()[face];
    const bool is_filled = cells.pressures(f.cell).size() > 1;
    const bool sticks = states[face] == physics::ContactState::stick, open = states[face] == physics::ContactState::open;
    add_face(face, f.frame, sticks ? system_.layout().dim() : open && !is_filled ? 0 : 1, gram);
  }
  mpi::sum_in_place(system_.mesh().comm, std::span<double>(gram.data(), static_cast<std::size_t>(gram.size())));
  for (std::size_t b = 0; b < held_.size(); ++b)
    gram.block(static_cast<Eigen::Index>(b) * modes_, static_cast<Eigen::Index>(b) * modes_, modes_, modes_) += held_[b];
  return motion_left(gram);
}

bool FloatingBlocks::are_watched() const { return floating_.size() <= most; }

std::optional<std::string> FloatingBlocks::unstoppable_motion() const {
  return free_motion(std::vector<physics::ContactState>(static_cast<std::size_t>(system_.mesh().fractures.owned), physics::ContactState::stick));
}

std::optional<std::string> FloatingBlocks::motion_left(const Eigen::MatrixXd& gram) const {
  const auto solver = decompose(gram);
  if (!is_singular(solver.eigenvalues())) return std::nullopt;
  const Eigen::VectorXd motion = solver.eigenvectors().col(0);
  Eigen::Index largest = 0;
  motion.cwiseAbs().maxCoeff(&largest);
  const Eigen::Index place = largest / modes_, dim = system_.layout().dim();
  Vec3 shift = Vec3::Zero();
  shift.head(dim) = motion.segment(place * modes_, dim);
  const std::string what = text(floating_[static_cast<std::size_t>(place)]);
  if (largest % modes_ >= dim) return what + " is free to turn";
  shift /= shift.cwiseAbs().maxCoeff() * (shift[largest % modes_] < 0 ? -1 : 1);
  const auto clean = [](double v) { return std::abs(v) < 1e-6 ? 0.0 : v; };
  return fmt::format("{} is free to move along ({:.3g}, {:.3g}, {:.3g})", what, clean(shift[0]), clean(shift[1]), clean(shift[2]));
}

}  // namespace polyslip::assembly
