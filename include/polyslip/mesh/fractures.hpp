// Fractures of a scene matched to mesh faces: by physical group or by segments (2D) and polygons (3D).
#pragma once

#include <string>
#include <vector>

#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::mesh {

/// One fracture as the scene describes it. Give either `group` or `points`.
struct FractureGeometry {
  std::string name;
  std::string where;         ///< Place in the scene, for messages: "scene.yaml:12 (fractures[0])".
  std::string group;         ///< Physical group (tag name) of the mesh file.
  std::vector<Vec3> points;  ///< 2D: polyline of two or more points. 3D: planar polygon, any number of corners, maybe not convex.
};

/// Fills face_fracture, fracture_names, fracture_length, face_tip_distance and turns fracture faces so that the + side is
/// consistent over each fracture: the + side lies to the LEFT of a polyline followed from its first to its last point (2D), on the
/// side that the right-hand normal of the polygon points into (3D); for a physical group the side is carried from face to face over the
/// edges they share (never across an edge where three or more faces of the group meet on non-smooth turns), starting so that
/// the first face's n^+ has a negative last non-zero component.
/// Tips: ends (2D) or outer edges (3D) of a fracture that lie neither on the domain boundary nor on a shared corner of the same fracture.
/// Every piece must be covered by faces entirely: throws InputError with name, place, uncovered part and remedy.
void mark_fractures(PolyMesh& mesh, const std::vector<FractureGeometry>& fractures);

}  // namespace polyslip::mesh
