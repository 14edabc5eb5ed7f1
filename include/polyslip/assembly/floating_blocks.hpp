// Blocks of rock whose rigid motions prescribed displacements do not stop: contact alone holds them.
//
// A rigid motion of block B about its point x_B is v(x) = t + w x (x - x_B)/L_B, with 3 (2D) or 6 (3D) coefficients and L_B the block's size.
// What stops it are rows of these coefficients:
//   a prescribed component a of a node copy      v_a(x_s) = 0
//   a fracture face that sticks                  J_sigma v = 0, all components       (J_sigma: the scheme's own jump, that of the face centre)
//   a fracture face that slips                   n^+ . J_sigma v = 0
//   an open one                                  nothing, or n^+ . J_sigma v = 0 where fluid fills it: its volume is that of the fluid
// G, the sum of the rows' squares, is singular where a motion is left; then the equations of the step have no unique solution.
#pragma once

#include <optional>
#include <string>

#include "polyslip/assembly/mechanics_system.hpp"
#include "polyslip/mesh/blocks.hpp"

namespace polyslip::assembly {

class FloatingBlocks {
 public:
  /// Collective.
  explicit FloatingBlocks(const MechanicsSystem& system);

  /// Those that contact alone holds; none in most problems, and then nothing is ever computed.
  [[nodiscard]] const std::vector<mesh::Block>& blocks() const { return floating_; }
  /// Whether there are few enough for free_motion, which else finds nothing.
  [[nodiscard]] bool are_watched() const;
  /// "the block of 32 cells about (0.5, 0.75, 0)"
  [[nodiscard]] static std::string text(const mesh::Block& block);
  /// How the contact states of the owned faces leave a block free to move, as a sentence; nothing where they hold all. Collective.
  [[nodiscard]] std::optional<std::string> free_motion(std::span<const physics::ContactState> states) const;
  /// The same where all faces stick: no contact state could hold the block.
  [[nodiscard]] std::optional<std::string> unstoppable_motion() const;

 private:
  using Row = Eigen::Matrix<double, 6, 1>;
  [[nodiscard]] Row row(Index block, const Vec3& x, const Vec3& direction) const;
  /// `of_copy`: the block of each owned copy.
  void measure_blocks(const mesh::Blocks& blocks, const std::vector<Index>& of_copy);
  void add_prescribed(const mesh::Blocks& blocks, const std::vector<Index>& of_copy);
  void keep_floating(const mesh::Blocks& blocks);
  void add_face(Index face, const Eigen::Matrix3d& frame, int rows, Eigen::MatrixXd& gram) const;
  [[nodiscard]] std::optional<std::string> motion_left(const Eigen::MatrixXd& gram) const;

  const MechanicsSystem& system_;
  int modes_;                         ///< Rigid motions of a block: 3 or 6.
  std::vector<Index> of_cell_;        ///< Block of each local cell.
  std::vector<Vec3> centre_;          ///< x_B
  std::vector<double> size_;          ///< L_B [m]
  std::vector<Eigen::MatrixXd> held_;  ///< G of the prescribed displacements of each block; then of the floating ones.
  std::vector<Index> place_;          ///< Of a block among the floating ones, -1 for those that are held.
  std::vector<mesh::Block> floating_;
};

}  // namespace polyslip::assembly
