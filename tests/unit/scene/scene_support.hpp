// What the tests of scenes share.
#pragma once

#include <gtest/gtest.h>

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

/// Flow in deforming, fractured rock: each key of flow once, but those that exclude others. 37 lines.
inline const std::string coupled = R"YAML(study: {k: 1e-15}
mesh:
  box: {min: [0, 0], max: [2, 1], cells: [8, 4]}
fractures:
  - {name: fault, points: [[0.5, 0.5], [1.5, 0.5]]}
  - {name: joint, points: [[1, 0], [1, 0.25]]}
materials:
  - {young: 1e10, poisson: 0.2, permeability: [k, "k/2"], biot: 0.8, biot_modulus: 1e10}
  - {region: rock, where: y < 0.5, permeability: [[2*k, "0.1*k"], ["0.1*k", k]], biot_modulus: infinity}
  - {where: x > 1, storage: "1e-10*(1+x)"}
mechanics:
  bubbles: all
  boundary: [{on: bottom, displacement: [0, 0]}]
contact: {friction: 0.6}
fluid: {viscosity: 2e-3, compressibility: 4e-10}
flow:
  conductivities: current
  initial_pressure: 1e5 + x
  reference_pressure: 1e4*(1 - y)
  boundary:
    - {on: [left, top], pressure: 1e5*t}
    - {on: right, name: inlet, where: y > 0.5, flux: -1e-6}
  sources:
    - {region: rock, rate: 1e-9}
    - {fracture: all, rate: tip_distance}
  wells:
    - {name: injector, at: [0.9, 0.5], fracture: fault, rate: 1e-6*t}
    - {name: producer, at: [1.9, 0.9], rate: -1e-6}
  fractures:
    contact_aperture: 1e-4*sqrt(tip_distance/fracture_length)
    dilation_angle: 3
    fractures:
      - {name: joint, permeability: 1e-9, normal_permeability: 1e-12, dilation: 0, barrier: true}
initial: {stress: {yy: -1e6*(1 - y), xy: 2e5}}
time: {start: 0, end: 100, step: 10, smallest_step: 0.1, largest_step: 20, outputs: [25, 75.5]}
output: {every: 4, checkpoint_every: 3, lines: [{name: middle, from: [0, 0.5], to: [2, 0.5], points: 5}]}
exact: {pressure: x + t, flux: [1, -t], displacement: [x, y]}
)YAML";

/// Flow in rigid rock with nothing in it that has a default. Five lines.
inline const std::string rigid = R"(mesh:
  box: {min: [0, 0], max: [1, 1], cells: [4, 4]}
materials:
  - {permeability: 1e-14}
flow: {boundary: [{on: left, pressure: 0}]}
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

struct Case {
  std::string from, to;  ///< What is changed in the scene.
  std::string place;     ///< "LINE (KEY)".
  std::string message;   ///< What the message says besides.
};

inline void expect_refusals(const std::string& text, const std::vector<Case>& cases) {
  ASSERT_EQ(refusal(text), "");
  for (const Case& c : cases) {
    const std::string message = refusal(with(text, c.from, c.to));
    EXPECT_TRUE(message.starts_with("dir/scene.yaml" + c.place + ": ")) << c.to << "\n  gives " << message;
    EXPECT_TRUE(contains(message, c.message)) << c.to << "\n  gives " << message << "\n  without " << c.message;
  }
}

}  // namespace polyslip::scene
