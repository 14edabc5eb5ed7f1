#include "polyslip/scene/value.hpp"

#include <fmt/format.h>
#include <yaml-cpp/depthguard.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <functional>
#include <unordered_map>

#include "polyslip/common/error.hpp"
#include "polyslip/common/suggest.hpp"

namespace polyslip::scene {

const Value* Value::find(std::string_view key) const {
  const auto found = std::ranges::find(keys, key);
  return found == keys.end() ? nullptr : &items[static_cast<std::size_t>(found - keys.begin())];
}

Value* Value::find(std::string_view key) { return const_cast<Value*>(std::as_const(*this).find(key)); }

void Value::insert(const std::string& key, Value value) {
  keys.push_back(key);
  items.push_back(std::move(value));
}

void Value::erase(std::string_view key) {
  const auto found = std::ranges::find(keys, key);
  if (found == keys.end()) return;
  items.erase(items.begin() + (found - keys.begin()));
  keys.erase(found);
}

Value Value::nothing(std::string place) {
  Value value;
  value.place = std::move(place);
  return value;
}

Value Value::scalar(std::string text, std::string place) {
  Value value = nothing(std::move(place));
  value.kind = Kind::scalar;
  value.text = std::move(text);
  return value;
}

Value Value::map(std::string place) {
  Value value = nothing(std::move(place));
  value.kind = Kind::map;
  return value;
}

namespace {

constexpr int deepest = 32;          // The schema is 5 deep.
constexpr long largest = 1'000'000;  // Values; some 50 000 fractures.

/// Turns yaml-cpp's graph into a tree; what cannot be a scene stops it.
class Copier {
 public:
  explicit Copier(std::function<std::string(const YAML::Mark&)> place_of) : place_of_(std::move(place_of)) {}

  Value copy(const YAML::Node& node, const std::string& place, int depth = 0) {
    if (depth > deepest) throw InputError("the nesting is too deep", place, "Remove brackets, or the alias that contains itself");
    if (++count_ > largest)
      throw InputError(fmt::format("the text holds more than {} values", largest), place, "Use fewer aliases");
    if (node.IsNull() || !node.IsDefined()) return Value::nothing(place);
    if (node.IsScalar()) return Value::scalar(node.Scalar(), place);
    return node.IsSequence() ? copy_list(node, place, depth) : copy_map(node, place, depth);
  }

 private:
  Value copy_list(const YAML::Node& node, const std::string& place, int depth) {
    Value list = Value::nothing(place);
    list.kind = Value::Kind::list;
    for (const YAML::Node& item : node) list.items.push_back(copy(item, place_of_(item.Mark()), depth + 1));
    return list;
  }

  Value copy_map(const YAML::Node& node, const std::string& place, int depth) {
    Value map = Value::map(place);
    std::unordered_map<std::string, std::string> seen;
    for (const auto& entry : node) {
      const YAML::Node &key = entry.first, &value = entry.second;
      const std::string here = place_of_(key.Mark());
      if (!key.IsScalar()) throw InputError("a key is not a name", here, "Write KEY: VALUE");
      const auto [first, is_new] = seen.emplace(key.Scalar(), here);
      if (!is_new)
        throw InputError(fmt::format("the key \"{}\" is given twice, first at {}", shown(key.Scalar()), first->second), here,
                         "Remove one");
      map.insert(key.Scalar(), copy(value, here, depth + 1));
    }
    return map;
  }

  std::function<std::string(const YAML::Mark&)> place_of_;
  long count_ = 0;
};

std::string line_of(const std::string& text, int line) {
  std::size_t start = 0;
  for (; line > 0 && start != std::string::npos; --line) {
    start = text.find('\n', start);
    if (start != std::string::npos) ++start;
  }
  return start == std::string::npos ? "" : text.substr(start, text.find('\n', start) - start);
}

std::string syntax_remedy(const std::string& line) {
  const std::string indent = line.substr(0, line.find_first_not_of(" \t"));
  if (indent.find('\t') != std::string::npos) return "Indent with blanks instead of tabs";
  return "Check brackets, quotes and indentation; quote expressions with \"?\" and \":\"";
}

/// yaml-cpp counts a mark's lines from 0, and leaves it out for what is not in the text.
std::string place_in(const std::string& source, const YAML::Mark& mark) {
  return mark.is_null() || mark.line < 0 ? source : fmt::format("{}:{}", source, mark.line + 1);
}

Value parse(const std::string& text, const std::string& source, const std::function<std::string(const YAML::Mark&)>& place_of) {
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(text);
    if (documents.size() > 1)
      throw InputError("a second document starts", place_of(documents[1].Mark()), "Remove the line \"---\" between them");
    return documents.empty() ? Value::map(source) : Copier(place_of).copy(documents[0], place_of(YAML::Mark()));
  } catch (const YAML::Exception& error) {
    const bool deep = dynamic_cast<const YAML::DeepRecursion*>(&error) != nullptr;
    throw InputError(fmt::format("this is not YAML: {}", deep ? "the nesting is too deep" : error.msg), place_of(error.mark),
                     syntax_remedy(line_of(text, error.mark.line)));
  }
}

bool only_scalars(const Value& value) {
  return value.is_scalar() || value.is_null() || (value.is_list() && std::ranges::all_of(value.items, only_scalars));
}

void emit(YAML::Emitter& out, const Value& value) {
  switch (value.kind) {
    case Value::Kind::null:
      out << YAML::Null;
      break;
    case Value::Kind::scalar:
      out << value.text;
      break;
    case Value::Kind::list:
      out << (only_scalars(value) ? YAML::Flow : YAML::Block) << YAML::BeginSeq;
      for (const Value& item : value.items) emit(out, item);
      out << YAML::EndSeq;
      break;
    case Value::Kind::map:
      out << YAML::Block << YAML::BeginMap;
      for (std::size_t i = 0; i < value.items.size(); ++i) {
        out << YAML::Key << value.keys[i] << YAML::Value;
        emit(out, value.items[i]);
      }
      out << YAML::EndMap;
      break;
  }
}

}  // namespace

Value parse_yaml(const std::string& text, const std::string& source) {
  if (const auto i = text.find('\0'); i != std::string::npos)
    throw InputError("a null character", fmt::format("{}:{}", source, 1 + std::count(text.begin(), text.begin() + i, '\n')),
                     "A scene is a text file");
  return parse(text, source, [&](const YAML::Mark& mark) { return place_in(source, mark); });
}

Value parse_yaml_value(const std::string& text, const std::string& place) {
  Value value = parse(text, place, [&](const YAML::Mark&) { return place; });
  return value.is_map() && value.items.empty() && text.find('{') == std::string::npos ? Value::nothing(place) : value;
}

std::string emit_yaml(const Value& value) {
  YAML::Emitter out;
  out.SetIndent(2);
  emit(out, value);
  return std::string(out.c_str()) + "\n";
}

std::string describe(const Value& value) {
  switch (value.kind) {
    case Value::Kind::null:
      return "nothing";
    case Value::Kind::scalar:
      return fmt::format("\"{}\"", shown(value.text, 80));
    case Value::Kind::list:
      return fmt::format("a list of length {}", value.items.size());
    case Value::Kind::map:
      return "a map";
  }
  return "";
}

}  // namespace polyslip::scene
