// A plain box grid with fractures marked by a predicate, built without the generators: reference for the tests of distribution and
// files.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "polyslip/mesh/poly_mesh.hpp"

namespace polyslip::mesh {

/// True where the face with this centre and normal axis lies on a fracture.
using FractureMark = std::function<bool(const Vec3& centre, int axis)>;

/// Unit box of n[0] x n[1] (x n[2]) cells; in 2D n[2] is ignored. Fractures are marked inside only, their + side is the lower cell;
/// copies are built. Two regions (split in the middle of x) and the tags "low" and "high" on the sides of x, so that every field
/// has something to carry.
inline PolyMesh grid(int dim, std::array<Index, 3> n, const FractureMark& marked = {}) {
  PolyMesh mesh;
  mesh.dim = dim;
  if (dim == 2) n[2] = 1;
  const std::array<Index, 3> m{n[0] + 1, n[1] + 1, dim == 3 ? n[2] + 1 : 1};
  const auto node = [&](std::array<Index, 3> i) { return i[0] + m[0] * (i[1] + m[1] * i[2]); };
  const auto cell = [&](std::array<Index, 3> i) { return i[0] + n[0] * (i[1] + n[1] * i[2]); };
  for (Index k = 0; k < m[2]; ++k) {
    for (Index j = 0; j < m[1]; ++j) {
      for (Index i = 0; i < m[0]; ++i)
        mesh.nodes.emplace_back(double(i) / n[0], double(j) / n[1], dim == 3 ? double(k) / n[2] : 0.0);
    }
  }
  std::vector<std::vector<Index>> faces_of(static_cast<std::size_t>(n[0]) * n[1] * n[2]);
  mesh.region_names = {"left rock", "right rock"};
  mesh.tag_names = {"low", "high"};
  for (int a = 0; a < dim; ++a) {
    const int b = (a + 1) % dim, c = (a + 2) % 3;
    std::array<Index, 3> count = n;
    ++count[a];
    for (Index k = 0; k < count[2]; ++k) {
      for (Index j = 0; j < count[1]; ++j) {
        for (Index i = 0; i < count[0]; ++i) {
          const std::array<Index, 3> at{i, j, k};
          std::vector<Index> corners;
          const auto corner = [&](Index db, Index dc) {
            auto p = at;
            p[b] += db;
            if (dim == 3) p[c] += dc;
            return node(p);
          };
          if (dim == 3)
            corners = {corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)};
          else
            corners = a == 0 ? std::vector<Index>{corner(0, 0), corner(1, 0)} : std::vector<Index>{corner(1, 0), corner(0, 0)};
          Vec3 centre = Vec3::Zero();
          for (const Index s : corners) centre += mesh.nodes[s] / double(corners.size());
          auto lower = at;
          --lower[a];
          std::array<Index, 2> sides{at[a] > 0 ? cell(lower) : -1, at[a] < n[a] ? cell(at) : -1};
          if (sides[0] < 0) {
            std::swap(sides[0], sides[1]);
            std::reverse(corners.begin(), corners.end());
          }
          const Index face = mesh.n_faces();
          mesh.face_nodes.push_row(corners);
          mesh.face_cells.push_back(sides);
          for (const Index side : sides) {
            if (side >= 0) faces_of[side].push_back(face);
          }
          const bool boundary = sides[1] < 0;
          mesh.face_tag.push_back(a == 0 && boundary ? (at[a] == 0 ? 0 : 1) : -1);
          const bool fracture = marked && !boundary && marked(centre, a);
          mesh.face_fracture.push_back(fracture ? a : -1);
          mesh.face_tip_distance.push_back(fracture ? centre[b] : 0);
        }
      }
    }
  }
  for (const auto& faces : faces_of) {
    const Index number = mesh.n_cells();
    mesh.cell_faces.push_row(faces);
    mesh.cell_region.push_back(2 * (number % n[0]) < n[0] ? 0 : 1);
  }
  if (marked) {
    mesh.fracture_names = {"across x", "across y", "across z"};
    mesh.fracture_length = {1, 0.5, std::numeric_limits<double>::infinity()};
  } else {
    mesh.face_fracture.clear();
    mesh.face_tip_distance.clear();
  }
  build_copies(mesh);
  return mesh;
}

/// Two fractures that cross in the middle, one of them with a tip inside.
inline FractureMark crossing() {
  return [](const Vec3& x, int axis) {
    return (axis == 0 && std::abs(x[0] - 0.5) < 1e-9) || (axis == 1 && std::abs(x[1] - 0.5) < 1e-9 && x[0] < 0.75);
  };
}

}  // namespace polyslip::mesh
