// A scene's tree after overrides, checked against the schema and completed by its defaults; and the typed view that fills structs
// from it.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "polyslip/common/expression.hpp"
#include "polyslip/common/types.hpp"
#include "polyslip/scene/schema.hpp"
#include "polyslip/scene/value.hpp"

namespace polyslip::scene {

/// Every value in it has the type, shape and range that the schema asks for; keys stand in the schema's order.
struct Document {
  Value root;
  Definitions study;                      ///< Numbers only.
  Definitions definitions;                ///< Study numbers, then named expressions.
  std::map<std::string, double> numbers;  ///< Values of the study numbers.
  int dim = 0;                            ///< 0 when no vector tells.
  std::string dim_place;                  ///< Which one tells.
  std::vector<std::string> warnings;      ///< Values that are possible and unusual, each in a sentence with its place.
};

/// Keys of a material, any of which asks for mechanics; and those that ask for flow.
inline constexpr std::array elastic_keys{"young", "poisson", "lame_mu", "lame_lambda"};
inline constexpr std::array hydraulic_keys{"permeability", "biot", "biot_modulus", "storage"};

/// "infinity", and what YAML calls so.
bool is_infinity(const std::string& text);

/// "scene.yaml:12 (mesh.box.cells)".
std::string where(const Value& value, const std::string& path);

/// Applies "KEY=VALUE" to the tree; VALUE is YAML, except that for a key of one text, number or expression it is taken as it
/// stands; null removes a key. Throws InputError for a key that the schema does not know, with the nearest it knows.
void apply_override(Value& root, const std::string& argument);

/// Checks and completes a tree read from `file`.
/// Throws InputError: unknown, repeated or missing keys, wrong types, shapes, ranges and choices, expressions that do not compile.
Document complete(Value root, const std::filesystem::path& file);

/// Reads one value of a complete document; missing keys give nothing, everything else has been checked.
class Cursor {
 public:
  explicit Cursor(const Document& document) : Cursor(document, &document.root, "") {}

  explicit operator bool() const { return value_ != nullptr && !value_->is_null(); }
  [[nodiscard]] Cursor operator[](const std::string& key) const;
  [[nodiscard]] int dim() const { return document_->dim; }     ///< Of the scene; 0 when nothing tells.
  [[nodiscard]] bool is_list() const { return value_ != nullptr && value_->is_list(); }
  [[nodiscard]] std::vector<Cursor> entries() const;  ///< Of a list; one value is a list of one, nothing an empty one.
  [[nodiscard]] std::vector<std::string> keys() const { return value_ != nullptr ? value_->keys : std::vector<std::string>{}; }

  /// Place and path, for messages; of a missing key, the place of what it is missing from.
  [[nodiscard]] std::string where() const { return scene::where(value_ != nullptr ? *value_ : *parent_, path_); }
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] const std::string& place() const { return value_ != nullptr ? value_->place : parent_->place; }

  [[nodiscard]] std::string text() const { return value_ != nullptr ? value_->text : ""; }
  [[nodiscard]] double number() const;
  [[nodiscard]] bool is_true() const { return text() == "true"; }
  [[nodiscard]] Expression expression() const;
  [[nodiscard]] bool is_infinite() const { return is_infinity(text()); }
  /// Of its text in a formula: ("1/(", ")") gives one over it.
  [[nodiscard]] Expression expression_within(const std::string& before, const std::string& after) const;
  [[nodiscard]] std::optional<Expression> optional_expression() const;
  [[nodiscard]] Vec3 point() const;
  /// Components not given are zero.
  [[nodiscard]] std::array<Expression, 3> expressions() const;
  /// xx yy zz xy yz xz of a scalar, a diagonal or a matrix (of which it takes the upper half).
  [[nodiscard]] std::array<Expression, 6> tensor() const;
  [[nodiscard]] std::array<std::optional<Expression>, 3> optional_expressions() const;

 private:
  Cursor(const Document& document, const Value* value, std::string path, const Value* parent = nullptr)
      : document_(&document), value_(value), parent_(parent), path_(std::move(path)) {}

  const Document* document_;
  const Value* value_;
  const Value* parent_;
  std::string path_;
};

}  // namespace polyslip::scene
