#include "polyslip/scene/document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "polyslip/common/error.hpp"
#include "polyslip/common/suggest.hpp"

namespace polyslip::scene {

bool is_infinity(const std::string& text) { return text == "infinity" || text == ".inf"; }

std::string where(const Value& value, const std::string& path) {
  return path.empty() ? value.place : fmt::format("{} ({})", value.place, shown(path));
}

namespace {

bool is_name(const std::string& text) {
  const auto inside = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; };
  return !text.empty() && std::isdigit(static_cast<unsigned char>(text[0])) == 0 && std::ranges::all_of(text, inside);
}

bool is_word(const std::string& text) {
  const auto inside = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-' || c == '.'; };
  return !text.empty() && std::ranges::all_of(text, inside);
}

/// Folder names may hold blanks; names of runs do not.
std::string folder_name(const std::filesystem::path& file) {
  std::string name = std::filesystem::absolute(file).parent_path().filename().string();
  std::ranges::replace_if(
      name, [](char c) { return !is_word(std::string(1, c)); }, '_');
  return name.empty() ? "scene" : name;
}

/// Whether a scene as it was given computes displacements: it speaks of them, or does not speak of flow.
bool asks_for_mechanics(const Value& root) {
  if (root.find("flow") == nullptr || root.find("mechanics") != nullptr || root.find("contact") != nullptr) return true;
  const Value* materials = root.find("materials");
  return materials != nullptr && std::ranges::any_of(materials->items, [](const Value& rule) {
           return std::ranges::any_of(elastic_keys, [&](const char* key) { return rule.find(key) != nullptr; });
         });
}

/// Walks the tree along the schema: checks each value, orders the keys and inserts defaults.
class Completer {
 public:
  Completer(Document& document, const std::filesystem::path& file) : document_(document), file_(file) {}

  void run() {
    Value& root = document_.root;
    if (root.is_map() && root.find("name") == nullptr) root.insert("name", standard(folder_name(file_)));
    has_flow_ = root.find("flow") != nullptr;
    has_mechanics_ = asks_for_mechanics(root);
    has_contact_ = has_mechanics_ && (root.find("contact") != nullptr || root.find("fractures") != nullptr);
    learn_dimension_from_box(root);
    warns_ = root.find("exact") == nullptr;
    group(root, "", "");
  }

 private:
  [[nodiscard]] Value standard(const std::string& text) const { return Value::scalar(text, file_.string() + ", default"); }

  [[noreturn]] static void refuse(const Value& value, const std::string& path, const std::string& what, const std::string& remedy) {
    throw InputError(what, where(value, path), remedy);
  }

  void learn_dimension_from_box(const Value& root) {
    const Value* value = &root;
    for (const char* key : {"mesh", "box", "min"}) {
      value = value->find(key);
      if (value == nullptr) return;
    }
    if (value->is_list()) learn_dimension(*value, "mesh.box.min");
  }

  void learn_dimension(const Value& list, const std::string& path) {
    const auto length = static_cast<int>(list.items.size());
    if (length != 2 && length != 3)
      refuse(list, path, fmt::format("a list of length {}", list.items.size()), "Give 2 components in 2D, 3 in 3D");
    document_.dim = length;
    document_.dim_place = where(list, path);
  }

  // Maps

  void group(Value& value, const std::string& path, const std::string& pattern) {
    if (!value.is_map())
      refuse(value, path, describe(value) + " where a map of keys belongs",
             path.empty() ? "Write KEY: VALUE lines" : fmt::format("Write {}: {{KEY: VALUE, ...}}", path));
    const std::vector<const Key*> keys = keys_below(pattern);
    for (std::size_t i = 0; i < value.keys.size(); ++i) {
      const bool known = std::ranges::any_of(keys, [&](const Key* key) { return last_name(key->path) == value.keys[i]; });
      if (!known)
        refuse(value.items[i], join_path(path, value.keys[i]), fmt::format("unknown key \"{}\"", shown(value.keys[i])),
               propose_key(pattern, path, value.keys[i]));
    }
    Value ordered = Value::map(value.place);
    for (const Key* key : keys) take(value, *key, path, ordered);
    value = std::move(ordered);
  }

  /// Moves the child of `from` that `key` describes, or its default, into `ordered` and completes it.
  void take(Value& from, const Key& key, const std::string& path, Value& ordered) {
    const std::string name = last_name(key.path), child_path = join_path(path, name);
    Value* given = from.find(name);
    if (given == nullptr && key.standard == required)
      refuse(from, child_path, fmt::format("the key \"{}\" is missing", child_path),
             fmt::format("It is: {}. {}", type_text(key), key.help));
    Value child = given != nullptr ? std::move(*given) : default_of(key, ordered, from);
    if (given == nullptr && child.is_null()) return;
    any_value(child, child_path, key);
    ordered.insert(name, std::move(child));
  }

  /// Null when there is none. `siblings` are the keys before this one, `from` holds those after it as they were given.
  [[nodiscard]] Value default_of(const Key& key, const Value& siblings, const Value& from) const {
    if (key.standard == absent) return {};
    if (key.standard == "{}") return Value::map(file_.string());
    const std::string text = key.standard.front() == '(' ? found_default(key, siblings, from) : key.standard;
    if (text.empty() || (key.shape == Shape::vector && document_.dim == 0)) return {};
    if (key.kind == Kind::group) return Value::map(file_.string());
    if (key.shape != Shape::vector) return standard(text);
    Value list = Value::nothing(standard(text).place);
    list.kind = Value::Kind::list;
    list.items.assign(static_cast<std::size_t>(document_.dim), standard(text));
    return list;
  }

  /// Defaults that depend on other keys (in brackets in the table); empty for none.
  [[nodiscard]] std::string found_default(const Key& key, const Value& siblings, const Value& from) const {
    if (key.path == "mesh.box.shape") return document_.dim == 2 ? "quads" : "hexahedra";
    if (key.path == "mesh.box.cells") {
      const Value* grading = from.find("grading");
      return grading != nullptr && static_cast<int>(grading->keys.size()) == document_.dim ? "1" : "";
    }
    if (key.path == "time.step") {
      const double span = constant(*siblings.find("end")) - constant(*siblings.find("start"));
      return span > 0 ? fmt::format("{}", span) : "";
    }
    if (key.path == "time.smallest_step" || key.path == "time.largest_step") {
      const Value* step = siblings.find("step");
      if (step == nullptr) return "";
      return fmt::format("{}", constant(*step) / (key.path == "time.largest_step" ? 1 : 1024));
    }
    if (key.path == "initial.equilibrium") return has_flow_ && has_contact_ ? "true" : "false";
    const bool there = (key.path == "mechanics" && has_mechanics_) || (key.path == "contact" && has_contact_) ||
                       (key.path == "fluid" && has_flow_) || (key.path == "initial" && has_flow_ && has_mechanics_);
    return there ? "{}" : "";
  }

  [[nodiscard]] double constant(const Value& value) const { return constant_value(value.text, document_.study, value.place); }

  void names(Value& value, const std::string& path, const Key& key) {
    if (!value.is_map())
      refuse(value, path, describe(value) + " where a map of names belongs", fmt::format("Write {}: {{NAME: VALUE}}", path));
    const Key& entry = *find_key(key.path + ".*");
    for (std::size_t i = 0; i < value.keys.size(); ++i) {
      const std::string& name = value.keys[i];
      const std::string child_path = join_path(path, name);
      if (!key.choices.empty()) {
        if (std::ranges::find(key.choices, name) == key.choices.end())
          refuse(value.items[i], child_path, fmt::format("unknown name \"{}\"", name), did_you_mean(name, key.choices));
      } else {
        check_new_name(value.items[i], child_path, name);
      }
      any_value(value.items[i], child_path, entry);
      if (entry.kind == Kind::number) define_number(name, value.items[i]);
    }
    // Compiled only now, so that a name used before its definition can be told from an unknown one.
    if (entry.kind == Kind::expression) define_expressions(value, path);
  }

  void check_new_name(const Value& value, const std::string& path, const std::string& name) const {
    if (!is_name(name))
      refuse(value, path, fmt::format("\"{}\" cannot be a name", shown(name)), "Use letters, digits and \"_\", a letter first");
    if (std::ranges::find(expression_names(), name) != expression_names().end())
      refuse(value, path, fmt::format("\"{}\" already means something in expressions", name), "Choose another name");
    if (document_.numbers.contains(name))
      refuse(value, path, fmt::format("\"{}\" is already a study number", name), "Choose another name");
  }

  void define_number(const std::string& name, const Value& value) {
    document_.numbers[name] = constant_value(value.text, document_.study, value.place);
    document_.study.items.emplace_back(name, value.text);
    document_.definitions.items.emplace_back(name, value.text);
  }

  void define_expressions(const Value& value, const std::string& path) {
    for (std::size_t i = 0; i < value.keys.size(); ++i)
      document_.definitions.items.emplace_back(value.keys[i], value.items[i].text);
    for (std::size_t i = 0; i < value.keys.size(); ++i)
      Expression(value.keys[i], document_.definitions, where(value.items[i], join_path(path, value.keys[i])));
  }

  // Shapes

  void any_value(Value& value, const std::string& path, const Key& key) {
    if (value.is_null()) refuse(value, path, "the key has no value", "Write one, or remove the key");
    switch (key.shape) {
      case Shape::one:
        return single(value, path, key);
      case Shape::one_or_more:
        return value.is_list() ? list(value, path, key) : single(value, path, key);
      case Shape::list:
        return list(value, path, key);
      case Shape::pair:
        if (value.is_list() && value.items.size() != 2)
          refuse(value, path, fmt::format("{} values", value.items.size()), "Give two: [FROM, TO]");
        return list(value, path, key);
      case Shape::vector:
      case Shape::vector_free:
        return vector(value, path, key);
      case Shape::matrix:
      case Shape::points:
        return rows(value, path, key);
      case Shape::tensor:
        return tensor(value, path, key);
    }
  }

  void tensor(Value& value, const std::string& path, const Key& key) {
    if (!value.is_list()) return single(value, path, key);
    if (std::ranges::none_of(value.items, &Value::is_list)) return vector(value, path, key);
    check_length(value, path, type_text(key));
    Key beside = key;  // Entries beside the diagonal have no range.
    beside.range = {};
    for (std::size_t i = 0; i < value.items.size(); ++i) {
      check_length(value.items[i], fmt::format("{}[{}]", path, i), "row of the matrix");
      for (std::size_t j = 0; j < value.items.size(); ++j)
        required_entry(value.items[i].items[j], fmt::format("{}[{}][{}]", path, i, j), i == j ? key : beside);
    }
  }

  void required_entry(Value& value, const std::string& path, const Key& key) {
    if (value.is_null()) refuse(value, path, "the component has no value", "Write one");
    single(value, path, key);
  }

  void list(Value& value, const std::string& path, const Key& key) {
    if (!value.is_list())
      refuse(value, path, fmt::format("{} where a list belongs", describe(value)), fmt::format("Write [...]: {}", type_text(key)));
    if (value.items.empty()) refuse(value, path, "an empty list", "Give an entry, or remove the key");
    for (std::size_t i = 0; i < value.items.size(); ++i) {
      const std::string item_path = fmt::format("{}[{}]", path, i);
      if (value.items[i].is_null()) refuse(value.items[i], item_path, "the entry has no value", "Write one, or remove the entry");
      single(value.items[i], item_path, key);
    }
  }

  void vector(Value& value, const std::string& path, const Key& key) {
    check_length(value, path, type_text(key));
    for (std::size_t i = 0; i < value.items.size(); ++i) {
      const std::string item_path = fmt::format("{}[{}]", path, i);
      if (key.shape != Shape::vector_free || !value.items[i].is_null()) required_entry(value.items[i], item_path, key);
    }
  }

  void rows(Value& value, const std::string& path, const Key& key) {
    if (key.shape == Shape::matrix) check_length(value, path, type_text(key));
    if (!value.is_list() || value.items.size() < 2)
      refuse(value, path, fmt::format("{} where a list of at least two points belongs", describe(value)),
             "Write [[X, Y], [X, Y], ...]");
    for (std::size_t i = 0; i < value.items.size(); ++i) vector(value.items[i], fmt::format("{}[{}]", path, i), key);
  }

  void check_length(const Value& value, const std::string& path, const std::string& type) {
    if (!value.is_list())
      refuse(value, path, fmt::format("{} where a list belongs", describe(value)), fmt::format("Write a {}", type));
    if (document_.dim == 0) learn_dimension(value, path);
    if (static_cast<int>(value.items.size()) != document_.dim)
      refuse(value, path, fmt::format("a list of length {} in a scene in {}D", value.items.size(), document_.dim),
             fmt::format("Give {} components; the dimension is told by {}", document_.dim, document_.dim_place));
  }

  // Single values

  void single(Value& value, const std::string& path, const Key& key) {
    if (key.kind == Kind::group) return group(value, path, key.path + (key.shape == Shape::list ? "[]" : ""));
    if (key.kind == Kind::names) return names(value, path, key);
    if (!value.is_scalar())
      refuse(value, path, fmt::format("{} where one value belongs", describe(value)), "The key is: " + type_text(key));
    switch (key.kind) {
      case Kind::choice:
        if (std::ranges::find(key.choices, value.text) == key.choices.end())
          refuse(value, path, fmt::format("unknown value {}", describe(value)), did_you_mean(value.text, key.choices));
        break;
      case Kind::word:
        if (!is_word(value.text))
          refuse(value, path, fmt::format("{} is not a word", describe(value)), "Use letters, digits, \"_\", \"-\" and \".\"");
        break;
      case Kind::file:
        if (value.text.empty()) refuse(value, path, "an empty file name", "Write one, or remove the key");
        value.text = (std::filesystem::absolute(file_).parent_path() / value.text).lexically_normal().string();
        break;
      case Kind::number:
      case Kind::count:
        number(value, path, key);
        break;
      case Kind::expression:
        if (key.path != "define.*") expression(value, path, key);  // Definitions are compiled together.
        break;
      default:
        break;
    }
  }

  void number(const Value& value, const std::string& path, const Key& key) const {
    const double number = constant_value(value.text, document_.study, where(value, path));
    if (key.kind == Kind::count && number != std::floor(number))
      refuse(value, path, fmt::format("{} is not a whole number", number), "Give a whole number");
    check_range(number, value, path, key);
  }

  void expression(const Value& value, const std::string& path, const Key& key) const {
    if (key.may_be_infinite && is_infinity(value.text)) return;
    const Expression parsed(value.text, document_.definitions, where(value, path));
    if (parsed.is_constant()) return check_range(parsed({}), value, path, key);
    const bool takes_time = key.uses == Uses::time || key.uses == Uses::time_and_fracture;
    const bool knows_fractures = key.uses == Uses::fracture || key.uses == Uses::time_and_fracture;
    if (!takes_time && parsed.depends_on_time())
      refuse(value, path, fmt::format("{} depends on time", describe(value)), "Use position only: it is evaluated once");
    if (!knows_fractures && parsed.depends_on_fracture())
      refuse(value, path, fmt::format("{} depends on tip_distance or fracture_length", describe(value)),
             "These have a meaning on fractures only: use position");
  }

  void check_range(double number, const Value& value, const std::string& path, const Key& key) const {
    if (!key.range.holds(number))
      refuse(value, path, fmt::format("{} is out of range", number), fmt::format("It must be {}", key.range.text()));
    if (warns_ && !key.usual.holds(number))
      document_.warnings.push_back(fmt::format("{}: {:g} {} is unusual: check the unit, which is SI. Usual are {:g} to {:g}",
                                               where(value, path), number, key.unit, key.usual.low, key.usual.high));
  }

  Document& document_;
  const std::filesystem::path& file_;
  bool has_flow_ = false, has_mechanics_ = true, has_contact_ = false;
  bool warns_ = true;  ///< Not of scenes with an exact solution, which may be in units of their own.
};

}  // namespace

Document complete(Value root, const std::filesystem::path& file) {
  Document document;
  document.root = std::move(root);
  Completer(document, file).run();
  return document;
}

// The typed view

Cursor Cursor::operator[](const std::string& key) const {
  const Value* child = value_ != nullptr ? value_->find(key) : nullptr;
  return {*document_, child, join_path(path_, key), value_ != nullptr ? value_ : parent_};
}

std::vector<Cursor> Cursor::entries() const {
  std::vector<Cursor> result;
  if (value_ == nullptr) return result;
  if (!value_->is_list()) return {*this};
  for (std::size_t i = 0; i < value_->items.size(); ++i)
    result.push_back({*document_, &value_->items[i], fmt::format("{}[{}]", path_, i), value_});
  return result;
}

double Cursor::number() const { return constant_value(text(), document_->study, where()); }

Expression Cursor::expression() const { return {text(), document_->definitions, where()}; }

Expression Cursor::expression_within(const std::string& before, const std::string& after) const {
  return {before + text() + after, document_->definitions, where()};
}

std::optional<Expression> Cursor::optional_expression() const { return *this ? std::optional(expression()) : std::nullopt; }

Vec3 Cursor::point() const {
  Vec3 result = Vec3::Zero();
  const std::vector<Cursor> components = entries();
  for (std::size_t i = 0; i < components.size(); ++i) result[static_cast<Eigen::Index>(i)] = components[i].number();
  return result;
}

std::array<Expression, 3> Cursor::expressions() const {
  std::array<Expression, 3> result;
  const std::vector<Cursor> components = entries();
  for (std::size_t i = 0; i < components.size(); ++i) result[i] = components[i].expression();
  return result;
}

std::array<Expression, 6> Cursor::tensor() const {
  std::array<Expression, 6> result;
  const std::vector<Cursor> rows = entries();
  if (!value_->is_list()) return {expression(), expression(), expression()};
  for (std::size_t i = 0; i < rows.size(); ++i)
    result[i] = rows[i].value_->is_list() ? rows[i].entries()[i].expression() : rows[i].expression();
  if (!rows[0].value_->is_list()) return result;
  result[3] = rows[0].entries()[1].expression();
  if (rows.size() == 3) {
    result[4] = rows[1].entries()[2].expression();
    result[5] = rows[0].entries()[2].expression();
  }
  return result;
}

std::array<std::optional<Expression>, 3> Cursor::optional_expressions() const {
  std::array<std::optional<Expression>, 3> result;
  const std::vector<Cursor> components = entries();
  for (std::size_t i = 0; i < components.size(); ++i) result[i] = components[i].optional_expression();
  return result;
}

}  // namespace polyslip::scene
