// Box meshes that follow the lattice: quads, hexahedra, triangles, tetrahedra, prisms, and hexahedra with shaken nodes.
#include <algorithm>
#include <numeric>

#include "polyslip/mesh/box_parts.hpp"
#include "polyslip/mesh/builder.hpp"

namespace polyslip::mesh {
namespace {

using Place = BoxLattice::Place;

Place unit(int axis) {
  Place e{0, 0, 0};
  e[axis] = 1;
  return e;
}

Place sum(const Place& a, const Place& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }

/// Face of the lattice at the lower corner p, its normal along +axis; returns the number of nodes.
std::size_t lattice_face(const BoxLattice& lattice, const Place& p, int axis, std::array<Index, 4>& nodes) {
  if (lattice.dim == 2) {
    nodes[axis] = lattice.node(p);
    nodes[1 - axis] = lattice.node(p, unit(1 - axis));
    return 2;
  }
  const Place e = unit((axis + 1) % 3), g = unit((axis + 2) % 3);
  nodes = {lattice.node(p), lattice.node(p, e), lattice.node(p, sum(e, g)), lattice.node(p, g)};
  return 4;
}

/// Numbers the faces of the small boxes directly: each box brings its lower face along each axis, the last ones also their upper
/// faces.
class CuboidMesher {
 public:
  explicit CuboidMesher(const BoxLattice& lattice)
      : lattice_(lattice), stride_{1, lattice.cells(0), lattice.cells(0) * lattice.cells(1)} {
    mesh_.dim = lattice.dim;
    mesh_.nodes = lattice.nodes();
    first_face_.reserve(lattice.n_cells());
    const auto n_faces = static_cast<std::size_t>(lattice.dim) * mesh_.nodes.size();  // a little too many
    mesh_.face_cells.reserve(n_faces);
    mesh_.face_nodes.offsets.reserve(n_faces + 1);
    mesh_.face_nodes.values.reserve(n_faces * (lattice.dim == 2 ? 2 : 4));
    mesh_.cell_faces.offsets.reserve(lattice.n_cells() + 1);
    mesh_.cell_faces.values.reserve(static_cast<std::size_t>(2 * lattice.dim) * lattice.n_cells());
  }

  PolyMesh run() {
    Index cell = 0;
    lattice_.for_each_cell([&](const Place& p) { add_faces(p, cell++); });
    cell = 0;
    lattice_.for_each_cell([&](const Place& p) { add_cell(p, cell++); });
    return std::move(mesh_);
  }

 private:
  [[nodiscard]] bool last(const Place& p, int axis) const { return p[axis] + 1 == lattice_.cells(axis); }

  void add_face(const Place& p, int axis, std::array<Index, 2> cells, bool downwards) {
    std::array<Index, 4> nodes{};
    const std::size_t n = lattice_face(lattice_, p, axis, nodes);
    if (downwards) std::reverse(nodes.begin(), nodes.begin() + n);
    mesh_.face_nodes.push_row(std::span(nodes).first(n));
    mesh_.face_cells.push_back(cells);
  }

  void add_faces(const Place& p, Index cell) {
    first_face_.push_back(mesh_.n_faces());
    for (int axis = 0; axis < lattice_.dim; ++axis) {
      const bool at_side = p[axis] == 0;
      add_face(p, axis, at_side ? std::array{cell, -1} : std::array{cell - stride_[axis], cell}, at_side);
    }
    for (int axis = 0; axis < lattice_.dim; ++axis) {
      if (last(p, axis)) add_face(sum(p, unit(axis)), axis, {cell, -1}, false);
    }
  }

  void add_cell(const Place& p, Index cell) {
    auto& faces = mesh_.cell_faces.values;
    Index at_side = first_face_[cell] + lattice_.dim;
    for (int axis = 0; axis < lattice_.dim; ++axis) {
      faces.push_back(first_face_[cell] + axis);
      faces.push_back(last(p, axis) ? at_side++ : first_face_[cell + stride_[axis]] + axis);
    }
    mesh_.cell_faces.offsets.push_back(static_cast<Index>(faces.size()));
  }

  const BoxLattice& lattice_;
  std::array<Index, 3> stride_;
  std::vector<Index> first_face_;
  PolyMesh mesh_;
};

/// Nodes of Kuhn's simplex in the small box at p: from the lower to the upper corner, along the axes in the given order.
std::array<Index, 4> kuhn_path(const BoxLattice& lattice, const Place& p, const std::array<int, 3>& axes) {
  std::array<Index, 4> nodes{lattice.node(p)};
  Place up{0, 0, 0};
  for (int step = 0; step < lattice.dim; ++step) {
    up[axes[step]] = 1;
    nodes[step + 1] = lattice.node(p, up);
  }
  return nodes;
}

void add_tetrahedron(MeshBuilder& builder, const std::array<Index, 4>& s) {
  builder.add_cell();
  builder.add_face(std::array{s[0], s[1], s[2]});
  builder.add_face(std::array{s[0], s[1], s[3]});
  builder.add_face(std::array{s[0], s[2], s[3]});
  builder.add_face(std::array{s[1], s[2], s[3]});
}

}  // namespace

std::vector<Vec3> BoxLattice::nodes() const {
  std::vector<Vec3> result;
  result.reserve(at[0].size() * at[1].size() * at[2].size());
  for (const double z : at[2]) {
    for (const double y : at[1]) {
      for (const double x : at[0]) result.emplace_back(x, y, z);
    }
  }
  return result;
}

PolyMesh make_cuboids(const BoxLattice& lattice) { return CuboidMesher(lattice).run(); }

PolyMesh make_simplices(const BoxLattice& lattice) {
  MeshBuilder builder(lattice.dim, lattice.nodes(), "mesh.box");
  const std::size_t n = lattice.n_cells();
  lattice.dim == 2 ? builder.reserve(2 * n, 6 * n, 12 * n) : builder.reserve(6 * n, 24 * n, 72 * n);
  lattice.for_each_cell([&](const Place& p) {
    std::array axes{0, 1, 2};
    do {
      const auto path = kuhn_path(lattice, p, axes);
      if (lattice.dim == 3) {
        add_tetrahedron(builder, path);
      } else {
        builder.add_polygon(std::span(path).first(3));
      }
    } while (std::next_permutation(axes.begin(), axes.begin() + lattice.dim));
  });
  return builder.build();
}

PolyMesh make_prisms(const BoxLattice& lattice) {
  MeshBuilder builder(3, lattice.nodes(), "mesh.box");
  const std::size_t n = lattice.n_cells();
  builder.reserve(2 * n, 10 * n, 36 * n);
  const Index layer = lattice.node({0, 0, 1});
  lattice.for_each_cell([&](const Place& p) {
    for (const bool x_first : {true, false}) {
      const std::array s{lattice.node(p), lattice.node(p, x_first ? Place{1, 0, 0} : Place{0, 1, 0}), lattice.node(p, {1, 1, 0})};
      builder.add_cell();
      builder.add_face(s);
      builder.add_face(std::array{s[0] + layer, s[1] + layer, s[2] + layer});
      for (int i = 0; i < 3; ++i) {
        const Index a = s[i], b = s[(i + 1) % 3];
        builder.add_face(std::array{a, b, b + layer, a + layer});
      }
    }
  });
  return builder.build();
}

void shake_nodes(PolyMesh& mesh, const BoxLattice& lattice, double shake, std::uint64_t seed) {
  std::array<std::vector<double>, 3> spacing;  // the smaller one beside each plane
  for (int axis = 0; axis < lattice.dim; ++axis) {
    const auto& at = lattice.at[axis];
    for (std::size_t i = 0; i < at.size(); ++i) {
      const double below = i > 0 ? at[i] - at[i - 1] : at[1] - at[0];
      spacing[axis].push_back(i + 1 < at.size() ? std::min(below, at[i + 1] - at[i]) : below);
    }
  }
  Dice dice(seed);
  Index node = 0;
  Place p{};
  for (p[2] = 0; p[2] < static_cast<Index>(lattice.at[2].size()); ++p[2]) {
    for (p[1] = 0; p[1] < static_cast<Index>(lattice.at[1].size()); ++p[1]) {
      for (p[0] = 0; p[0] < static_cast<Index>(lattice.at[0].size()); ++p[0], ++node) {
        double smallest = spacing[0][p[0]];
        for (int axis = 1; axis < lattice.dim; ++axis) smallest = std::min(smallest, spacing[axis][p[axis]]);
        for (int axis = 0; axis < lattice.dim; ++axis) {
          const double move =
              shake * smallest * dice.roll();  // rolled for fixed nodes too: the others' moves do not depend on kept planes
          if (!lattice.fixed[axis][p[axis]]) mesh.nodes[node][axis] += move;
        }
      }
    }
  }
}

}  // namespace polyslip::mesh
