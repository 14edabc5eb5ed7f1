// A YAML text as a plain tree in which every value knows its place, for messages.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace polyslip::scene {

/// A node of the tree. Numbers stay text: the schema says what they mean.
struct Value {
  enum class Kind { null, scalar, list, map };
  Kind kind = Kind::null;
  std::string text;               ///< Of a scalar.
  std::vector<std::string> keys;  ///< Of a map, aligned with items.
  std::vector<Value> items;       ///< Of a list or map.
  std::string place;              ///< "scene.yaml:12" (the line of its key, or its own in a list) or "-set KEY=VALUE".

  [[nodiscard]] bool is_null() const { return kind == Kind::null; }
  [[nodiscard]] bool is_scalar() const { return kind == Kind::scalar; }
  [[nodiscard]] bool is_list() const { return kind == Kind::list; }
  [[nodiscard]] bool is_map() const { return kind == Kind::map; }
  /// The value of a key of a map; null where there is none.
  [[nodiscard]] const Value* find(std::string_view key) const;
  [[nodiscard]] Value* find(std::string_view key);
  void insert(const std::string& key, Value value);
  void erase(std::string_view key);

  static Value nothing(std::string place);
  static Value scalar(std::string text, std::string place);
  static Value map(std::string place);
};

/// Parses one YAML document; aliases are copied, an empty text is an empty map. Throws InputError with `source`:line for errors of
/// syntax, repeated or composite keys, more than one document, and trees too deep or too large (an alias within itself).
Value parse_yaml(const std::string& text, const std::string& source);

/// Parses the VALUE of an override; all places are `place`.
Value parse_yaml_value(const std::string& text, const std::string& place);

/// YAML text that parses to the same tree.
std::string emit_yaml(const Value& value);

/// "a map", "a list", "the text ..." or "nothing": what was met, for messages.
std::string describe(const Value& value);

}  // namespace polyslip::scene
