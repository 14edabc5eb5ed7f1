// A part of the fractures whose state is followed over time: means over its area, and its face nearest to sliding (the Mohr path).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "polyslip/assembly/mechanics_fields.hpp"
#include "polyslip/common/expression.hpp"

namespace polyslip::assembly {

/// Which faces: those of one fracture, or of all where it is empty, whose centre makes `where` non-zero, or all.
struct WindowRule {
  std::string fracture;
  std::optional<Expression> where;
};

/// Means by area; of the nearest face, |lam_t| over the friction bound (1 where it slips) and its tractions. Compression positive.
struct WindowValues {
  double traction_normal = 0, traction_tangential = 0;  ///< lam_n, |lam_t| [Pa]
  double slip = 0;                                      ///< From the initial state [m].
  double pressure = 0, aperture = 0;                    ///< [Pa], [m]; 0 where fractures carry no fluid.
  double nearest_ratio = 0, nearest_normal = 0, nearest_tangential = 0;
};

class FractureWindow {
 public:
  FractureWindow(const mesh::DistributedMesh& mesh, const WindowRule& rule);

  [[nodiscard]] double area() const { return area_; }  ///< Over all ranks [m2; 2D: m].

  /// Of the owned fracture faces: their states, and p_f and d_f, which are empty where fractures carry no fluid. Open faces bear no
  /// traction and are near to nothing; of several equally near, the one with the lowest number in the serial mesh. Collective.
  [[nodiscard]] WindowValues values(const MechanicsSystem& system, std::span<const FractureFaceValues> faces,
                                    std::span<const double> pressures, std::span<const double> apertures) const;

 private:
  const mesh::DistributedMesh& mesh_;
  std::vector<Index> faces_;  ///< Owned fracture faces in the window.
  std::vector<double> areas_;
  double area_ = 0;
};

}  // namespace polyslip::assembly
