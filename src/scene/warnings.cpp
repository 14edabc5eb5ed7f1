#include "polyslip/scene/warnings.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <limits>

#include "polyslip/common/error.hpp"
#include "polyslip/spaces/cell_shape.hpp"

namespace polyslip::scene {

namespace {

/// What is measured of a cell, in the order of `measures`.
enum Kind : std::size_t { flatness, small_face, warp, incompressibility, undrained_without_bubbles, anisotropy, undrained_tet, contrast, kinds };

/// A measure of cells that ought to stay below a limit.
struct Measure {
  double limit;
  const char* what;  ///< Of the worst cell, its measure in it.
  const char* consequence;
};

/// Limits by scripts/stress: the families that hold beyond them do so on simpler cells only.
constexpr std::array<Measure, kinds> measures{{
    {1e4, "is as flat or long as an aspect ratio of {:.2g}",
     "Results may lose digits and multigrid may need many iterations; shape the cells more evenly, or choose -displacement_pc_type lu"},
    {1e5, "has a face or edge {:.2g} times smaller than itself",
     "Results may lose digits there; join nodes that are this near to each other"},
    {0.2, "has a face whose nodes lie {:.2g} of its size off its plane",
     "Use smaller cells there, or cut the face into triangles"},
    {0.48, "is nearly incompressible, nu = {:.6g}",
     "Triangles and tets lock, and stresses of other cells may oscillate; set mechanics.bubbles: all"},
    {1e2, "stores or passes on {:.2g} times less fluid in the first step than its pores give way",
     "Pressures may oscillate from cell to cell; set mechanics.bubbles: all, or take longer steps or smaller cells"},
    {5e2, "is anisotropic: one permeability is {:.2g} times another",
     "Pressures of triangles and tets may be wrong where the flow along the larger one must balance; use quads, hexahedra or polygons, or "
     "cells along it"},
    {1e2, "is a tet that stores or passes on {:.2g} times less fluid in the first step than its pores give way",
     "Pressures of undrained tets are rough even with bubbles on all faces; use hexahedra or smaller cells, or take longer steps"},
    {1e10, "is {:.2g} times more permeable than a cell beside it",
     "Fluxes inside of it lose as many digits; pressures, and what flows in and out, do not. Raise the smaller permeability if these fluxes count"},
}};

using Values = std::array<double, kinds>;

double poisson(const physics::Lame& lame) { return lame.lambda / (2 * (lame.lambda + lame.mu)); }

/// b^2/(2 mu + lambda) over 1/M + dt K_m/(eta h^2).
double undrained_ratio(const Scene& scene, const Model& model, Index cell, double h) {
  const physics::Lame& lame = model.mechanics()->moduli()[cell];
  const physics::HydraulicProperties& rock = model.flow()->rock()[cell];
  const int dim = model.mesh().mesh.dim;
  const double mobility = rock.permeability.topLeftCorner(dim, dim).trace() / dim / scene.flow->viscosity;
  return rock.biot * rock.biot / ((2 * lame.mu + lame.lambda) * (rock.inverse_modulus + scene.time.step * mobility / (h * h)));
}

/// Largest permeability over the smallest one.
double anisotropy_of(const Model& model, Index cell) {
  const int dim = model.mesh().mesh.dim;
  const Eigen::MatrixXd permeability = model.flow()->rock()[cell].permeability.topLeftCorner(dim, dim);
  const Eigen::VectorXd values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(permeability, Eigen::EigenvaluesOnly).eigenvalues();
  return values[dim - 1] / values[0];
}

/// Permeability over that of its least permeable neighbour.
double contrast_of(const Model& model, Index cell) {
  const mesh::PolyMesh& mesh = model.mesh().mesh;
  const auto permeability = [&](Index c) { return model.flow()->rock()[c].permeability.topLeftCorner(mesh.dim, mesh.dim).trace(); };
  double least = permeability(cell);
  for (const Index face : mesh.cell_faces[cell])
    for (const Index neighbour : mesh.face_cells[face])
      if (neighbour >= 0) least = std::min(least, permeability(neighbour));
  return permeability(cell) / least;
}

Values measure(const Scene& scene, const Model& model, spaces::ShapeMeter& meter, Index cell) {
  const mesh::PolyMesh& mesh = model.mesh().mesh;
  const spaces::CellShape shape = meter.measure(cell);
  Values values{};
  values[flatness] = shape.flatness;
  values[small_face] = 1 / shape.smallest_face;
  values[warp] = shape.warp;
  if (model.flow()) {
    values[anisotropy] = anisotropy_of(model, cell);
    values[contrast] = contrast_of(model, cell);
  }
  if (!model.mechanics()) return values;
  const bool stable = scene.mechanics.bubbles == spaces::Bubbles::all, tet = mesh.dim == 3 && mesh.cell_faces.row_size(cell) == 4;
  if (!stable) values[incompressibility] = poisson(model.mechanics()->moduli()[cell]);
  if (model.flow() && (!stable || tet))
    values[stable ? undrained_tet : undrained_without_bubbles] = undrained_ratio(scene, model, cell, meter.diameter());
  return values;
}

/// The worst owned cell by each measure.
struct Worst {
  Values values{};
  std::array<Index, kinds> cells{};
};

Worst worst_here(const Scene& scene, const Model& model) {
  Worst worst;
  worst.values.fill(-std::numeric_limits<double>::infinity());
  spaces::ShapeMeter meter(model.mesh().mesh);
  for (Index cell = 0; cell < model.mesh().cells.owned; ++cell) {
    const Values values = measure(scene, model, meter, cell);
    for (std::size_t i = 0; i < values.size(); ++i)
      if (values[i] > worst.values[i]) {
        worst.values[i] = values[i];
        worst.cells[i] = cell;
      }
  }
  return worst;
}

/// Its number in the serial mesh, and the average of its nodes; of the lowest number where ranks tie.
std::pair<long long, Vec3> place_of(const mesh::DistributedMesh& mesh, bool is_here, Index cell) {
  const double none = std::numeric_limits<double>::infinity(), mine = is_here ? mesh.cell_input[cell] : none;
  const double number = mpi::min(mesh.comm, mine);
  Vec3 at = Vec3::Zero();
  if (mine == number) at = mesh::cell_node_average(mesh.mesh, cell);
  mpi::sum_in_place(mesh.comm, std::span<double>(at.data(), 3));
  return {static_cast<long long>(number), at};
}

void warn_of_cells(const Log& log, const Scene& scene, const Model& model) {
  const mesh::DistributedMesh& mesh = model.mesh();
  const Worst worst = worst_here(scene, model);
  for (std::size_t i = 0; i < measures.size(); ++i) {
    const double value = mpi::max(mesh.comm, worst.values[i]);
    if (!(value > measures[i].limit)) continue;
    const auto [number, at] = place_of(mesh, worst.values[i] == value, worst.cells[i]);
    log.line("warning: cell {} about ({:.4g}, {:.4g}, {:.4g}) {}. {}", number, at.x(), at.y(), at.z(),
             fmt::format(fmt::runtime(measures[i].what), value), measures[i].consequence);
  }
}

void warn_of_blocks(const Log& log, const Scene& scene, const assembly::FloatingBlocks& floating) {
  if (const auto motion = floating.unstoppable_motion())
    throw InputError(*motion + ", whatever the fractures do", scene.path.string() + " (mechanics.boundary)",
                     "Prescribe displacements that hold it; two directions on one side also stop it from turning");
  const auto& blocks = floating.blocks();
  if (blocks.empty()) return;
  log.line("warning: no prescribed displacement holds {}{}: contact alone does. Where it slips or opens all round, the step fails; "
           "hold it in mechanics.boundary, or raise contact.friction",
           assembly::FloatingBlocks::text(blocks.front()), blocks.size() > 1 ? fmt::format(", nor {} other blocks", blocks.size() - 1) : "");
  if (!floating.are_watched())
    log.line("warning: these blocks are too many to be watched: displacements far larger than the domain mean that one moved freely");
}

}  // namespace

void report_warnings(const Log& log, const Scene& scene, const Model& model) {
  warn_of_cells(log, scene, model);
  if (model.newton()) warn_of_blocks(log, scene, model.newton()->floating_blocks());
}

}  // namespace polyslip::scene
