#include "polyslip/common/expression.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numbers>

#include "polyslip/common/error.hpp"

namespace polyslip {
namespace {

const std::string place = "scene.yaml:12 (mechanics.body_force[0])";

double value(const std::string& text, const EvalPoint& at = {}, const Definitions& definitions = {}) {
  return Expression(text, definitions, place)(at);
}

/// The message that `text` provokes; empty when it provokes none.
std::string refusal(const std::string& text, const Definitions& definitions = {}) {
  try {
    Expression(text, definitions, place);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }
#define EXPECT_CONTAINS(text, part) EXPECT_PRED2(contains, text, part)

EvalPoint at(double x, double y, double z, double t = 0) { return {.x = {x, y, z}, .t = t}; }

TEST(expressions, see_position_time_and_the_fracture) {
  EvalPoint point = at(1, 20, 300, 4000);
  point.tip_distance = 5e4;
  point.fracture_length = 6e5;
  EXPECT_EQ(value("x + y + z + t + tip_distance + fracture_length", point), 654321);
}

TEST(expressions, know_the_usual_functions_operators_and_constants) {
  EXPECT_DOUBLE_EQ(value("atan2(1, -1)"), 3 * std::numbers::pi / 4);
  EXPECT_DOUBLE_EQ(value("cos(pi) + exp(1) - _e + log(_e) + ln(_e) + log10(100)"), 3);
  EXPECT_DOUBLE_EQ(value("min(1, 2) + max(1, 2, 3) + abs(-4) + sqrt(9) + sign(-2)"), 10);
  EXPECT_DOUBLE_EQ(value("-2^2 + 2^3^2"), 508);
  EXPECT_DOUBLE_EQ(value("25E9 + .5 + 5. + 1e-3 + +1"), 25000000006.501);
}

TEST(expressions, choose_by_the_ternary) {
  const std::string branches = "x < 0 ? z^4 : x < 1 && z != 0 ? 2*z^4 : 7";
  EXPECT_EQ(value(branches, at(-1, 0, 2)), 16);
  EXPECT_EQ(value(branches, at(0.5, 0, 2)), 32);
  EXPECT_EQ(value(branches, at(1, 0, 2)), 7);
  EXPECT_EQ(value(branches, at(0.5, 0, 0)), 7);
}

TEST(expressions, use_definitions_directly_and_through_others) {
  const Definitions definitions{{{"n", "20"}, {"h", "2/n"}, {"P", "x < 0 ? z^4 : 2*z^4"}, {"Q", "h*P + x"}}};
  EXPECT_DOUBLE_EQ(value("Q + P", at(1, 0, 2), definitions), 0.1 * 32 + 1 + 32);
  EXPECT_DOUBLE_EQ(value("Q + P", at(-1, 0, 2), definitions), 0.1 * 16 - 1 + 16);
}

TEST(expressions, are_constant_unless_they_use_position_or_time) {
  const Definitions definitions{{{"n", "20"}, {"h", "2/n"}, {"r", "x*h"}, {"ramp", "min(1, t/n)"}, {"load", "h*ramp"}}};
  EXPECT_TRUE(Expression("h + sin(1)", definitions, place).is_constant());
  EXPECT_FALSE(Expression("r", definitions, place).is_constant());
  EXPECT_FALSE(Expression("fracture_length", definitions, place).is_constant());
  EXPECT_FALSE(Expression("r", definitions, place).depends_on_time());
  EXPECT_TRUE(Expression("1 + load", definitions, place).depends_on_time());
  EXPECT_TRUE(Expression("t", definitions, place).depends_on_time());
  EXPECT_TRUE(Expression("near", {{{"near", "tip_distance < 1"}}}, place).depends_on_fracture());
  EXPECT_FALSE(Expression("load + r", definitions, place).depends_on_fracture());
  EXPECT_TRUE(Expression("n - 20", definitions, place).is_zero());
  EXPECT_FALSE(Expression("x - x", definitions, place).is_zero());
  EXPECT_TRUE(Expression().is_zero());
  EXPECT_EQ(Expression(2.5)({}), 2.5);
}

TEST(expressions, share_nothing_that_a_copy_could_spoil) {
  Expression copy;
  {
    const Definitions definitions{{{"a", "x + 1"}, {"b", "a*a"}}};
    const Expression original("b + y", definitions, place);
    copy = original;
    EXPECT_EQ(original(at(1, 1, 0)), 5);
  }
  EXPECT_EQ(copy(at(2, 1, 0)), 10);
  EXPECT_EQ(copy(at(1, 1, 0)), 5);
}

TEST(expressions, with_the_same_definitions_follow_each_other_from_point_to_point) {
  Definitions definitions{{{"a", "x + 1"}, {"b", "a*a"}, {"c", "10*t"}}};
  const Expression f("b + c", definitions, place), g("a - c", definitions, place);
  EXPECT_EQ(f(at(1, 0, 0)), 4);
  EXPECT_EQ(g(at(2, 0, 0)), 3);  // a anew, b not
  EXPECT_EQ(f(at(2, 0, 0)), 9);  // b of the same point
  EXPECT_EQ(f(at(2, 0, 0, 1)), 19);
  EXPECT_EQ(g(at(2, 0, 0, 1)), -7);
  definitions.items[0].second = "x + 2";
  EXPECT_EQ(Expression("b", definitions, place)(at(1, 0, 0)), 9);
  EXPECT_EQ(f(at(1, 0, 0)), 4);
}

TEST(expressions, accept_infinite_tip_distances) {
  EvalPoint point;
  point.tip_distance = std::numeric_limits<double>::infinity();
  EXPECT_EQ(value("0.5*(1 + 10*exp(-200*tip_distance^2))", point), 0.5);
}

TEST(refusals, name_place_column_and_the_nearest_name) {
  const std::string message = refusal("2*x + tip_distnce", {{{"P", "x"}}});
  EXPECT_CONTAINS(message, place + ": ");
  EXPECT_CONTAINS(message, "unknown name \"tip_distnce\" at column 7 of the expression \"2*x + tip_distnce\"");
  EXPECT_CONTAINS(message, "Did you mean \"tip_distance\"?");
  EXPECT_CONTAINS(refusal("1 + sqr(2)"), "unknown function \"sqr\" at column 5");
  EXPECT_CONTAINS(refusal("1 + sqr(2)"), "\"sqrt\"");
  EXPECT_CONTAINS(refusal("wavelength", {{{"P", "x"}}}), "Known: x, y, z, t, tip_distance, fracture_length, pi, P");
}

TEST(refusals, keep_the_order_of_definitions) {
  const Definitions definitions{{{"P", "x + Q"}, {"Q", "y"}, {"R", "R + 1"}}};
  EXPECT_CONTAINS(refusal("P", definitions), "\"Q\" used before it is defined at column 5 of the expression \"x + Q\"");
  EXPECT_CONTAINS(refusal("R", definitions), "\"R\" used before it is defined");
  EXPECT_EQ(refusal("Q", definitions), "") << "definitions that are not used are not looked at";
}

TEST(refusals, point_at_errors_of_syntax) {
  EXPECT_CONTAINS(refusal("2*+*x"), "at column 4 of the expression \"2*+*x\"");
  EXPECT_CONTAINS(refusal("x**y"), "at column 3 of");
  EXPECT_CONTAINS(refusal("2 x"), "unexpected variable \"x\" at column 3");
  EXPECT_CONTAINS(refusal("(x"), "missing parenthesis at column 3");
  EXPECT_CONTAINS(refusal("sin()"), "too few parameters for function \"sin\"");
  EXPECT_CONTAINS(refusal("x ? 1"), "missing an else clause");
  EXPECT_CONTAINS(refusal("1e400"), "unexpected token \"1e400\" at column 1");
  EXPECT_CONTAINS(refusal("2 # x"), "at column 3");
  EXPECT_CONTAINS(refusal("1, x"), "a second value at column 2");
  EXPECT_CONTAINS(refusal(""), "the expression is empty");
  EXPECT_CONTAINS(refusal(" \t"), "the expression is empty");
}

TEST(refusals, include_assignments) {
  EXPECT_CONTAINS(refusal("x = 0 ? 1 : 2"), "assignment at column 3");
  EXPECT_CONTAINS(refusal("x = 0 ? 1 : 2"), "Compare with \"==\"");
  EXPECT_EQ(refusal("x == 0 || x >= 1 || x <= -1 || x != 2"), "");
}

TEST(refusals, of_values_that_are_not_finite_name_point_and_time) {
  EXPECT_CONTAINS(refusal("1/0"), "gives inf");
  const Expression root("sqrt(x)", {}, place);
  EXPECT_EQ(root(at(4, 0, 0)), 2);
  try {
    root(at(-1, 0.5, 0, 3));
    FAIL() << "a square root of -1 passed";
  } catch (const InputError& error) {
    EXPECT_CONTAINS(error.what(), place);
    EXPECT_CONTAINS(error.what(), "x = -1, y = 0.5, z = 0, t = 3");
  }
}

TEST(refusals, survive_junk) {
  const std::string junk[] = {std::string(5000, '('),
                              "\xff\xfe\x80",
                              std::string("x\0y", 3),
                              "((((1))))))",
                              "\"a",
                              "'x'",
                              "x..y",
                              "1e",
                              "?:",
                              "===",
                              "x[0]",
                              "${HOME}",
                              std::string(20000, 'x')};
  for (const std::string& text : junk) EXPECT_NE(refusal(text), "") << text.substr(0, 20);
  std::string sum = "x";
  for (int i = 0; i < 500; ++i) sum += "+x";
  EXPECT_EQ(value(sum, at(2, 0, 0)), 1002);
}

TEST(constants, may_use_other_constants_but_nothing_that_varies) {
  const Definitions definitions{{{"n", "20"}, {"h", "2/n"}, {"r", "x*h"}}};
  EXPECT_DOUBLE_EQ(constant_value("sqrt(h*1000) + pi - pi", definitions, place), 10);
  EXPECT_EQ(constant_value("-2.5e3", {}, place), -2500);
  const auto message = [&](const std::string& text) -> std::string {
    try {
      constant_value(text, definitions, place);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_CONTAINS(message("2*x"), "\"x\" varies at column 3 of the expression \"2*x\"");
  EXPECT_CONTAINS(message("r"), "\"x\" varies at column 1 of the expression \"x*h\"");
  EXPECT_CONTAINS(message("m"), "Known: pi, n, h, r");
  EXPECT_CONTAINS(message("1/(n - 20)"), "gives inf");
}

TEST(names, that_expressions_know_are_listed) {
  const auto& names = expression_names();
  for (const std::string name : {"x", "t", "tip_distance", "pi", "atan2", "sqrt"})
    EXPECT_NE(std::find(names.begin(), names.end(), name), names.end()) << name;
}

}  // namespace
}  // namespace polyslip
