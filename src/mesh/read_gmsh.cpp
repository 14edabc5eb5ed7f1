// PETSc's reader does the reading; its DMPlex is then taken apart into cells, faces and groups.
#include <fmt/format.h>
#include <petscdmplex.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "polyslip/common/error.hpp"
#include "polyslip/common/suggest.hpp"
#include "polyslip/la/handle.hpp"
#include "polyslip/la/vec_access.hpp"
#include "polyslip/mesh/builder.hpp"
#include "polyslip/mesh/formats.hpp"

namespace polyslip::mesh {

namespace {

/// While it lives, PETSc's errors are kept as text instead of printed, and PETSc's reader sees these options only, whatever the
/// user gave: periodic nodes are not merged, prisms beside tetrahedra keep their ordinary face order, and z is read in 2D too (to
/// be checked).
class ReaderSession {
 public:
  ReaderSession() {
    POLYSLIP_PETSC(PetscOptionsCreate(&options_));
    for (const auto& [name, value] : {std::pair("-dm_plex_gmsh_periodic", "0"), std::pair("-dm_plex_gmsh_hybrid", "0"),
                                      std::pair("-dm_plex_gmsh_spacedim", "3")}) {
      POLYSLIP_PETSC(PetscOptionsSetValue(options_, name, value));
    }
    POLYSLIP_PETSC(PetscOptionsPush(options_));
    POLYSLIP_PETSC(PetscPushErrorHandler(&ReaderSession::keep, this));
  }
  ~ReaderSession() {
    (void)PetscPopErrorHandler();
    (void)PetscOptionsPop();
    (void)PetscOptionsDestroy(&options_);
  }
  ReaderSession(const ReaderSession&) = delete;
  ReaderSession& operator=(const ReaderSession&) = delete;

  [[nodiscard]] const std::string& first_error() const { return first_error_; }

 private:
  static PetscErrorCode keep(MPI_Comm, int, const char*, const char*, PetscErrorCode code, PetscErrorType, const char* text,
                             void* self) {
    auto& kept = static_cast<ReaderSession*>(self)->first_error_;
    if (kept.empty() && text != nullptr) kept = text;
    return code;
  }

  PetscOptions options_ = nullptr;
  std::string first_error_;
};

la::Handle<DM> load(const std::string& file) {
  ReaderSession session;
  la::Handle<DM> plex;
  if (DMPlexCreateGmshFromFile(PETSC_COMM_SELF, file.c_str(), PETSC_TRUE, plex.put()) == 0) return plex;
  std::string reason = session.first_error();
  while (!reason.empty() && (reason.back() == '\n' || reason.back() == ' ')) reason.pop_back();
  throw InputError(fmt::format("the file is damaged or not a Gmsh mesh that can be read{}{}", reason.empty() ? "" : ": ", shown(reason)),
                   file, "Write it again with Gmsh as msh 4.1 or 2.2, complete, of first order and without partitions");
}

struct Range {
  PetscInt begin = 0, end = 0;
  [[nodiscard]] bool holds(PetscInt point) const { return point >= begin && point < end; }
};

/// Read access to a mesh that PETSc has read.
class Plex {
 public:
  explicit Plex(la::Handle<DM> plex) : plex_(std::move(plex)) {
    POLYSLIP_PETSC(DMGetDimension(plex_, &dim_));
    POLYSLIP_PETSC(DMPlexGetHeightStratum(plex_, 0, &cells_.begin, &cells_.end));
    POLYSLIP_PETSC(DMPlexGetDepthStratum(plex_, 0, &nodes_.begin, &nodes_.end));
  }

  /// Numbers cells, faces and nodes anew by reverse Cuthill-McKee, so that neighbours in the mesh are neighbours in memory. Gmsh numbers cells
  /// as they came up; solves of 400000 unknowns in 3D take a sixth longer in that order.
  void sort() {
    la::Handle<IS> order;
    la::Handle<DM> sorted;
    POLYSLIP_PETSC(DMPlexGetOrdering(plex_, MATORDERINGRCM, nullptr, order.put()));
    POLYSLIP_PETSC(DMPlexPermute(plex_, order, sorted.put()));
    plex_ = std::move(sorted);
  }

  [[nodiscard]] int dim() const { return dim_; }
  [[nodiscard]] Range cells() const { return cells_; }
  [[nodiscard]] Range nodes() const { return nodes_; }

  [[nodiscard]] std::span<const PetscInt> faces_of(PetscInt cell) const {
    PetscInt count = 0;
    const PetscInt* cone = nullptr;
    POLYSLIP_PETSC(DMPlexGetConeSize(plex_, cell, &count));
    POLYSLIP_PETSC(DMPlexGetCone(plex_, cell, &cone));
    return {cone, static_cast<std::size_t>(count)};
  }

  /// Nodes of a face, numbered from 0, in cyclic order.
  void nodes_of(PetscInt face, std::vector<Index>& nodes) const {
    PetscInt count = 0, *closure = nullptr;
    POLYSLIP_PETSC(DMPlexGetTransitiveClosure(plex_, face, PETSC_TRUE, &count, &closure));
    nodes.clear();
    for (PetscInt i = 0; i < count; ++i) {  // pairs of point and orientation
      if (nodes_.holds(closure[2 * i])) nodes.push_back(closure[2 * i] - nodes_.begin);
    }
    POLYSLIP_PETSC(DMPlexRestoreTransitiveClosure(plex_, face, PETSC_TRUE, &count, &closure));
  }

  /// Empty when the coordinates belong to curved elements of higher order.
  [[nodiscard]] std::vector<Vec3> coordinates() const {
    PetscSection section = nullptr;
    Vec values = nullptr;
    Range points;
    POLYSLIP_PETSC(DMGetCoordinateSection(plex_, &section));
    POLYSLIP_PETSC(DMGetCoordinatesLocal(plex_, &values));
    POLYSLIP_PETSC(PetscSectionGetChart(section, &points.begin, &points.end));
    PetscInt size = 0;
    POLYSLIP_PETSC(VecGetLocalSize(values, &size));
    std::vector<Vec3> result;
    if (size != 3 * (nodes_.end - nodes_.begin) || points.begin < nodes_.begin) return result;
    const la::VecRead x(values);
    for (PetscInt i = 0; i < size; i += 3) result.emplace_back(x[i], x[i + 1], x[i + 2]);
    return result;
  }

  /// Calls apply(value, points) for each value above 0 of a label, ascending (physical group 0 of msh 2.2 means none).
  template <class Apply>
  void for_each_group(const char* label_name, Apply&& apply) const {
    DMLabel label = nullptr;
    POLYSLIP_PETSC(DMGetLabel(plex_, label_name, &label));
    if (label == nullptr) return;
    for (const PetscInt value : copy(label, [](DMLabel l, IS*is) { return DMLabelGetNonEmptyStratumValuesIS(l, is); })) {
      if (value > 0) apply(value, copy(label, [value](DMLabel l, IS* is) { return DMLabelGetStratumIS(l, value, is); }));
    }
  }

 private:
  /// Sorted indices of the IS that `get` gives.
  template <class Get>
  static std::vector<PetscInt> copy(DMLabel label, Get&& get) {
    la::Handle<IS> is;
    POLYSLIP_PETSC(get(label, is.put()));
    if (is.get() == nullptr) return {};
    PetscInt count = 0;
    const PetscInt* indices = nullptr;
    POLYSLIP_PETSC(ISGetLocalSize(is, &count));
    POLYSLIP_PETSC(ISGetIndices(is, &indices));
    std::vector<PetscInt> result(indices, indices + count);
    POLYSLIP_PETSC(ISRestoreIndices(is, &indices));
    std::sort(result.begin(), result.end());
    return result;
  }

  la::Handle<DM> plex_;
  PetscInt dim_ = 0;
  Range cells_, nodes_;
};

/// Names of physical groups by dimension and number. PETSc's labels carry the numbers only (with its option for names, groups
/// without a name are lost). The section is text in binary files too.
class GroupNames {
 public:
  explicit GroupNames(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    std::string line;
    while (std::getline(in, line) && !line.starts_with("$PhysicalNames")) {
      if (line.starts_with("$Nodes")) return;  // the names come before
    }
    int count = 0, dim = 0, number = 0;
    in >> count;
    for (int i = 0; i < count && in >> dim >> number && std::getline(in, line); ++i) {
      const auto open = line.find('"'), close = line.rfind('"');
      if (open < close) names_[{dim, number}] = line.substr(open + 1, close - open - 1);
    }
  }

  [[nodiscard]] std::string operator()(int dim, int number) const {
    const auto at = names_.find({dim, number});
    return at != names_.end() && !at->second.empty() ? at->second : fmt::format("{}:{}", dim, number);
  }

 private:
  std::map<std::pair<int, int>, std::string> names_;
};

void check_coordinates(const Plex& plex, const std::string& file) {
  const std::vector<Vec3> nodes = plex.coordinates();
  if (nodes.empty()) {
    throw InputError("the elements are of second or higher order", file, "Set Mesh.ElementOrder = 1 in Gmsh");
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (!nodes[i].allFinite()) throw InputError(fmt::format("node {} is at ({}, {}, {})", i, nodes[i].x(), nodes[i].y(), nodes[i].z()), file, "Repair its coordinates");
    if (plex.dim() == 2 && nodes[i].z() != 0) {
      throw InputError(
          fmt::format("a mesh of triangles or quadrilaterals must lie in the plane z = 0, but a node has z = {:g}", nodes[i].z()),
          file, "Move it to z = 0, or mesh the volumes if this is meant to be 3D");
    }
  }
}

/// Region of each cell in `plex`, by physical group.
std::vector<Index> cell_regions(const Plex& plex, const GroupNames& names, MeshBuilder& builder) {
  std::vector<Index> region(plex.cells().end - plex.cells().begin, -1);
  plex.for_each_group("Cell Sets", [&](PetscInt value, const std::vector<PetscInt>& points) {
    const Index number = builder.region(names(plex.dim(), value));
    for (const PetscInt cell : points) {
      if (plex.cells().holds(cell)) region[cell - plex.cells().begin] = number;
    }
  });
  if (std::find(region.begin(), region.end(), -1) != region.end()) {
    const Index rock = builder.region("rock");
    std::replace(region.begin(), region.end(), Index{-1}, rock);
  }
  return region;
}

}  // namespace

PolyMesh read_gmsh(const std::filesystem::path& path) {
  const std::string file = path.string();
  check_gmsh(path);
  Plex plex(load(file));
  if (plex.dim() < 2 || plex.cells().end == plex.cells().begin) {
    throw InputError("the file has no cells (triangles, quadrilaterals, tetrahedra, hexahedra, prisms or pyramids)", file,
                     "Mesh the surfaces (2D) or volumes (3D) and save all elements (Mesh.SaveAll = 1)");
  }
  check_coordinates(plex, file);  // by the numbers of the file
  plex.sort();
  const GroupNames names(file);
  MeshBuilder builder(plex.dim(), plex.coordinates(), file);
  const auto region = cell_regions(plex, names, builder);
  std::vector<Index> nodes;
  for (PetscInt cell = plex.cells().begin; cell < plex.cells().end; ++cell) {
    builder.add_cell(region[cell - plex.cells().begin]);
    for (const PetscInt face : plex.faces_of(cell)) {
      plex.nodes_of(face, nodes);
      builder.add_face(nodes);
    }
  }
  plex.for_each_group("Face Sets", [&](PetscInt value, const std::vector<PetscInt>& faces) {
    const Index tag = builder.tag(names(plex.dim() - 1, value));
    for (const PetscInt face : faces) {
      plex.nodes_of(face, nodes);
      builder.tag_face(tag, nodes);
    }
  });
  return builder.build();
}

}  // namespace polyslip::mesh
