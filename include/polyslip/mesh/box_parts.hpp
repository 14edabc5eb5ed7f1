// What the generators of box meshes share: the lattice of planes that cuts the box into small boxes, and one function a family of
// shapes.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "polyslip/mesh/generators.hpp"

namespace polyslip::mesh {

/// Planes at[axis][0 .. cells(axis)] normal to each axis [m]; in 2D at[2] = {0}. Small boxes and nodes are numbered with the first
/// axis fastest.
struct BoxLattice {
  int dim = 3;
  std::array<std::vector<double>, 3> at;
  std::array<std::vector<char>, 3> fixed;  ///< True on the sides of the box and on the kept planes.

  using Place = std::array<Index, 3>;
  [[nodiscard]] Index cells(int axis) const { return axis < dim ? static_cast<Index>(at[axis].size()) - 1 : 1; }
  [[nodiscard]] Index n_cells() const { return cells(0) * cells(1) * cells(2); }
  /// Node at the lower corner of a small box plus `up` (zeros and ones).
  [[nodiscard]] Index node(const Place& p, const Place& up = {0, 0, 0}) const {
    const auto rows = static_cast<Index>(at[0].size()), columns = static_cast<Index>(at[1].size());
    return ((p[2] + up[2]) * columns + p[1] + up[1]) * rows + p[0] + up[0];
  }
  [[nodiscard]] std::vector<Vec3> nodes() const;
  /// Calls visit(place) for every small box, in order.
  template <class Visit>
  void for_each_cell(Visit&& visit) const {
    for (Index k = 0; k < cells(2); ++k) {
      for (Index j = 0; j < cells(1); ++j) {
        for (Index i = 0; i < cells(0); ++i) visit(Place{i, j, k});
      }
    }
  }
};

/// Numbers between -1 and 1 that are the same on every machine (the standard's distributions are not).
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : engine_(seed) {}
  double roll() { return std::ldexp(static_cast<double>(engine_() >> 11), -52) - 1.0; }

 private:
  std::mt19937_64 engine_;
};

PolyMesh make_cuboids(const BoxLattice& lattice);    ///< Quads or hexahedra.
PolyMesh make_simplices(const BoxLattice& lattice);  ///< Triangles, 2 a square, or Kuhn's tetrahedra, 6 a cube.
PolyMesh make_prisms(const BoxLattice& lattice);     ///< Triangles along x and y times layers along z.
/// Moves the nodes of make_cuboids along each axis by up to `shake` times the smallest spacing around them; nodes on fixed planes
/// stay on them.
void shake_nodes(PolyMesh& mesh, const BoxLattice& lattice, double shake, std::uint64_t seed);
/// Cuts every quad that is not planar along its shorter diagonal.
void cut_warped_quads(PolyMesh& mesh);
/// Polygons or polyhedra: Voronoi cells of one seed in each small box of a uniform lattice, moved along each axis by up to `shake`
/// spacings and mirrored about the fixed planes. They are Voronoi cells of a lattice of unit spacing, then stretched to the box.
PolyMesh make_voronoi(const BoxLattice& lattice, const BoxSpec& spec);

}  // namespace polyslip::mesh
