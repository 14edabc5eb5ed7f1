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
  const std::string upper = std::isfinite(high) ? fmt::format(" and {} {}", or_high ? "<=" : "<", high) : "";
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
                                                 {Shape::tensor, "{}, diagonal or symmetric matrix of {}s, one an axis"},
                                                 {Shape::points, "list of points"}};
  if (key.kind == Kind::choice) return fmt::format("{}", fmt::join(key.choices, " | "));
  const std::string& name = one.at(key.kind);
  return fmt::format(fmt::runtime(form.at(key.shape)), name, name) + (key.may_be_infinite ? " or infinity" : "") +
         (key.unit.empty() ? "" : fmt::format(" [{}]", key.unit));
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
