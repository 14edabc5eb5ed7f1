#include "polyslip/scene/checks.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "polyslip/common/error.hpp"
#include "polyslip/common/suggest.hpp"
#include "polyslip/scene/flow.hpp"

namespace polyslip::scene {

void refuse(const Cursor& at, const std::string& what, const std::string& remedy) { throw InputError(what, at.where(), remedy); }

bool may_have_fractures(const Cursor& root) { return root["fractures"] || root["mesh"]["file"].text().ends_with(".h5"); }

bool cover_all_fractures(const std::vector<Cursor>& entries, const Cursor& root) {
  const std::vector<Cursor> fractures = root["fractures"].entries();
  return !fractures.empty() && std::ranges::all_of(fractures, [&](const Cursor& fracture) {
    return std::ranges::any_of(entries, [&](const Cursor& entry) { return entry["name"].text() == fracture["name"].text(); });
  });
}

void check_unique(const std::vector<Cursor>& entries, const std::string& key) {
  std::map<std::string, std::string> seen;
  for (const Cursor& entry : entries) {
    const auto [first, is_new] = seen.emplace(entry[key].text(), entry[key].where());
    if (!is_new)
      refuse(entry[key], fmt::format("the name \"{}\" is already taken at {}", first->first, first->second), "Choose another");
  }
}

namespace {

// Mesh

void check_axis(const Cursor& box, std::size_t axis) {
  const Cursor low = box["min"].entries()[axis], high = box["max"].entries()[axis];
  if (low.number() >= high.number())
    refuse(high, fmt::format("the box ends at {} where it starts at {}", high.number(), low.number()), "Make max larger than min");
  const Cursor grading = box["grading"][std::string(1, "xyz"[axis])];
  if (!grading) return;
  const Cursor from = grading["core"].entries()[0], to = grading["core"].entries()[1];
  if (!(low.number() <= from.number() && from.number() < to.number() && to.number() <= high.number()))
    refuse(grading["core"],
           fmt::format("the core [{}, {}] is not an interval inside [{}, {}]", from.number(), to.number(), low.number(),
                       high.number()),
           "Give its ends in order, inside the box");
  if (grading["size"].number() > to.number() - from.number())
    refuse(grading["size"],
           fmt::format("cells of {} do not fit into the core of {}", grading["size"].number(), to.number() - from.number()),
           "Give a smaller size");
}

void check_box(const Cursor& box) {
  const std::size_t dim = box["min"].entries().size();
  for (std::size_t axis = 0; axis < dim; ++axis) check_axis(box, axis);
  if (dim == 2 && box["grading"]["z"]) refuse(box["grading"]["z"], "there is no z axis in 2D", "Grade x and y");
  if (!box["cells"])
    refuse(box["cells"], "the key \"mesh.box.cells\" is missing", "Give the counts along the axes; only graded axes need none");
  double cells = 1;
  for (const Cursor& count : box["cells"].entries()) cells *= count.number();
  if (cells >= std::numeric_limits<Index>::max())
    refuse(box["cells"], fmt::format("{:.3g} cells are more than cell numbers can count", cells), "Give fewer");
  static const std::map<std::size_t, std::vector<std::string>> shapes{
      {2, {"quads", "triangles", "polygons", "warped"}}, {3, {"hexahedra", "tets", "prisms", "polyhedra", "warped", "cut"}}};
  const std::string shape = box["shape"].text();
  if (std::ranges::find(shapes.at(dim), shape) == shapes.at(dim).end())
    refuse(box["shape"], fmt::format("{} do not mesh a box in {}D", shape, dim),
           fmt::format("Choose one of {}", fmt::join(shapes.at(dim), ", ")));
}

void check_mesh(const Cursor& mesh) {
  const Cursor box = mesh["box"], file = mesh["file"];
  if (box && file) refuse(file, "both mesh.box and mesh.file are given", "Remove one (-set mesh.box=null or -set mesh.file=null)");
  if (!box && !file) refuse(mesh, "there is neither mesh.box nor mesh.file", "Give one");
  if (box) check_box(box);
}

// Fractures and contact

void check_points(const Cursor& fracture, std::size_t least) {
  const std::vector<Cursor> points = fracture["points"].entries();
  if (points.size() < least)
    refuse(fracture["points"], fmt::format("{} corners", points.size()), "Give a polygon of three or more");
  for (std::size_t i = 1; i < points.size(); ++i)
    if (points[i].point() == points[i - 1].point()) refuse(points[i], "the point is the same as the one before", "Remove one");
}

void check_fractures(const Cursor& root) {
  const std::vector<Cursor> fractures = root["fractures"].entries();
  check_unique(fractures, "name");
  for (const Cursor& fracture : fractures) {
    const Cursor points = fracture["points"], group = fracture["group"];
    if (points && group) refuse(group, "both points and group are given", "Remove one");
    if (!points && !group) refuse(fracture, "the fracture has neither points nor group", "Give one");
    if (group && root["mesh"]["box"]) refuse(group, "a box has no physical groups", "Give the fracture by points");
    if (points) check_points(fracture, points.entries()[0].entries().size());
  }
}

void check_law(const Cursor& rule, const std::string& law) {
  if (law == "frictionless" && rule["friction"])
    refuse(rule["friction"], "a frictionless fracture has no friction", "Remove the key, or choose the law tresca or coulomb");
}

void check_contact_entry(const Cursor& entry, const Cursor& contact) {
  const std::string common = contact["law"].text(), law = entry["law"] ? entry["law"].text() : common;
  check_law(entry, law);
  const bool inherits = contact["friction"] && law == common;  // A coefficient is not a bound.
  if (law != "frictionless" && !entry["friction"] && !inherits)
    refuse(entry["friction"], fmt::format("the key \"{}\" is missing", entry["friction"].path()),
           law == "coulomb" ? "Give the friction coefficient" : "Give the friction bound [Pa]");
}

void check_contact(const Cursor& root) {
  const Cursor contact = root["contact"];
  if (!contact) return;
  const std::vector<Cursor> entries = contact["fractures"].entries();
  if (!may_have_fractures(root))
    refuse(contact, "there is a section contact but no fracture", "Remove the section, or give fractures");
  check_unique(entries, "name");
  check_law(contact, contact["law"].text());
  for (const Cursor& entry : entries) check_contact_entry(entry, contact);
  if (contact["law"].text() != "frictionless" && !contact["friction"] && !cover_all_fractures(entries, root))
    refuse(contact["friction"], "the key \"contact.friction\" is missing",
           contact["law"].text() == "coulomb" ? "Give the friction coefficient, or set contact.law: frictionless"
                                              : "Give the friction bound [Pa], or set contact.law: frictionless");
}

// Rock

template <std::size_t n>
auto count_keys(const Cursor& rule, const std::array<const char*, n>& keys) {
  return std::ranges::count_if(keys, [&](const char* key) { return bool(rule[key]); });
}

void check_material(const Cursor& rule) {
  const auto given = count_keys(rule, elastic_keys), hydraulic = count_keys(rule, hydraulic_keys);
  if (given == 0 && hydraulic == 0)
    refuse(rule, "the rule gives nothing", "Give young and poisson, lame_mu and lame_lambda, or permeability");
  if (given == 0) return;
  const bool young = rule["young"] && rule["poisson"], lame = rule["lame_mu"] && rule["lame_lambda"];
  if (given != 2 || (!young && !lame))
    refuse(rule, "the moduli are not a pair", "Give young and poisson, or lame_mu and lame_lambda");
  if (!lame) return;
  const Expression mu = rule["lame_mu"].expression(), lambda = rule["lame_lambda"].expression();
  if (mu.is_constant() && lambda.is_constant() && lambda({}) <= -2.0 / 3.0 * mu({}))
    refuse(rule["lame_lambda"], fmt::format("lambda = {} makes the bulk modulus negative", lambda({})),
           "It must be > -2/3 lame_mu");
}

void check_boundary_rule(const Cursor& rule) {
  const auto displacement = rule["displacement"].optional_expressions(), traction = rule["traction"].optional_expressions();
  const auto given = [](const std::optional<Expression>& component) { return component.has_value(); };
  if (rule["pressure"] && (rule["displacement"] || rule["traction"]))
    refuse(rule["pressure"], "pressure stands beside displacement or traction", "Give it a rule of its own");
  if (!rule["pressure"] && std::ranges::none_of(displacement, given) && std::ranges::none_of(traction, given))
    refuse(rule, "the rule gives nothing", "Give a component of displacement or traction, or pressure");
  for (std::size_t i = 0; i < 3; ++i)
    if (displacement[i] && traction[i])
      refuse(rule["traction"], fmt::format("displacement and traction both give component {}", "xyz"[i]),
             "Write null for one of them");
}

void check_held(const Cursor& root) {
  const std::vector<Cursor> rules = root["mechanics"]["boundary"].entries();
  std::array<bool, 3> held{};
  std::size_t dim = 2;
  for (const Cursor& rule : rules) {
    const auto displacement = rule["displacement"].optional_expressions();
    for (std::size_t i = 0; i < 3; ++i) held[i] = held[i] || displacement[i].has_value();
    dim = std::max({dim, rule["displacement"].entries().size(), rule["traction"].entries().size()});
  }
  if (root["mesh"]["box"]) dim = root["mesh"]["box"]["min"].entries().size();
  for (std::size_t i = 0; i < dim; ++i)
    if (!held[i])
      refuse(root["mechanics"]["boundary"],
             fmt::format("no side has its displacement in {} given: the body is free to move", "xyz"[i]),
             "Give that component of displacement on at least one side");
}

void check_initial(const Cursor& root) {
  const Cursor initial = root["initial"];
  if (initial && !root["mechanics"])
    refuse(initial, "an initial state has a meaning with mechanics only",
           "Remove the section; pressure starts at flow.initial_pressure");
  if (initial["equilibrium"].is_true() && !root["flow"])
    refuse(initial["equilibrium"], "without flow a run starts from zero displacement", "Write false, or add the section flow");
  for (const char* component : {"yz", "xz"})
    if (root.dim() == 2 && initial["stress"] && !initial["stress"][component].expression().is_zero())
      refuse(initial["stress"][component], fmt::format("there is no component {} in plane strain", component), "Remove it");
}

void check_steps(const Cursor& time) {
  const double step = time["step"].number();
  // Below this, times that differ by a step are the same number.
  const double least = 1e-14 * std::max(std::abs(time["start"].number()), std::abs(time["end"].number()));
  for (const char* key : {"step", "smallest_step"})
    if (time[key].number() <= least)
      refuse(time[key], fmt::format("{} s does not advance a time of up to {} s", time[key].number(), 1e14 * least),
             fmt::format("Give more than {:g}", least));
  if (time["smallest_step"].number() > step)
    refuse(time["smallest_step"], fmt::format("it is larger than the step, {} s", step), "Give at most time.step");
  if (time["largest_step"].number() < step)
    refuse(time["largest_step"], fmt::format("it is smaller than the step, {} s", step), "Give at least time.step");
  double last = time["start"].number();
  for (const Cursor& output : time["outputs"].entries()) {
    if (output.number() <= last || output.number() > time["end"].number())
      refuse(output, fmt::format("{} s does not lie after {} s and in the run", output.number(), last),
             "Give times in order, after time.start and up to time.end");
    last = output.number();
  }
}

void check_time(const Cursor& time) {
  if (time["end"].number() <= time["start"].number())
    refuse(time["end"], fmt::format("the run ends at {} s where it starts at {} s", time["end"].number(), time["start"].number()),
           "Make time.end larger than time.start");
  check_steps(time);
}

/// Rigid rock takes no loads; a rock that moves has moduli somewhere and is held.
void check_mechanics(const Cursor& root) {
  if (!root["mechanics"]) {
    for (const std::string& key : root["exact"].keys())
      if (key != "pressure" && key != "flux")
        refuse(root["exact"][key], "there is nothing to compare: no material gives elastic moduli",
               "Remove the key, or give moduli");
    return;
  }
  const std::vector<Cursor> materials = root["materials"].entries();
  if (std::ranges::none_of(materials, [](const Cursor& rule) { return count_keys(rule, elastic_keys) > 0; }))
    refuse(root["materials"], "no material gives elastic moduli",
           "Give young and poisson, or remove mechanics and contact to compute flow alone");
  for (const Cursor& rule : root["mechanics"]["boundary"].entries()) check_boundary_rule(rule);
  check_held(root);
}

}  // namespace

void check_document(const Cursor& root) {
  check_mesh(root["mesh"]);
  check_fractures(root);
  for (const Cursor& rule : root["materials"].entries()) check_material(rule);
  check_flow(root);
  check_mechanics(root);
  check_contact(root);
  check_initial(root);
  check_time(root["time"]);
  check_unique(root["output"]["probes"].entries(), "name");
  check_unique(root["output"]["windows"].entries(), "name");
  if (root["output"]["windows"] && !root["contact"])
    refuse(root["output"]["windows"], "there is no contact to record", "Remove the key, or give fractures and moduli");
  check_unique(root["output"]["lines"].entries(), "name");
}

MeshNames names_of(const mesh::BoxSpec& box) {
  MeshNames names{.dim = box.dim,
                  .tags = {"left", "right", "bottom", "top"},
                  .regions = {"rock"},
                  .fractures = {},
                  .low = Vec3::Zero(),
                  .high = Vec3::Zero()};
  if (box.dim == 3) names.tags.insert(names.tags.end(), {"front", "back"});
  for (int i = 0; i < box.dim; ++i) {
    names.low[i] = box.min[static_cast<std::size_t>(i)];
    names.high[i] = box.max[static_cast<std::size_t>(i)];
  }
  return names;
}

MeshNames names_of(const mesh::PolyMesh& mesh) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  MeshNames names{.dim = mesh.dim,
                  .tags = mesh.tag_names,
                  .regions = mesh.region_names,
                  .fractures = mesh.fracture_names,
                  .low = Vec3::Constant(infinity),
                  .high = Vec3::Constant(-infinity)};
  for (const Vec3& node : mesh.nodes) {
    names.low = names.low.cwiseMin(node);
    names.high = names.high.cwiseMax(node);
  }
  return names;
}

void check_known(const std::string& what, const std::string& name, const std::vector<std::string>& known,
                 const std::string& place) {
  if (std::ranges::find(known, name) == known.end())
    throw InputError(fmt::format("the mesh has no {} \"{}\"", what, name), place, did_you_mean(name, known));
}

void check_inside(const std::string& what, const Vec3& at, const MeshNames& mesh, const std::string& place) {
  const Vec3 slack = Vec3::Constant(1e-9 * (mesh.high - mesh.low).norm());
  const bool inside = ((at - mesh.low + slack).array() >= 0).all() && ((mesh.high - at + slack).array() >= 0).all();
  if (!inside)
    throw InputError(fmt::format("the {} at ({}, {}, {}) lies outside the mesh", what, at[0], at[1], at[2]), place,
                     fmt::format("Choose a point between ({}, {}, {}) and ({}, {}, {})", mesh.low[0], mesh.low[1], mesh.low[2],
                                 mesh.high[0], mesh.high[1], mesh.high[2]));
}

void check_fracture(const std::string& name, const std::vector<std::string>& known, const std::string& place) {
  if (std::ranges::find(known, name) == known.end())
    throw InputError(fmt::format("there is no fracture \"{}\"", name), place, did_you_mean(name, known));
}

std::vector<std::string> fracture_names(const Scene& scene, const MeshNames& mesh) {
  std::vector<std::string> names = mesh.fractures;
  for (const auto& fracture : scene.fractures) names.push_back(fracture.name);
  return names;
}

namespace {

void check_contact_names(const Scene& scene, const MeshNames& mesh) {
  const std::vector<std::string> fractures = fracture_names(scene, mesh);
  const auto& rules = scene.mechanics.contact;
  if (fractures.empty() && !rules.empty())
    throw InputError("there is a section contact but the mesh has no fracture", rules.front().place,
                     "Remove the section, or give fractures");
  if (!fractures.empty() && rules.empty())
    throw InputError("the key \"contact.friction\" is missing, and the mesh has fractures", scene.mesh.place,
                     "Give the friction coefficient, or set contact.law: frictionless");
  for (const auto& rule : rules)
    if (!rule.fracture.empty()) check_fracture(rule.fracture, fractures, rule.place);
}

}  // namespace

void check_names(const Scene& scene, const MeshNames& mesh) {
  if (scene.dim != 0 && scene.dim != mesh.dim)
    throw InputError(fmt::format("the mesh is {}D and the scene {}D", mesh.dim, scene.dim), scene.dim_place,
                     fmt::format("Give {} components, or another mesh", mesh.dim));
  for (const auto& rule : scene.mechanics.boundary)
    if (rule.tag != "all") check_known("side or group", rule.tag, mesh.tags, rule.place);
  for (const auto& rule : scene.mechanics.materials)
    if (!rule.region.empty()) check_known("region", rule.region, mesh.regions, rule.place);
  for (const auto& fracture : scene.fractures)
    if (!fracture.group.empty()) check_known("group", fracture.group, mesh.tags, fracture.where);
  if (scene.has_mechanics) check_contact_names(scene, mesh);
  if (scene.flow) check_flow_names(scene, mesh);
  for (const Probe& probe : scene.output.probes) check_inside("probe", probe.at, mesh, probe.place);
  for (const Window& window : scene.output.windows)
    if (!window.rule.fracture.empty()) check_fracture(window.rule.fracture, fracture_names(scene, mesh), window.place);
  for (const Line& line : scene.output.lines)
    for (const Vec3& end : {line.from, line.to}) check_inside("end of the line", end, mesh, line.place);
}

void check_against_mesh(const Scene& scene, const mesh::PolyMesh& mesh) { check_names(scene, names_of(mesh)); }

}  // namespace polyslip::scene
