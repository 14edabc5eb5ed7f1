#include "polyslip/mesh/generators.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "polyslip/common/error.hpp"
#include "polyslip/mesh/box_parts.hpp"
#include "polyslip/mesh/builder.hpp"

namespace polyslip::mesh {
namespace {

constexpr std::array<const char*, 3> kAxisNames{"x", "y", "z"};
const std::vector<std::string> kShapes2d{"quads", "triangles", "polygons", "warped"};
const std::vector<std::string> kShapes3d{"hexahedra", "tets", "prisms", "polyhedra", "warped", "cut"};

void check_shape(const BoxSpec& spec) {
  if (spec.dim != 2 && spec.dim != 3) {
    throw InputError(fmt::format("dimension {} is neither 2 nor 3", spec.dim), spec.where,
                     "Give min and max two or three numbers each");
  }
  const auto& shapes = spec.dim == 2 ? kShapes2d : kShapes3d;
  if (std::find(shapes.begin(), shapes.end(), spec.shape) == shapes.end()) {
    throw InputError(fmt::format("'{}' is no shape of a {}D box", spec.shape, spec.dim), spec.where + ".shape",
                     fmt::format("Choose one of {}", fmt::join(shapes, ", ")));
  }
  if (!(spec.shake >= 0.0 && spec.shake < 0.5)) {
    throw InputError(fmt::format("{:g} is not between 0 and 0.5", spec.shake), spec.where + ".shake",
                     "Nodes and seeds may move by less than half a spacing; 0.2 is usual");
  }
}

/// How many cells a core holds; where they grow inwards, an even number: size (q^n - 1)/(q - 1) = length/2 from each end to the middle.
double cells_of_core(const AxisGrading& grading) {
  const double cells = (grading.to - grading.from) / grading.size, q = grading.inner_growth;
  if (q == 1.0) return std::max(1.0, std::round(cells));
  return 2.0 * std::max(1.0, std::round(std::log1p(0.5 * cells * (q - 1.0)) / std::log(q)));
}

/// Refuses what no memory of this machine can hold, before it is tried.
void check_count(const BoxSpec& spec) {
  double cells = 1;
  for (int axis = 0; axis < spec.dim; ++axis) {
    const auto& grading = spec.grading[axis];
    if (grading && !(grading->size > 0 && grading->inner_growth >= 1)) return;  // refused where its axis is made
    cells *= grading ? cells_of_core(*grading) : std::max(1, spec.cells[axis]);
  }
  constexpr double least_bytes = 500;  // Of a cell, its faces and nodes.
  const double memory = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
  if (cells * least_bytes < memory) return;
  throw InputError(fmt::format("{:.3g} cells do not fit into the {:.3g} GB of this machine's memory", cells, memory / 1e9), spec.where + ".cells",
                   "Give fewer cells, or a larger size where axes are graded");
}

/// Sizes that grow from `grading.size` by `grading.growth` a cell until they fill `length`, scaled to fill it exactly; none for no
/// length.
std::vector<double> growing_sizes(const AxisGrading& grading, double length) {
  std::vector<double> sizes;
  if (length <= 1e-12 * (grading.to - grading.from)) return sizes;
  double sum = 0.0;
  for (double size = grading.size * grading.growth; sum < length * (1.0 - 1e-12); size *= grading.growth) {
    sizes.push_back(size);
    sum += size;
  }
  for (double& size : sizes) size *= length / sum;
  return sizes;
}

void check_grading(const AxisGrading& grading, double min, double max, const std::string& where) {
  if (!(grading.from >= min && grading.from < grading.to && grading.to <= max)) {
    throw InputError(fmt::format("the finest part [{:g}, {:g}] is empty or leaves the box side [{:g}, {:g}]", grading.from,
                                 grading.to, min, max),
                     where, "Choose min <= from < to <= max");
  }
  if (!(grading.size > 0.0 && grading.size <= 2.0 * (grading.to - grading.from))) {
    throw InputError(fmt::format("size {:g} is not positive or too large for the finest part [{:g}, {:g}]", grading.size,
                                 grading.from, grading.to),
                     where, "Choose a size that divides to - from");
  }
  if (!(grading.growth >= 1.001 && grading.growth <= 10.0)) {
    throw InputError(fmt::format("growth {:g} is not between 1.001 and 10", grading.growth), where,
                     "Usual factors are 1.05 to 1.3");
  }
  if (!(grading.inner_growth >= 1.0 && grading.inner_growth <= 10.0)) {
    throw InputError(fmt::format("inner_growth {:g} is not between 1 and 10", grading.inner_growth), where,
                     "Usual factors are 1 (cells of one size) to 1.2");
  }
}

/// Planes of the core from its start to its end; those of cells that grow inwards mirror each other about the middle.
std::vector<double> core_planes(const AxisGrading& grading) {
  const auto cells = static_cast<Index>(cells_of_core(grading));
  const double from = grading.from, to = grading.to, q = grading.inner_growth, half = 0.5 * (to - from);
  std::vector<double> planes(cells + 1);
  for (Index i = 0; i <= cells; ++i) {
    if (q == 1.0) {
      planes[i] = from + (to - from) * i / cells;
    } else {
      const double distance = half * std::expm1(std::log(q) * std::min(i, cells - i)) / std::expm1(std::log(q) * (cells / 2));
      planes[i] = 2 * i <= cells ? from + distance : to - distance;
    }
  }
  planes.back() = to;
  return planes;
}

std::vector<double> graded_planes(const AxisGrading& grading, double min, double max) {
  const auto below = growing_sizes(grading, grading.from - min), above = growing_sizes(grading, max - grading.to);
  const auto core = core_planes(grading);
  std::vector<double> planes;
  for (double x = grading.from; const double size : below) planes.push_back(x -= size);
  std::reverse(planes.begin(), planes.end());
  planes.insert(planes.end(), core.begin(), core.end());
  for (double x = grading.to; const double size : above) planes.push_back(x += size);
  planes.front() = min;
  planes.back() = max;
  return planes;
}

std::vector<double> planes_of_axis(const BoxSpec& spec, int axis) {
  const double min = spec.min[axis], max = spec.max[axis];
  if (!(std::isfinite(min) && std::isfinite(max) && min < max)) {
    throw InputError(fmt::format("the box reaches from {:g} to {:g} along {}", min, max, kAxisNames[axis]), spec.where,
                     "Choose min below max");
  }
  if (const auto& grading = spec.grading[axis]) {
    check_grading(*grading, min, max, fmt::format("{}.grading.{}", spec.where, kAxisNames[axis]));
    return graded_planes(*grading, min, max);
  }
  const Index n = spec.cells[axis];
  if (n < 1)
    throw InputError(fmt::format("{} cells along {}", n, kAxisNames[axis]), spec.where + ".cells", "Give one cell or more");
  std::vector<double> planes(n + 1);
  for (Index i = 0; i <= n; ++i) planes[i] = (min * (n - i) + max * i) / n;  // exact at both sides and, in a symmetric box, at 0
  return planes;
}

void fix_plane(BoxLattice& lattice, const BoxSpec& spec, int axis, double coordinate) {
  auto& planes = lattice.at[axis];
  const auto nearest = std::min_element(planes.begin(), planes.end(),
                                        [&](double a, double b) { return std::abs(a - coordinate) < std::abs(b - coordinate); });
  const auto i = static_cast<std::size_t>(nearest - planes.begin());
  const double spacing = std::min(i > 0 ? planes[i] - planes[i - 1] : std::numeric_limits<double>::infinity(),
                                  i + 1 < planes.size() ? planes[i + 1] - planes[i] : std::numeric_limits<double>::infinity());
  if (std::abs(*nearest - coordinate) > 1e-6 * spacing) {
    throw InputError(
        fmt::format("the plane {} = {:g} of a fracture runs through cells; the nearest mesh plane is {} = {:g}", kAxisNames[axis],
                    coordinate, kAxisNames[axis], *nearest),
        spec.where + (spec.grading[axis] ? ".grading" : ".cells"),
        fmt::format("Change the number of cells along {} (now {}) or the box so that a mesh plane falls on the fracture",
                    kAxisNames[axis], planes.size() - 1));
  }
  lattice.fixed[axis][i] = true;
}

BoxLattice make_lattice(const BoxSpec& spec) {
  BoxLattice lattice;
  lattice.dim = spec.dim;
  lattice.at[2] = {0.0};
  double n_cells = 1.0;
  for (int axis = 0; axis < spec.dim; ++axis) {
    lattice.at[axis] = planes_of_axis(spec, axis);
    n_cells *= lattice.cells(axis);
  }
  // A tetrahedral mesh lists 72 face nodes a cube: the first array to outgrow an Index.
  if (n_cells > std::numeric_limits<Index>::max() / 72.0) {
    throw InputError(fmt::format("{:g} cells are more than one process can number", n_cells), spec.where + ".cells",
                     "Choose fewer cells");
  }
  for (int axis = 0; axis < 3; ++axis) lattice.fixed[axis].assign(lattice.at[axis].size(), false);
  for (int axis = 0; axis < spec.dim; ++axis) lattice.fixed[axis].front() = lattice.fixed[axis].back() = true;
  for (const auto& [axis, coordinate] : spec.kept_planes) fix_plane(lattice, spec, axis, coordinate);
  return lattice;
}

void tag_sides(PolyMesh& mesh, const BoxLattice& lattice, const std::string& where) {
  const std::vector<std::string> sides = lattice.dim == 2
                                             ? std::vector<std::string>{"left", "right", "bottom", "top"}
                                             : std::vector<std::string>{"left", "right", "front", "back", "bottom", "top"};
  for (int side = 0; side < 2 * lattice.dim; ++side) {
    const int axis = side / 2;
    const double at = side % 2 == 0 ? lattice.at[axis].front() : lattice.at[axis].back();
    const double tolerance = 1e-9 * (lattice.at[axis].back() - lattice.at[axis].front()) / lattice.cells(axis);
    tag_boundary(mesh, sides[side], [&](const Vec3& x) { return std::abs(x[axis] - at) <= tolerance; });
  }
  for (Index f = 0; f < mesh.n_faces(); ++f) {
    if (mesh.on_boundary(f) && mesh.face_tag[f] < 0) {
      throw InputError(fmt::format("cell {} does not match its neighbour at face {}", mesh.face_cells[f][0], f), where + ".seed",
                       "Seeds of Voronoi cells lie almost on one sphere here. Choose another seed of the random numbers");
    }
  }
}

PolyMesh make_shape(const BoxLattice& lattice, const BoxSpec& spec) {
  if (spec.shape == "triangles" || spec.shape == "tets") return make_simplices(lattice);
  if (spec.shape == "prisms") return make_prisms(lattice);
  if (spec.shape == "polygons" || spec.shape == "polyhedra") return make_voronoi(lattice, spec);
  PolyMesh mesh = make_cuboids(lattice);
  if (spec.shape == "warped" || spec.shape == "cut") shake_nodes(mesh, lattice, spec.shake, spec.seed);
  if (spec.shape == "cut") cut_warped_quads(mesh);
  return mesh;
}

}  // namespace

PolyMesh make_box(const BoxSpec& spec) {
  check_shape(spec);
  check_count(spec);
  const BoxLattice lattice = make_lattice(spec);
  PolyMesh mesh;
  try {
    mesh = make_shape(lattice, spec);
  } catch (const InputError& error) {  // of a cell that is too thin for numbers, or of the seeds
    const std::string text = error.what(), unplaced = "mesh.box: ";
    throw InputError(text.starts_with(unplaced) ? spec.where + ": " + text.substr(unplaced.size()) : text);
  }
  mesh.region_names = {"rock"};
  mesh.cell_region.assign(mesh.n_cells(), 0);
  mesh.face_tag.clear();
  tag_sides(mesh, lattice, spec.where);
  return mesh;
}

}  // namespace polyslip::mesh
