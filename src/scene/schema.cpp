#include "polyslip/scene/schema.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "polyslip/common/suggest.hpp"
#include "polyslip/scene/scene.hpp"

namespace polyslip::scene {

namespace {

constexpr Range positive{.low = 0};
constexpr Range not_negative{.low = 0, .or_equal = true};
constexpr Range at_least_one{.low = 1, .or_equal = true};
constexpr double count_limit = 2147483648.0;  // Counts are 32 bits wide.
constexpr Range positive_count{.low = 1, .high = count_limit, .or_equal = true};

const std::string must{required};

std::vector<Key> make_keys() {
  using enum Kind;
  using S = Shape;
  return {
      {.path = "name",
       .kind = word,
       .standard = "(name of the scene's folder)",
       .help = "Name of the run; results go to <name>.out."},
      {.path = "description", .kind = text, .help = "What is computed, in a line."},

      {.path = "study",
       .kind = names,
       .help = "Named numbers that every number and expression may use; for studies by -set study.NAME=VALUE."},
      {.path = "study.*", .kind = number, .help = "Value of the name; may use the names above it."},
      {.path = "define", .kind = names, .help = "Named expressions that every expression may use, in order."},
      {.path = "define.*",
       .kind = expression,
       .help = "Formula; may use study numbers and the definitions above it.",
       .uses = Uses::time_and_fracture},

      {.path = "mesh", .kind = group, .standard = must, .help = "The mesh: a box or a file."},
      {.path = "mesh.box",
       .kind = group,
       .help = "A meshed box; its sides are tagged left, right (x), bottom, top (the last axis), front, back (y, 3D)."},
      {.path = "mesh.box.min",
       .kind = number,
       .shape = S::vector,
       .unit = "m",
       .standard = must,
       .help = "Lowest corner; 2 or 3 coordinates set the dimension."},
      {.path = "mesh.box.max", .kind = number, .shape = S::vector, .unit = "m", .standard = must, .help = "Highest corner."},
      {.path = "mesh.box.cells",
       .kind = count,
       .shape = S::vector,
       .standard = "(1 on graded axes, else required)",
       .help = "Cells along each axis; ignored on graded axes.",
       .range = positive_count},
      {.path = "mesh.box.shape",
       .kind = choice,
       .standard = "(quads or hexahedra)",
       .help = "Shape of the cells; 2D: quads, triangles, polygons, warped (quads), 3D: the others and warped (hexahedra).",
       .choices = {"quads", "triangles", "polygons", "hexahedra", "tets", "prisms", "polyhedra", "warped", "cut"}},
      {.path = "mesh.box.grading",
       .kind = names,
       .help = "Graded axes, by x, y, z: cells of one size in the core, growing outwards.",
       .choices = {"x", "y", "z"}},
      {.path = "mesh.box.grading.*", .kind = group, .help = "Grading of one axis."},
      {.path = "mesh.box.grading.*.core",
       .kind = number,
       .shape = S::pair,
       .unit = "m",
       .standard = must,
       .help = "Ends of the core."},
      {.path = "mesh.box.grading.*.size",
       .kind = number,
       .unit = "m",
       .standard = must,
       .help = "Cell size in the core, rounded so that cells fit.",
       .range = positive},
      {.path = "mesh.box.grading.*.growth",
       .kind = number,
       .standard = must,
       .help = "Ratio of the sizes of neighbouring cells outside the core.",
       .range = {.low = 1}},
      {.path = "mesh.box.shake",
       .kind = number,
       .standard = "0.2",
       .help = "Largest move of inner nodes (warped, cut) or Voronoi seeds (polygons, polyhedra), in spacings.",
       .range = {.low = 0, .high = 0.5, .or_equal = true}},
      {.path = "mesh.box.seed",
       .kind = count,
       .standard = "1",
       .help = "Start of the random numbers of the shaking.",
       .range = {.low = 0, .high = count_limit, .or_equal = true}},
      {.path = "mesh.file", .kind = file, .help = "Mesh file, relative to the scene's folder: .msh (Gmsh) or .h5 (native)."},
      {.path = "mesh.write",
       .kind = text,
       .help = "File that the mesh is also written to in the native format, relative to the output folder."},

      {.path = "fractures",
       .kind = group,
       .shape = S::list,
       .help = "The fractures, each by its points or by a physical group of mesh.file."},
      {.path = "fractures[].name", .kind = word, .standard = must, .help = "Name, unlike those of the other fractures."},
      {.path = "fractures[].points",
       .kind = number,
       .shape = S::points,
       .unit = "m",
       .help = "Polyline (2D; the + side on its left) or planar polygon (3D; the + side where its right-hand normal points)."},
      {.path = "fractures[].group", .kind = text, .help = "Physical group of mesh.file."},

      {.path = "materials",
       .kind = group,
       .shape = S::list,
       .standard = must,
       .help = "Elastic moduli, as young and poisson or lame_mu and lame_lambda; later rules win."},
      {.path = "materials[].region", .kind = text, .help = "Region of the mesh that the rule is for; all when not given."},
      {.path = "materials[].where",
       .kind = expression,
       .help = "The rule is for cells whose centre makes this non-zero; all when not given.",
       .uses = Uses::nothing},
      {.path = "materials[].young",
       .kind = expression,
       .unit = "Pa",
       .help = "Young's modulus E.",
       .range = positive,
       .uses = Uses::nothing},
      {.path = "materials[].poisson",
       .kind = expression,
       .help = "Poisson's ratio nu (drained).",
       .range = {.low = -1, .high = 0.5},
       .uses = Uses::nothing},
      {.path = "materials[].lame_mu",
       .kind = expression,
       .unit = "Pa",
       .help = "Shear modulus mu.",
       .range = positive,
       .uses = Uses::nothing},
      {.path = "materials[].lame_lambda",
       .kind = expression,
       .unit = "Pa",
       .help = "First Lame modulus lambda.",
       .uses = Uses::nothing},

      {.path = "mechanics", .kind = group, .standard = "{}", .help = "Loads and conditions on the rock, and its discretisation."},
      {.path = "mechanics.stabilisation",
       .kind = choice,
       .standard = "2mu",
       .help = "Factor of the stabilisation of each cell.",
       .choices = {"2mu", "2mu+lambda"}},
      {.path = "mechanics.bubbles",
       .kind = choice,
       .standard = "fracture",
       .help = "Faces that carry a bubble unknown: the + sides of the fractures.",
       .choices = {"fracture"}},
      {.path = "mechanics.body_force",
       .kind = expression,
       .shape = S::vector,
       .unit = "N/m3",
       .standard = "0",
       .help = "Force on the rock."},
      {.path = "mechanics.boundary",
       .kind = group,
       .shape = S::list,
       .help = "Conditions on the boundary; later rules win, what none speaks of is free of traction."},
      {.path = "mechanics.boundary[].on",
       .kind = text,
       .shape = S::one_or_more,
       .standard = must,
       .help = "Side, physical group, a list of them, or all."},
      {.path = "mechanics.boundary[].displacement",
       .kind = expression,
       .shape = S::vector_free,
       .unit = "m",
       .help = "Given displacement; null leaves a component free."},
      {.path = "mechanics.boundary[].traction",
       .kind = expression,
       .shape = S::vector_free,
       .unit = "Pa",
       .help = "Given traction sigma n; null leaves a component out."},
      {.path = "mechanics.boundary[].pressure", .kind = expression, .unit = "Pa", .help = "Given traction -pressure n."},

      {.path = "contact", .kind = group, .standard = "(there with fractures)", .help = "Contact and friction on the fractures."},
      {.path = "contact.law",
       .kind = choice,
       .standard = "coulomb",
       .help = "Friction law.",
       .choices = {"frictionless", "tresca", "coulomb"}},
      {.path = "contact.friction",
       .kind = expression,
       .unit = "- or Pa",
       .help = "Friction coefficient F (coulomb) or bound in Pa (tresca); needed unless frictionless.",
       .range = not_negative,
       .uses = Uses::time_and_fracture},
      {.path = "contact.fracture_pressure",
       .kind = expression,
       .unit = "Pa",
       .standard = "0",
       .help = "Given fluid pressure inside the fractures.",
       .uses = Uses::time_and_fracture},
      {.path = "contact.fractures",
       .kind = group,
       .shape = S::list,
       .help = "What differs on single fractures; keys not given are as above."},
      {.path = "contact.fractures[].name", .kind = word, .standard = must, .help = "Name of the fracture."},
      {.path = "contact.fractures[].law",
       .kind = choice,
       .standard = "(contact.law)",
       .help = "Friction law.",
       .choices = {"frictionless", "tresca", "coulomb"}},
      {.path = "contact.fractures[].friction",
       .kind = expression,
       .unit = "- or Pa",
       .standard = "(contact.friction)",
       .help = "Friction coefficient or bound.",
       .range = not_negative,
       .uses = Uses::time_and_fracture},
      {.path = "contact.fractures[].fracture_pressure",
       .kind = expression,
       .unit = "Pa",
       .standard = "(contact.fracture_pressure)",
       .help = "Given fluid pressure inside the fracture.",
       .uses = Uses::time_and_fracture},
      {.path = "contact.formulation",
       .kind = choice,
       .standard = "condensed",
       .help = "Eliminate bubbles and multipliers from the linear systems, or keep them.",
       .choices = {"condensed", "saddle"}},
      {.path = "contact.beta_scale",
       .kind = number,
       .unit = "(2mu+lambda)/h_K",
       .standard = "0.1",
       .help = "Parameter beta of the complementarity functions; the solution does not depend on it.",
       .range = positive},

      {.path = "time", .kind = group, .standard = "{}", .help = "Load steps."},
      {.path = "time.start", .kind = number, .unit = "s", .standard = "0", .help = "Start."},
      {.path = "time.end", .kind = number, .unit = "s", .standard = "1", .help = "End."},
      {.path = "time.step",
       .kind = number,
       .unit = "s",
       .standard = "(end - start: one step)",
       .help = "Step size; the last step ends at the end.",
       .range = positive},

      {.path = "output", .kind = group, .standard = "{}", .help = "What is written beside the summary."},
      {.path = "output.every",
       .kind = count,
       .standard = "1",
       .help = "Fields are written after every so many steps, and after the last.",
       .range = positive_count},
      {.path = "output.probes", .kind = group, .shape = S::list, .help = "Points at which history.csv records the displacement."},
      {.path = "output.probes[].name", .kind = word, .standard = must, .help = "Name of the columns."},
      {.path = "output.probes[].at", .kind = number, .shape = S::vector, .unit = "m", .standard = must, .help = "The point."},

      {.path = "exact", .kind = group, .help = "Exact solution for the errors of summary.json; give what is to be compared."},
      {.path = "exact.displacement", .kind = expression, .shape = S::vector, .unit = "m", .help = "Displacement u."},
      {.path = "exact.gradient", .kind = expression, .shape = S::matrix, .help = "Rows of the gradient, d u_i/d x_j."},
      {.path = "exact.multiplier_normal",
       .kind = expression,
       .unit = "Pa",
       .help = "Normal traction lam_n, compression positive.",
       .uses = Uses::time_and_fracture},
      {.path = "exact.multiplier_tangential",
       .kind = expression,
       .shape = S::vector,
       .unit = "Pa",
       .help = "Tangential traction lam_t, Cartesian.",
       .uses = Uses::time_and_fracture},
      {.path = "exact.jump_normal",
       .kind = expression,
       .unit = "m",
       .help = "Normal jump [u].n+, opening negative.",
       .uses = Uses::time_and_fracture},
      {.path = "exact.jump_tangential",
       .kind = expression,
       .shape = S::vector,
       .unit = "m",
       .help = "Tangential jump, Cartesian.",
       .uses = Uses::time_and_fracture},
      {.path = "exact.faces",
       .kind = expression,
       .help = "Fracture faces whose centre makes this non-zero enter the norms; all when not given.",
       .uses = Uses::time_and_fracture},
  };
}

std::string parent_of(const std::string& pattern) {
  const auto dot = pattern.rfind('.');
  return dot == std::string::npos ? "" : pattern.substr(0, dot);
}

/// Keys by their parent's pattern. Entries of a list have the parent "fractures[]".
const std::map<std::string, std::vector<const Key*>>& children() {
  static const auto index = [] {
    std::map<std::string, std::vector<const Key*>> result;
    for (const Key& key : all_keys()) result[parent_of(key.path)].push_back(&key);
    return result;
  }();
  return index;
}

}  // namespace

std::span<const Key> all_keys() {
  static const std::vector<Key> keys = make_keys();
  return keys;
}

const Key* find_key(const std::string& pattern) {
  const auto keys = all_keys();
  const auto found = std::ranges::find(keys, pattern, &Key::path);
  return found == keys.end() ? nullptr : &*found;
}

std::vector<const Key*> keys_below(const std::string& pattern) {
  const auto found = children().find(pattern);
  return found == children().end() ? std::vector<const Key*>{} : found->second;
}

std::string join_path(const std::string& parent, const std::string& child) { return parent.empty() ? child : parent + "." + child; }

std::string last_name(const std::string& pattern) { return pattern.substr(pattern.rfind('.') + 1); }

std::string propose_key(const std::string& pattern, const std::string& path, const std::string& name) {
  std::vector<std::string> siblings, elsewhere;
  for (const Key* key : keys_below(pattern)) siblings.push_back(last_name(key->path));
  if (const std::string near = nearest_word(name, siblings); !near.empty())
    return fmt::format("Did you mean \"{}\"?", join_path(path, near));
  for (const Key& key : all_keys())
    if (last_name(key.path) == name && name != "*") elsewhere.push_back(key.path);
  if (!elsewhere.empty()) return fmt::format("Did you mean \"{}\"?", fmt::join(elsewhere, "\" or \""));
  return siblings.empty() ? "Nothing lies below it" : fmt::format("Known here: {}", fmt::join(siblings, ", "));
}

std::string Range::text() const {
  if (!std::isfinite(low)) return "";
  const std::string upper = std::isfinite(high) ? fmt::format(" and < {}", high) : "";
  return fmt::format("{} {}{}", or_equal ? ">=" : ">", low, upper);
}

std::string type_text(const Key& key) {
  static const std::map<Kind, std::string> one{
      {Kind::group, "map"},     {Kind::names, "map of names"}, {Kind::text, "text"},
      {Kind::word, "word"},     {Kind::file, "file"},          {Kind::choice, ""},
      {Kind::number, "number"}, {Kind::count, "whole number"}, {Kind::expression, "expression"}};
  static const std::map<Shape, std::string> form{{Shape::one, "{}"},
                                                 {Shape::one_or_more, "{} or list of them"},
                                                 {Shape::list, "list of {}s"},
                                                 {Shape::pair, "list of two {}s"},
                                                 {Shape::vector, "list of {}s, one an axis"},
                                                 {Shape::vector_free, "list of {}s or null, one an axis"},
                                                 {Shape::matrix, "list of rows of {}s, one an axis"},
                                                 {Shape::points, "list of points"}};
  if (key.kind == Kind::choice) return fmt::format("{}", fmt::join(key.choices, " | "));
  return fmt::format(fmt::runtime(form.at(key.shape)), one.at(key.kind)) + (key.unit.empty() ? "" : fmt::format(" [{}]", key.unit));
}

std::string help_text() {
  std::string text =
      "Scene keys (YAML). Numbers may be formulas of study numbers in quotes (\"2/n\"); expressions are formulas of x, y, z [m], t "
      "[s],\n"
      "study numbers and definitions, with + - * / ^, comparisons, && ||, a ? b : c, pi, sin, cos, tan, asin, acos, atan, atan2, "
      "sinh,\n"
      "cosh, tanh, exp, log, log10, sqrt, abs, min, max, sign, rint; on fractures also of tip_distance and fracture_length [m].\n"
      "-set KEY=VALUE overrides a key: -set mesh.box.cells=[16,16] -set materials[0].young=1e9; -set KEY=null removes it.\n";
  for (const Key& key : all_keys()) {
    if (parent_of(key.path).empty()) text += "\n";
    std::string notes = type_text(key);
    if (const std::string range = key.range.text(); !range.empty()) notes += ", " + range;
    if (key.standard == required)
      notes += ", required";
    else if (key.standard != absent && key.standard != "{}")
      notes += ", default " + key.standard;
    text += fmt::format("{}: {}\n      {}\n", key.path, notes, key.help);
  }
  return text;
}

}  // namespace polyslip::scene
