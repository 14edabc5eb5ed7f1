// What no single key can tell: checks between the keys of a complete document, and of a scene's names against those of the mesh.
#pragma once

#include <string>
#include <vector>

#include "polyslip/scene/document.hpp"
#include "polyslip/scene/scene.hpp"

namespace polyslip::scene {

/// Throws InputError where keys contradict each other or together leave the problem ill-posed.
void check_document(const Cursor& root);

[[noreturn]] void refuse(const Cursor& at, const std::string& what, const std::string& remedy);

/// Throws InputError where two entries have the same text below `key`.
void check_unique(const std::vector<Cursor>& entries, const std::string& key);

/// Fractures of a native mesh are known only when it is read.
bool may_have_fractures(const Cursor& root);

/// Whether every fracture of the scene has an entry of its name.
bool cover_all_fractures(const std::vector<Cursor>& entries, const Cursor& root);

/// What a mesh offers to a scene.
struct MeshNames {
  int dim = 0;
  std::vector<std::string> tags, regions, fractures;
  Vec3 low, high;  ///< Bounding box [m].
};

/// Of a box, known before it is meshed.
MeshNames names_of(const mesh::BoxSpec& box);
/// Of a mesh; of one without nodes the bounding box is inside out.
MeshNames names_of(const mesh::PolyMesh& mesh);

void check_known(const std::string& what, const std::string& name, const std::vector<std::string>& known, const std::string& place);

/// Throws InputError for a point outside the bounding box.
void check_inside(const std::string& what, const Vec3& at, const MeshNames& mesh, const std::string& place);

void check_fracture(const std::string& name, const std::vector<std::string>& known, const std::string& place);

/// Fractures of the scene and of the mesh.
std::vector<std::string> fracture_names(const Scene& scene, const MeshNames& mesh);

/// Throws InputError for a dimension, tag, group, region, fracture, well or probe that the mesh does not have.
void check_names(const Scene& scene, const MeshNames& mesh);

}  // namespace polyslip::scene
