// What no single key can tell: checks between the keys of a complete document, and of a scene's names against those of the mesh.
#pragma once

#include <string>
#include <vector>

#include "polyslip/scene/document.hpp"
#include "polyslip/scene/scene.hpp"

namespace polyslip::scene {

/// Throws InputError where keys contradict each other or together leave the problem ill-posed.
void check_document(const Cursor& root);

/// What a mesh offers to a scene.
struct MeshNames {
  int dim = 0;
  std::vector<std::string> tags, regions, fractures;
  Vec3 low, high;  ///< Bounding box [m].
};

/// Of a box, known before it is meshed.
MeshNames names_of(const mesh::BoxSpec& box);

/// Throws InputError for a dimension, tag, group, region, fracture or probe that the mesh does not have.
void check_names(const Scene& scene, const MeshNames& mesh);

}  // namespace polyslip::scene
