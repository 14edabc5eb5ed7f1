// What the tests of scenes share.
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "polyslip/common/error.hpp"
#include "polyslip/scene/scene.hpp"

namespace polyslip::scene {

/// A scene in 2D with nothing in it that has a default. Six lines.
inline const std::string smallest = R"(mesh:
  box: {min: [0, 0], max: [1, 1], cells: [4, 4]}
materials:
  - {young: 1e9, poisson: 0.25}
mechanics:
  boundary: [{on: bottom, displacement: [0, 0]}]
)";

inline Scene parse(const std::string& text, const std::vector<std::string>& overrides = {}) {
  return parse_scene(text, "dir/scene.yaml", overrides);
}

/// The message that a scene provokes; empty when it provokes none.
inline std::string refusal(const std::string& text, const std::vector<std::string>& overrides = {}) {
  try {
    parse(text, overrides);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

/// `text` with the first `from` replaced; a test that replaces nothing fails.
inline std::string with(std::string text, const std::string& from, const std::string& to) {
  const auto i = text.find(from);
  if (i == std::string::npos) throw std::logic_error("the test replaces what is not there: " + from);
  return text.replace(i, from.size(), to);
}

inline bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

}  // namespace polyslip::scene
