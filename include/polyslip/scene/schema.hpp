// The keys of a scene: one table that drives validation, defaults, overrides, the resolved scene and the help text.
#pragma once

#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace polyslip::scene {

/// What one value is.
enum class Kind {
  group,       ///< A map of the keys below it.
  names,       ///< A map of free names; one entry "*" below it.
  text,        ///< Any text.
  word,        ///< Letters, digits, "_", "-" and ".".
  file,        ///< A file, relative to the scene's folder.
  choice,      ///< One of `choices`.
  number,      ///< A constant expression of study numbers.
  count,       ///< The same, a whole number.
  expression,  ///< Of position, time, study numbers and definitions.
};

/// How many of them.
enum class Shape {
  one,
  one_or_more,  ///< One, or a list of at least one.
  list,         ///< A list of at least one.
  pair,         ///< Two.
  vector,       ///< One an axis: the list's length is the dimension of the scene.
  vector_free,  ///< The same; null leaves a component out.
  matrix,       ///< A list of vectors, one an axis.
  tensor,       ///< One, a vector (the diagonal) or a matrix.
  points,       ///< A list of at least two vectors.
};

/// Open interval of admissible values; `or_equal` admits the lower end, `or_high` the upper one.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool or_equal = false, or_high = false;
  [[nodiscard]] bool holds(double value) const {
    return (value > low || (or_equal && value == low)) && (value < high || (or_high && value == high));
  }
  [[nodiscard]] std::string text() const;  ///< "> 0", "> -1 and < 0.5"; empty when all is admissible.
};

/// What an expression may use beside position, study numbers and definitions.
enum class Uses { time, nothing, fracture, time_and_fracture };

struct Key {
  std::string path;  ///< "mesh.box.min"; "[]" is any entry of a list, "*" any name.
  Kind kind = Kind::text;
  Shape shape = Shape::one;
  std::string unit = {};  ///< SI; empty for none.
  std::string standard =
      {};  ///< Default as YAML text ("{}": a group that is always there), `required`, `absent`, or in (brackets) how it is found.
  std::string help = {};  ///< One sentence.
  Range range = {};  ///< Of diagonal entries, for a tensor.
  std::vector<std::string> choices = {};
  Uses uses = Uses::time;
  Range usual = {};  ///< Of rock; a value outside of it is taken, with a warning.
  bool may_be_infinite = false;  ///< "infinity" or ".inf" in place of an expression.
};

inline constexpr std::string_view required = "!";
inline constexpr std::string_view absent = "";

/// All keys, parents before children, in the order of the resolved scene.
std::span<const Key> all_keys();

/// The key of a pattern path, or null.
const Key* find_key(const std::string& pattern);

/// Keys directly below a group's pattern ("" for the scene).
std::vector<const Key*> keys_below(const std::string& pattern);

/// Pattern of a child: "mesh" + "box" -> "mesh.box".
std::string join_path(const std::string& parent, const std::string& child);

/// Last part of a pattern.
std::string last_name(const std::string& pattern);

/// Remedy for an unknown `name` below `pattern`, which is `path` in the scene: the nearest sibling, a key of that name elsewhere,
/// or what is known here.
std::string propose_key(const std::string& pattern, const std::string& path, const std::string& name);

/// "vector of numbers [m]" and the like.
std::string type_text(const Key& key);

}  // namespace polyslip::scene
