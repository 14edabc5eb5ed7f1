// Places, area vectors, rims and sides of single faces: what orienting, tagging, fracture matching and partitioning share.
#pragma once

#include <array>
#include <span>
#include <utility>
#include <vector>

#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::mesh {

/// Node average of a face [m]: good to tell sides of a domain apart, not a centre of mass.
Vec3 node_average(const PolyMesh& mesh, Index face);

/// Area (3D) or length (2D) times the unit normal, as face_nodes runs [m2; m].
Vec3 area_vector(const PolyMesh& mesh, Index face);

/// The faces of cells seen from each entry of cell_faces.values: the cells of that face, and the fracture it is on.
struct CellSides {
  std::vector<std::array<Index, 2>> cells;
  std::vector<Index> fracture;  ///< As face_fracture; empty without fractures.

  [[nodiscard]] bool on_fracture(Index entry) const { return !fracture.empty() && fracture[entry] >= 0; }
};

/// The sides of all cells of a whole mesh.
CellSides cell_sides(const PolyMesh& mesh);

/// What bounds a face: an edge (3D) or an end node (2D; low == high).
struct Rim {
  Index low, high;
  Index member;  ///< Place of the face in the list that was given.
  bool forward;  ///< Faces turned alike run along a rim that they share in opposite directions; an edge of a polygon leaves its
                 ///< first and enters its second node.

  [[nodiscard]] std::pair<Index, Index> ends() const { return {low, high}; }
};

/// Rims of the faces, sorted by their ends and then by face; `rims` is overwritten.
void sort_rims(const PolyMesh& mesh, std::span<const Index> faces, std::vector<Rim>& rims);
std::vector<Rim> sorted_rims(const PolyMesh& mesh, std::span<const Index> faces);

/// Calls visit(run) for each run of sorted rims with the same ends.
template <class Visit>
void for_each_shared_rim(std::span<const Rim> rims, Visit&& visit) {
  for (std::size_t begin = 0, end = 0; begin < rims.size(); begin = end) {
    while (end < rims.size() && rims[end].ends() == rims[begin].ends()) ++end;
    visit(rims.subspan(begin, end - begin));
  }
}

}  // namespace polyslip::mesh
