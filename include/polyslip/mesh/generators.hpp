// Boxes meshed by quads, triangles, polygons, hexahedra, Kuhn tetrahedra, prisms, Voronoi polyhedra and shaken hexahedra.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::mesh {

/// Sizes along one axis: cells of `size` at both ends of the core [from, to], growing outwards by the factor `growth` a cell and towards the
/// middle of the core by the factor `inner_growth` (1: all of one size). The number of growing cells on each side of the core is the smallest
/// that reaches the box side with the given growth, and these are then scaled to end on it exactly.
struct AxisGrading {
  double from, to;            ///< [m], inside the box
  double size;                ///< [m]; the number of cells (of each half, where they grow inwards) is rounded, and they are scaled to fit
  double growth;              ///< > 1
  double inner_growth = 1.0;  ///< >= 1
};

/// A box as the scene describes it (interface.md, mesh.box).
struct BoxSpec {
  int dim = 3;
  std::array<double, 3> min{}, max{};                 ///< [m]
  std::array<Index, 3> cells{};                       ///< Counts; ignored on graded axes.
  std::array<std::optional<AxisGrading>, 3> grading;  ///< By axis.
  std::string shape = "hexahedra";  ///< quads, triangles, polygons, warped (2D); hexahedra, tets, prisms, polyhedra, warped, cut (3D).
  double shake = 0.2;               ///< Largest move along each axis of an inner node in units of the smallest spacing around it (warped,
                                    ///< cut), or of a Voronoi seed in units of the spacing (polygons, polyhedra). Below 0.5.
  std::uint64_t seed = 1;
  /// Planes that must stay unions of faces: axis and coordinate (the planes of axis-aligned fractures). Shaken nodes on them slide within them;
  /// Voronoi seeds are mirrored about them. A fracture that ends inside the box needs the planes through its ends (edges) kept too.
  std::vector<std::pair<int, double>> kept_planes;
  std::string where = "mesh.box";  ///< For messages.
};

/// Serial mesh with one region "rock" and the side tags left, right (x), front, back (y; bottom, top in 2D), bottom, top (z).
/// Fractures are not marked and copies not built.
/// Throws InputError with key, value and remedy for a box that makes no sense.
PolyMesh make_box(const BoxSpec& spec);

}  // namespace polyslip::mesh
