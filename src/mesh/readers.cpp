#include "polyslip/mesh/readers.hpp"

#include <fmt/format.h>

#include <array>
#include <string>

#include "polyslip/common/error.hpp"
#include "polyslip/mesh/builder.hpp"
#include "polyslip/mesh/formats.hpp"

namespace polyslip::mesh {

namespace {

bool has_untagged_boundary(const PolyMesh& mesh) {
  for (Index face = 0; face < mesh.n_faces(); ++face) {
    if (mesh.on_boundary(face) && mesh.face_tag[face] < 0) return true;
  }
  return false;
}

/// Names what the file leaves unnamed: boundary faces on a side of the bounding box are tagged as generated boxes are.
void tag_box_sides(PolyMesh& mesh) {
  if (!has_untagged_boundary(mesh)) return;
  Vec3 low = mesh.nodes.front(), high = low;
  for (const Vec3& x : mesh.nodes) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  using Names = std::array<const char*, 6>;
  const Names names =
      mesh.dim == 2 ? Names{"left", "right", "bottom", "top", "", ""} : Names{"left", "right", "front", "back", "bottom", "top"};
  for (int axis = 0; axis < mesh.dim; ++axis) {
    const double near = 1e-9 * (high - low)[axis];
    tag_boundary(mesh, names[2 * axis], [&](const Vec3& x) { return x[axis] <= low[axis] + near; });
    tag_boundary(mesh, names[2 * axis + 1], [&](const Vec3& x) { return x[axis] >= high[axis] - near; });
  }
}

}  // namespace

void require_file(const std::filesystem::path& file) {
  if (!std::filesystem::is_regular_file(file)) {
    throw InputError("there is no such file", file.string(), "Give the path of a .msh (Gmsh) or .h5 (native) file");
  }
}

PolyMesh read_mesh(const std::filesystem::path& file) {
  require_file(file);
  const std::string ending = file.extension().string();
  if (ending == ".h5") return read_native(file);
  if (ending == ".msh") {
    PolyMesh mesh = read_gmsh(file);
    tag_box_sides(mesh);
    return mesh;
  }
  throw InputError(fmt::format("meshes with the ending '{}' cannot be read", ending), file.string(),
                   "Give a .msh (Gmsh) or .h5 (native) file");
}

}  // namespace polyslip::mesh
