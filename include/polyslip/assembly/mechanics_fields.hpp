// What a user wants to see of a mechanical state: stresses in cells, tractions, jumps and friction states on fracture faces.
#pragma once

#include <vector>

#include "polyslip/assembly/mechanics_system.hpp"
#include "polyslip/assembly/point_location.hpp"

namespace polyslip::assembly {

/// One owned fracture face at a state.
struct FractureFaceValues {
  physics::ContactState state;
  double traction_normal;    ///< lam_n [Pa], compression positive.
  Vec3 traction_tangential;  ///< lam_t [Pa], Cartesian.
  double jump_normal;        ///< [u]_n [m], opening negative.
  Vec3 jump_tangential;      ///< [u]_t [m], Cartesian.
  double slip;               ///< |[u]_t - [u]_t^0| [m], from the initial state of the run.
};

/// All owned fracture faces, in their order.
std::vector<FractureFaceValues> fracture_values(const MechanicsSystem& system, Vec x);

/// A state made ready for loops over cells: hands out the unknowns of each cell in the order of VemCell, dim components each (bubbles
/// along normals as vectors).
class CellLoop {
 public:
  CellLoop(const MechanicsSystem& system, Vec x);
  void values(const spaces::VemCell& vem, std::vector<double>& v) const;

 private:
  const MechanicsSystem& system_;
  MechanicalState state_;
  std::vector<Index> fracture_of_face_;
};

/// sigma of each owned cell [Pa]: xx yy zz xy yz xz, six a cell (plane strain: zz included).
std::vector<double> cell_stresses(const MechanicsSystem& system, Vec x);

/// Displacements of the owned copies [m], three components each.
std::vector<double> copy_displacements(const MechanicsSystem& system, Vec x);

/// Largest slip |[u]_t - [u]_t^0| and opening max(0, -[u]_n), and sums over all fractures; over all ranks.
struct FractureExtremes {
  double max_slip = 0, max_opening = 0;            ///< [m]
  double slip_integral = 0, opening_integral = 0;  ///< [m3; 2D: m2]
  double slipped_area = 0;                         ///< Of faces whose slip is more than has_slipped of their size [m2; 2D: m].
  double seismic_moment = 0;                       ///< Of mu |slip|, mu the mean of both sides [N m; 2D: N].
};
/// Slip over the square root of a face's area (2D: its length), far above what Newton's method leaves and below what matters.
inline constexpr double has_slipped = 1e-9;
FractureExtremes fracture_extremes(const MechanicsSystem& system, std::span<const FractureFaceValues> values);

/// Pi_K u at points, on all ranks [m], three components each: of the cell that holds the point, or comes closest to it. Collective.
class DisplacementProbes {
 public:
  DisplacementProbes(const mesh::DistributedMesh& mesh, std::vector<Vec3> points)
      : points_(std::move(points)), cells_(locate_in_cells(mesh, points_)) {}
  [[nodiscard]] std::vector<double> displacements(const MechanicsSystem& system, Vec x) const;

 private:
  std::vector<Vec3> points_;
  std::vector<Located> cells_;
};

}  // namespace polyslip::assembly
