#include "polyslip/scene/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "polyslip/common/error.hpp"
#include "polyslip/scene/checks.hpp"
#include "polyslip/scene/document.hpp"
#include "polyslip/scene/flow.hpp"

namespace polyslip::scene {

namespace {

constexpr std::array<const char*, 3> axis_names{"x", "y", "z"};

mesh::BoxSpec read_box(const Cursor& box) {
  mesh::BoxSpec spec;
  const Vec3 low = box["min"].point(), high = box["max"].point(), cells = box["cells"].point();
  spec.dim = static_cast<int>(box["min"].entries().size());
  for (std::size_t i = 0; i < static_cast<std::size_t>(spec.dim); ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    spec.min[i] = low[axis];
    spec.max[i] = high[axis];
    spec.cells[i] = static_cast<Index>(cells[axis]);
    if (const Cursor grading = box["grading"][axis_names[i]]) {
      const Vec3 core = grading["core"].point();
      spec.grading[i] = {.from = core[0],
                         .to = core[1],
                         .size = grading["size"].number(),
                         .growth = grading["growth"].number(),
                         .inner_growth = grading["inner_growth"].number()};
    }
  }
  spec.shape = box["shape"].text();
  spec.shake = box["shake"].number();
  spec.seed = static_cast<std::uint64_t>(box["seed"].number());
  spec.where = box.place() + ", mesh.box";  // The mesh module appends the key that it means.
  return spec;
}

MeshSource read_mesh_source(const Cursor& mesh) {
  MeshSource source;
  if (mesh["box"]) source.box = read_box(mesh["box"]);
  source.file = mesh["file"].text();
  source.write = mesh["write"].text();
  source.place = (mesh["box"] ? mesh["box"] : mesh["file"]).where();
  return source;
}

std::vector<mesh::FractureGeometry> read_fractures(const Cursor& list) {
  std::vector<mesh::FractureGeometry> fractures;
  for (const Cursor& entry : list.entries()) {
    mesh::FractureGeometry fracture{
        .name = entry["name"].text(), .where = entry.where(), .group = entry["group"].text(), .points = {}};
    for (const Cursor& point : entry["points"].entries()) fracture.points.push_back(point.point());
    fractures.push_back(std::move(fracture));
  }
  return fractures;
}

/// Keeps the plane x_axis = c if it cuts the inside of the box.
void keep_plane(mesh::BoxSpec& box, int axis, double c) {
  const auto i = static_cast<std::size_t>(axis);
  const double slack = 1e-12 * (box.max[i] - box.min[i]);
  const auto is_same = [&](const auto& plane) { return plane.first == axis && std::abs(plane.second - c) <= slack; };
  const bool inside = c > box.min[i] + slack && c < box.max[i] - slack;
  if (inside && std::ranges::none_of(box.kept_planes, is_same)) box.kept_planes.emplace_back(axis, c);
}

/// Keeps the plane of an axis-aligned piece, and the planes through its ends (edges), so that these too lie on faces.
void keep_piece(mesh::BoxSpec& box, std::span<const Vec3> points) {
  Vec3 low = points[0], high = points[0];
  for (const Vec3& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  const auto is_flat = [&](int axis) {
    const auto i = static_cast<std::size_t>(axis);
    return high[axis] - low[axis] <= 1e-12 * (box.max[i] - box.min[i]);
  };
  bool aligned = false;
  for (int axis = 0; axis < box.dim; ++axis) aligned = aligned || is_flat(axis);
  if (!aligned) return;
  for (int axis = 0; axis < box.dim; ++axis) {
    keep_plane(box, axis, low[axis]);
    keep_plane(box, axis, high[axis]);
  }
}

void keep_fracture_planes(mesh::BoxSpec& box, const std::vector<mesh::FractureGeometry>& fractures) {
  for (const auto& fracture : fractures) {
    const std::span<const Vec3> points = fracture.points;
    if (box.dim == 3)
      keep_piece(box, points);
    else
      for (std::size_t i = 1; i < points.size(); ++i) keep_piece(box, points.subspan(i - 1, 2));
  }
}

physics::ElasticRule read_material(const Cursor& entry) {
  const bool lame = static_cast<bool>(entry["lame_mu"]);
  return {.region = entry["region"].text(),
          .where = entry["where"].optional_expression(),
          .pair = lame ? physics::ElasticRule::Pair::lame : physics::ElasticRule::Pair::young_poisson,
          .first = entry[lame ? "lame_mu" : "young"].expression(),
          .second = entry[lame ? "lame_lambda" : "poisson"].expression(),
          .place = entry.where()};
}

/// One rule a tag.
void read_boundary_rule(const Cursor& entry, std::vector<physics::BoundaryRule>& rules) {
  for (const Cursor& on : entry["on"].entries())
    rules.push_back({.tag = on.text(),
                     .displacement = entry["displacement"].optional_expressions(),
                     .traction = entry["traction"].optional_expressions(),
                     .pressure = entry["pressure"].optional_expression(),
                     .place = on.where()});
}

physics::FrictionLaw law_of(const std::string& text) {
  if (text == "frictionless") return physics::FrictionLaw::frictionless;
  return text == "tresca" ? physics::FrictionLaw::tresca : physics::FrictionLaw::coulomb;
}

/// The rule of all fractures, where it is complete, then one for each fracture that differs.
std::vector<physics::ContactRule> read_contact(const Cursor& contact) {
  std::vector<physics::ContactRule> rules;
  if (!contact) return rules;
  physics::ContactRule common{.fracture = "",
                              .law = law_of(contact["law"].text()),
                              .friction = contact["friction"].optional_expression().value_or(Expression()),
                              .fracture_pressure = contact["fracture_pressure"].expression(),
                              .place = contact.where()};
  if (contact["friction"] || common.law == physics::FrictionLaw::frictionless) rules.push_back(common);
  for (const Cursor& entry : contact["fractures"].entries()) {
    physics::ContactRule rule = common;
    rule.fracture = entry["name"].text();
    rule.place = entry.where();
    if (entry["law"]) rule.law = law_of(entry["law"].text());
    if (entry["friction"]) rule.friction = entry["friction"].expression();
    if (entry["fracture_pressure"]) rule.fracture_pressure = entry["fracture_pressure"].expression();
    rules.push_back(std::move(rule));
  }
  return rules;
}

std::optional<std::array<Expression, 6>> read_stress(const Cursor& stress) {
  if (!stress) return std::nullopt;
  const auto component = [&](const char* key) { return stress[key].expression(); };
  return std::array{component("xx"), component("yy"), component("zz"), component("xy"), component("yz"), component("xz")};
}

physics::Stabilisation read_stabilisation(const std::string& factor) {
  using enum physics::Stabilisation;
  return factor == "mu" ? mu : factor == "2mu" ? two_mu : two_mu_lambda;
}

physics::MechanicsProblem read_mechanics(const Cursor& root) {
  const Cursor mechanics = root["mechanics"], contact = root["contact"];
  physics::MechanicsProblem problem;
  if (!mechanics) return problem;
  for (const Cursor& entry : root["materials"].entries())
    if (entry["young"] || entry["lame_mu"]) problem.materials.push_back(read_material(entry));
  for (const Cursor& entry : mechanics["boundary"].entries()) read_boundary_rule(entry, problem.boundary);
  problem.body_force = mechanics["body_force"].expressions();
  problem.stabilisation = read_stabilisation(mechanics["stabilisation"].text());
  problem.bubbles = mechanics["bubbles"].text() == "all" ? spaces::Bubbles::all : spaces::Bubbles::fracture;
  problem.initial_stress = read_stress(root["initial"]["stress"]);
  problem.contact = read_contact(contact);
  if (contact) {
    problem.formulation =
        contact["formulation"].text() == "saddle" ? physics::Formulation::saddle : physics::Formulation::condensed;
    problem.beta_scale = contact["beta_scale"].number();
  }
  return problem;
}

physics::TimeSpan read_time(const Cursor& time) {
  physics::TimeSpan span{.start = time["start"].number(),
                         .end = time["end"].number(),
                         .step = time["step"].number(),
                         .smallest_step = time["smallest_step"].number(),
                         .largest_step = time["largest_step"].number()};
  for (const Cursor& output : time["outputs"].entries()) span.outputs.push_back(output.number());
  return span;
}

Output read_output(const Cursor& output) {
  Output result;
  result.checkpoint_every = static_cast<int>(output["checkpoint_every"].number());
  result.every = static_cast<int>(output["every"].number());
  for (const Cursor& probe : output["probes"].entries())
    result.probes.push_back({.name = probe["name"].text(), .at = probe["at"].point(), .place = probe.where()});
  for (const Cursor& window : output["windows"].entries())
    result.windows.push_back({.name = window["name"].text(),
                              .rule = {.fracture = window["fracture"].text(), .where = window["where"].optional_expression()},
                              .place = window.where()});
  for (const Cursor& line : output["lines"].entries())
    result.lines.push_back({.name = line["name"].text(),
                            .from = line["from"].point(),
                            .to = line["to"].point(),
                            .points = static_cast<int>(line["points"].number()),
                            .place = line.where()});
  return result;
}

std::optional<physics::ExactSolution> read_exact(const Cursor& exact) {
  const bool mechanical =
      std::ranges::any_of(exact.keys(), [](const std::string& key) { return key != "pressure" && key != "flux"; });
  if (!mechanical) return std::nullopt;
  physics::ExactSolution solution;
  const auto vector = [&](const char* key) { return exact[key] ? std::optional(exact[key].expressions()) : std::nullopt; };
  solution.displacement = vector("displacement");
  if (exact["gradient"]) {
    solution.gradient.emplace();
    const std::vector<Cursor> rows = exact["gradient"].entries();
    for (std::size_t i = 0; i < rows.size(); ++i) (*solution.gradient)[i] = rows[i].expressions();
  }
  solution.multiplier_normal = exact["multiplier_normal"].optional_expression();
  solution.multiplier_tangential = vector("multiplier_tangential");
  solution.jump_normal = exact["jump_normal"].optional_expression();
  solution.jump_tangential = vector("jump_tangential");
  solution.faces = exact["faces"].optional_expression();
  return solution;
}

Scene read_scene(const Document& document, const std::filesystem::path& file) {
  const Cursor root(document);
  Scene scene;
  scene.name = root["name"].text();
  scene.description = root["description"].text();
  scene.path = file;
  scene.study = document.numbers;
  scene.dim = document.dim;
  scene.dim_place = document.dim_place;
  scene.mesh = read_mesh_source(root["mesh"]);
  scene.fractures = read_fractures(root["fractures"]);
  if (scene.mesh.box) keep_fracture_planes(*scene.mesh.box, scene.fractures);
  scene.has_mechanics = static_cast<bool>(root["mechanics"]);
  scene.mechanics = read_mechanics(root);
  scene.flow = read_flow(root);
  scene.initial.equilibrium = root["initial"]["equilibrium"].is_true();
  scene.time = read_time(root["time"]);
  scene.output = read_output(root["output"]);
  scene.exact = read_exact(root["exact"]);
  scene.exact_flow = read_exact_flow(root["exact"]);
  scene.warnings = document.warnings;
  scene.resolved = emit_yaml(document.root);
  return scene;
}

}  // namespace

std::string read_scene_text(const std::filesystem::path& file) {
  std::error_code unreadable;
  if (std::filesystem::is_directory(file, unreadable))
    throw InputError("this is a folder", file.string(), fmt::format("Name the scene: {}", (file / "scene.yaml").string()));
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  if (!in || !(text << in.rdbuf()))
    throw InputError("the scene cannot be read, or is empty", file.string(), "Check its name and permissions");
  return text.str();
}

Scene parse_scene(const std::string& text, const std::filesystem::path& file, const std::vector<std::string>& overrides) {
  Value tree = parse_yaml(text, file.string());
  for (const std::string& argument : overrides) apply_override(tree, argument);
  const Document document = complete(std::move(tree), file);
  check_document(Cursor(document));
  Scene scene = read_scene(document, file);
  if (scene.mesh.box) check_names(scene, names_of(*scene.mesh.box));
  return scene;
}

Scene load_scene(const std::filesystem::path& file, const std::vector<std::string>& overrides) {
  Scene scene = parse_scene(read_scene_text(file), file, overrides);
  std::error_code unreadable;
  if (!scene.mesh.box && !std::filesystem::exists(scene.mesh.file, unreadable))
    throw InputError(fmt::format("there is no file {}", scene.mesh.file.string()), scene.mesh.place,
                     "File names are relative to the scene's folder");
  return scene;
}

std::string resolved_yaml(const Scene& scene) { return scene.resolved; }

}  // namespace polyslip::scene
