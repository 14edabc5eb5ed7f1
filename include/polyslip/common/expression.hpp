// Functions of position and time as a scene writes them ("x < 0 ? z^4 : 2*z^4"), evaluated by muParser.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "polyslip/common/types.hpp"

namespace polyslip {

/// Where and when a function is evaluated. The last two have a meaning on fracture faces only.
struct EvalPoint {
  Vec3 x = Vec3::Zero();       ///< [m]: names x, y, z
  double t = 0;                ///< [s]: name t
  double tip_distance = 0;     ///< Distance to the nearest tip of the fracture [m]: name tip_distance
  double fracture_length = 0;  ///< Length (2D) or square root of the area (3D) of the fracture [m]: name fracture_length
};

/// Named numbers and expressions that other expressions may use, in order: each may use those before it. Names are distinct
/// identifiers, none of expression_names().
struct Definitions {
  std::vector<std::pair<std::string, std::string>> items;  ///< name, expression text

  struct Tape;
  mutable std::shared_ptr<Tape> tape = nullptr;  ///< Their compiled form, for expressions; follows `items`.
};

/// A scalar function. Copies share the compiled form, and all expressions with the same definitions the values of variables and
/// definitions: not for two threads at once. Evaluating costs some tens of ns; so does each definition used (directly or through others),
/// once a point for all expressions that are evaluated there one after the other; constants cost nothing.
class Expression {
 public:
  Expression() : Expression(0.0) {}
  explicit Expression(double constant);
  /// Compiles `text`; `where` names the place in messages ("scene.yaml:12 (mechanics.body_force[0])").
  /// Throws InputError with the position of the error, the names known and the nearest of them for an unknown one.
  Expression(const std::string& text, const Definitions& definitions, const std::string& where);

  /// Throws InputError with place, point and time when the value is not finite.
  double operator()(const EvalPoint& at) const;

  [[nodiscard]] bool is_constant() const;
  [[nodiscard]] bool depends_on_time() const;      ///< Through definitions too.
  [[nodiscard]] bool depends_on_fracture() const;  ///< On tip_distance or fracture_length, through definitions too.
  [[nodiscard]] bool is_zero() const;              ///< A constant equal to 0.
  [[nodiscard]] const std::string& text() const;

 private:
  struct Compiled;
  std::shared_ptr<Compiled> compiled_;
};

/// The value of a text that may use constants, functions and the constant ones of `definitions`, but no position or time.
/// Throws InputError as Expression does.
double constant_value(const std::string& text, const Definitions& definitions, const std::string& where);

/// Names that an expression understands by itself: variables, constants and functions. No definition may take one of them.
const std::vector<std::string>& expression_names();

}  // namespace polyslip
