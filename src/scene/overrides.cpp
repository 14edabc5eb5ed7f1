// Overrides of single keys from the command line: -set KEY=VALUE.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <optional>

#include "polyslip/common/error.hpp"
#include "polyslip/common/suggest.hpp"
#include "polyslip/scene/document.hpp"

namespace polyslip::scene {

namespace {

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r\n");
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
}

/// "materials[0].young" and "materials.0.young" -> materials, 0, young.
std::vector<std::string> steps_of(const std::string& path) {
  std::vector<std::string> steps(1);
  for (const char c : path) {
    if (c == '.' || c == '[')
      steps.emplace_back();
    else if (c != ']')
      steps.back() += c;
  }
  return steps;
}

std::optional<std::size_t> as_index(const std::string& step) {
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(step.data(), step.data() + step.size(), index);
  return error == std::errc() && end == step.data() + step.size() ? std::optional(index) : std::nullopt;
}

/// Follows a path through the tree and the schema at once; maps that are missing on the way are made.
class Walk {
 public:
  Walk(Value& root, std::string place, bool removing) : node_(&root), place_(std::move(place)), removing_(removing) {}

  /// False when there is nothing there to remove.
  bool step(const std::string& name) {
    const auto index = as_index(name);
    return index && key_ != nullptr && key_->shape != Shape::one ? enter_list(*index) : enter_map(name);
  }

  void set(const std::string& text) {
    *node_ = takes_text_as_it_stands(text) ? Value::scalar(text, place_) : parse_yaml_value(text, place_);
  }

  void remove() {
    if (parent_ != nullptr)
      parent_->erase(name_);
    else
      *node_ = Value::nothing(place_);
  }

 private:
  [[noreturn]] void refuse(const std::string& what, const std::string& remedy) const { throw InputError(what, place_, remedy); }

  bool enter_list(std::size_t index) {
    if (removing_ && node_->is_null()) return false;
    if (!node_->is_list() || index >= node_->items.size())
      refuse(fmt::format("there is no entry {}[{}]", path_, index),
             fmt::format("{} has {} entries, counted from 0; set the whole list to change its length", path_, node_->items.size()));
    node_ = &node_->items[index];
    parent_ = nullptr;
    path_ += fmt::format("[{}]", index);
    if (key_->kind == Kind::group) pattern_ += "[]";
    indexed_ = true;
    return true;
  }

  bool enter_map(const std::string& name) {
    const bool is_list = key_ != nullptr && key_->shape == Shape::list && !indexed_;
    if (is_list) refuse(fmt::format("{} is a list", path_), fmt::format("Name an entry: {}[0].{}", path_, name));
    const Key* child = child_key(name);
    if (!node_->is_map() && !node_->is_null())
      refuse(fmt::format("{} is {} in the scene", path_, describe(*node_)), "Set it as a whole");
    if (node_->is_null()) *node_ = Value::map(place_);
    if (node_->find(name) == nullptr) {
      if (removing_) return false;
      node_->insert(name, {});
    }
    parent_ = node_;
    name_ = name;
    node_ = node_->find(name);
    key_ = child;
    pattern_ = child->path;
    path_ = join_path(path_, name);
    indexed_ = false;
    return true;
  }

  const Key* child_key(const std::string& name) const {
    if (const Key* child = find_key(join_path(pattern_, name)); child != nullptr && name != "*") return child;
    if (key_ == nullptr || key_->kind != Kind::names)
      refuse(fmt::format("unknown key \"{}\"", join_path(path_, name)), propose_key(pattern_, path_, name));
    const std::vector<std::string>& known = key_->choices.empty() ? node_->keys : key_->choices;
    if (std::ranges::find(known, name) == known.end())
      refuse(fmt::format("the scene has no \"{}\"", join_path(path_, name)),
             known.empty() ? "Define it in the scene first" : did_you_mean(name, known));
    return find_key(pattern_ + ".*");
  }

  /// A formula would be a map to YAML ("x < 0 ? 1 : 2").
  [[nodiscard]] bool takes_text_as_it_stands(const std::string& text) const {
    const bool leaf = key_->kind != Kind::group && key_->kind != Kind::names;
    const bool single = key_->shape == Shape::one || key_->shape == Shape::one_or_more || key_->shape == Shape::tensor || indexed_;
    return leaf && single && std::string("[{\"'").find(text.front()) == std::string::npos;
  }

  Value* node_;
  Value* parent_ = nullptr;  ///< The map that node_ lies in; null for an entry of a list.
  std::string name_;         ///< Key of node_ in parent_.
  const Key* key_ = nullptr;
  bool indexed_ = false;  ///< node_ is an entry of the list that key_ describes.
  std::string pattern_, path_, place_;
  bool removing_;
};

}  // namespace

void apply_override(Value& root, const std::string& argument) {
  const std::string place = "-set " + argument.substr(0, 120);
  const auto equals = argument.find('=');
  const std::string path = trimmed(argument.substr(0, equals));
  const std::string text = equals == std::string::npos ? "" : trimmed(argument.substr(equals + 1));
  if (path.empty() || text.empty()) throw InputError("an override is KEY=VALUE", place, "For instance -set time.step=10");
  if (!root.is_map()) return;  // Refused with its place when the scene is checked.

  const bool removing = text == "null" || text == "~";
  Walk walk(root, place, removing);
  for (const std::string& step : steps_of(path))
    if (!walk.step(step)) return;
  if (removing)
    walk.remove();
  else
    walk.set(text);
}

}  // namespace polyslip::scene
