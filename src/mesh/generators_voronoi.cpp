// Voronoi polygons and polyhedra of a shaken lattice of seeds, by the voro++ library.
//
// Kept planes: where the two layers of seeds beside a plane mirror each other, the plane is the bisector of every mirror pair, so
// cells end on it and the faces of both sides coincide. A seed of the layer behind must not reach the plane: a point of the plane
// is at most sqrt(d) (1/2 + shake) from the seed of its own small box and at least 3/2 - shake from the layer behind, hence the
// largest shake below.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <voro++/voro++.hh>

#include "polyslip/common/error.hpp"
#include "polyslip/mesh/box_parts.hpp"
#include "polyslip/mesh/builder.hpp"

namespace polyslip::mesh {
namespace {

using Place = BoxLattice::Place;

/// Vertices closer than this are one, in units of the spacing. voro++ decides with 1e-11, so its cells differ by a little more than
/// that where more cells meet than must.
constexpr double kMergeDistance = 1e-9;
constexpr double kSmallestShake =
    1e-4;                        ///< Below, faces are so thin that the merge distance tears cells (measured: 1e-12 to 1e-6).
constexpr int kLowerWallZ = -5;  // voro++ numbers its walls -1 .. -6

bool has_kept_plane(const BoxLattice& lattice) {
  for (int axis = 0; axis < lattice.dim; ++axis) {
    if (std::count(lattice.fixed[axis].begin(), lattice.fixed[axis].end(), true) > 2) return true;
  }
  return false;
}

void check(const BoxLattice& lattice, const BoxSpec& spec) {
  for (int axis = 0; axis < spec.dim; ++axis) {
    if (spec.grading[axis]) {
      throw InputError(fmt::format("{} cannot be graded", spec.shape), spec.where + ".grading",
                       "Remove the grading or choose another shape");
    }
  }
  if (spec.shake > 0.0 && spec.shake < kSmallestShake) {
    throw InputError(fmt::format("{:g} moves the seeds too little to tell which Voronoi cells touch", spec.shake),
                     spec.where + ".shake", fmt::format("Choose 0 or at least {:g}", kSmallestShake));
  }
  const double root = std::sqrt(static_cast<double>(spec.dim));
  const double largest = (1.5 - 0.5 * root) / (1.0 + root);
  if (has_kept_plane(lattice) && spec.shake > largest) {
    throw InputError(fmt::format("{:g} is too much for {} that keep the planes of fractures", spec.shake, spec.shape),
                     spec.where + ".shake", fmt::format("Choose at most {:.2f}", std::floor(100.0 * largest) / 100.0));
  }
}

/// One seed a small box, in units of the spacing from the lower corner of the whole box.
std::vector<Vec3> make_seeds(const BoxLattice& lattice, double shake, std::uint64_t seed) {
  Dice dice(seed);
  std::vector<Vec3> seeds;
  seeds.reserve(lattice.n_cells());
  lattice.for_each_cell([&](const Place& p) {
    Vec3 x(p[0] + 0.5, p[1] + 0.5, p[2] + 0.5);
    for (int axis = 0; axis < lattice.dim; ++axis) x[axis] += shake * dice.roll();
    seeds.push_back(x);
  });
  // Ascending along each axis, so that a chain of neighbouring planes mirrors on and on; mirroring about a later axis keeps earlier
  // mirrors.
  const std::array stride{1, lattice.cells(0), lattice.cells(0) * lattice.cells(1)};
  for (int axis = 0; axis < lattice.dim; ++axis) {
    Index cell = 0;
    lattice.for_each_cell([&](const Place& p) {
      if (p[axis] > 0 && lattice.fixed[axis][p[axis]]) {
        seeds[cell] = seeds[cell - stride[axis]];
        seeds[cell][axis] = 2.0 * p[axis] - seeds[cell][axis];
      }
      ++cell;
    });
  }
  return seeds;
}

/// Faces of all Voronoi cells as voro++ gives them: every cell with vertices of its own.
struct LooseCells {
  std::vector<Vec3> vertices;
  Csr faces;               ///< Vertices of each face in cyclic order; in 2D one face a cell, the polygon itself.
  std::vector<Index> end;  ///< End of each cell's faces.
};

void append_cell(LooseCells& loose, voro::voronoicell_neighbor& cell, const Vec3& seed, int dim) {
  std::vector<double> x;
  std::vector<int> neighbours, loops;
  cell.vertices(seed.x(), seed.y(), seed.z(), x);
  cell.neighbors(neighbours);
  cell.face_vertices(loops);  // n, v_1 .. v_n for each face
  const auto first = static_cast<Index>(loose.vertices.size());
  for (std::size_t i = 0; i < x.size(); i += 3) loose.vertices.emplace_back(x[i], x[i + 1], dim == 2 ? 0.0 : x[i + 2]);
  std::size_t at = 0;
  for (const int neighbour : neighbours) {
    const int n = loops[at++];
    if (dim == 3 || neighbour == kLowerWallZ) {
      for (int i = 0; i < n; ++i) loose.faces.values.push_back(first + loops[at + i]);
      loose.faces.offsets.push_back(static_cast<Index>(loose.faces.values.size()));
    }
    at += n;
  }
  loose.end.push_back(loose.faces.rows());
}

LooseCells voronoi_cells(const BoxLattice& lattice, const std::vector<Vec3>& seeds) {
  const std::array n{lattice.cells(0), lattice.cells(1), lattice.cells(2)};
  const auto blocks = [&](int axis) { return std::max(1, n[axis] / 2); };  // about eight seeds each
  voro::container container(0, n[0], 0, n[1], 0, n[2], blocks(0), blocks(1), blocks(2), false, false, false, 8);
  voro::particle_order order(lattice.n_cells());
  for (std::size_t i = 0; i < seeds.size(); ++i)
    container.put(order, static_cast<int>(i), seeds[i].x(), seeds[i].y(), seeds[i].z());

  LooseCells loose;
  voro::c_loop_order loop(container, order);
  voro::voronoicell_neighbor cell;
  if (loop.start()) do {
      if (container.compute_cell(cell, loop)) append_cell(loose, cell, seeds[loop.pid()], lattice.dim);
    } while (loop.inc());
  return loose;
}

/// Values along one axis in classes: neighbours in ascending order share a class if they are closer than the merge distance.
std::vector<Index> classes_along(const std::vector<Vec3>& x, int axis) {
  std::vector<std::pair<double, Index>> sorted;  // values beside their places: sorting places alone takes twice as long
  sorted.reserve(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) sorted.emplace_back(x[i][axis], static_cast<Index>(i));
  std::sort(sorted.begin(), sorted.end());
  std::vector<Index> result(x.size());
  Index current = 0;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    if (i > 0 && sorted[i].first - sorted[i - 1].first > kMergeDistance) ++current;
    result[sorted[i].second] = current;
  }
  return result;
}

/// For each vertex the first one at the same place: in the same class along every axis.
std::vector<Index> first_at_same_place(const std::vector<Vec3>& x) {
  const std::array classes{classes_along(x, 0), classes_along(x, 1), classes_along(x, 2)};
  std::vector<std::array<Index, 4>> sorted;
  sorted.reserve(x.size());
  for (Index i = 0; i < static_cast<Index>(x.size()); ++i) sorted.push_back({classes[2][i], classes[1][i], classes[0][i], i});
  std::sort(sorted.begin(), sorted.end());
  std::vector<Index> first(x.size());
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const bool same = i > 0 && std::equal(sorted[i].begin(), sorted[i].begin() + 3, sorted[i - 1].begin());
    first[sorted[i][3]] = same ? first[sorted[i - 1][3]] : sorted[i][3];
  }
  return first;
}

/// From units of the spacing to metres; vertices on fixed planes exactly onto them.
Vec3 to_box(const BoxLattice& lattice, const Vec3& x) {
  Vec3 result = Vec3::Zero();
  for (int axis = 0; axis < lattice.dim; ++axis) {
    const auto& at = lattice.at[axis];
    const auto plane = static_cast<Index>(std::lround(x[axis]));
    const bool on_plane = lattice.fixed[axis][plane] && std::abs(x[axis] - plane) <= kMergeDistance;
    result[axis] = on_plane ? at[plane] : at.front() + (at.back() - at.front()) * x[axis] / lattice.cells(axis);
  }
  return result;
}

/// The loop without vertices that repeat their predecessor (cyclically); faces thinner than the merge distance shrink to two nodes
/// or fewer.
void drop_repeated(std::vector<Index>& loop) {
  loop.erase(std::unique(loop.begin(), loop.end()), loop.end());
  while (loop.size() > 1 && loop.front() == loop.back()) loop.pop_back();
}

PolyMesh join_cells(const BoxLattice& lattice, const LooseCells& loose, const std::string& where) {
  const std::vector<Index> first = first_at_same_place(loose.vertices);
  std::vector<Index> node(loose.vertices.size());
  std::vector<Vec3> nodes;
  for (std::size_t i = 0; i < node.size(); ++i) {
    const bool is_new = first[i] == static_cast<Index>(i);
    node[i] = is_new ? static_cast<Index>(nodes.size()) : node[first[i]];
    if (is_new) nodes.push_back(to_box(lattice, loose.vertices[i]));
  }

  MeshBuilder builder(lattice.dim, std::move(nodes), where);
  std::vector<Index> loop;
  Index face = 0;
  for (const Index end : loose.end) {
    if (lattice.dim == 3) builder.add_cell();
    for (; face < end; ++face) {
      loop.clear();
      for (const Index i : loose.faces[face]) loop.push_back(node[i]);
      drop_repeated(loop);
      if (loop.size() < 3) continue;
      if (lattice.dim == 3) {
        builder.add_face(loop);
      } else {
        builder.add_polygon(loop);
      }
    }
  }
  return builder.build();
}

}  // namespace

PolyMesh make_voronoi(const BoxLattice& lattice, const BoxSpec& spec) {
  check(lattice, spec);
  const std::vector<Vec3> seeds = make_seeds(lattice, spec.shake, spec.seed);
  const LooseCells loose = voronoi_cells(lattice, seeds);
  try {
    return join_cells(lattice, loose, spec.where);
  } catch (const InputError& error) {
    throw InputError(
        fmt::format("seed {} puts points almost on one sphere, where Voronoi cells are not unique ({})", spec.seed, error.what()),
        spec.where + ".seed", "Choose another seed of the random numbers");
  }
}

}  // namespace polyslip::mesh
