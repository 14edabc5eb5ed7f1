#include "polyslip/scene/schema.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "polyslip/scene/scene.hpp"
#include "scene_support.hpp"

namespace polyslip::scene {
namespace {

TEST(schema, keys_are_unique_and_follow_their_parents) {
  std::set<std::string> seen{""};
  for (const Key& key : all_keys()) {
    const auto dot = key.path.rfind('.');
    std::string parent = dot == std::string::npos ? "" : key.path.substr(0, dot);
    if (parent.ends_with("[]")) parent.resize(parent.size() - 2);
    EXPECT_TRUE(seen.contains(parent)) << key.path;
    EXPECT_TRUE(seen.insert(key.path).second) << key.path;
  }
}

TEST(schema, choices_hold_their_default) {
  for (const Key& key : all_keys()) {
    if (key.kind != Kind::choice) continue;
    EXPECT_FALSE(key.choices.empty()) << key.path;
    const bool told = !key.standard.empty() && key.standard.front() != '(';
    EXPECT_TRUE(!told || std::ranges::find(key.choices, key.standard) != key.choices.end()) << key.path;
  }
}

TEST(schema, keeps_the_names_that_checks_rely_on) {
  for (const std::string path :
       {"mesh.box.min", "mesh.box.max", "mesh.box.cells", "mesh.box.shape", "mesh.file", "mechanics.stabilisation",
        "mechanics.bubbles", "contact.beta_scale", "contact.formulation", "time.end", "time.step", "output.every", "study.*"})
    EXPECT_NE(find_key(path), nullptr) << path;
}

TEST(help, shows_every_key_with_a_sentence_in_lines_that_fit) {
  const std::string text = help_text();
  for (const Key& key : all_keys()) {
    EXPECT_TRUE(contains(text, "\n" + key.path + ": ")) << key.path;
    EXPECT_TRUE(key.help.size() > 3 && key.help.back() == '.') << key.path;
  }
  for (std::size_t start = 0; start < text.size(); start = text.find('\n', start) + 1)
    EXPECT_LE(text.find('\n', start) - start, 150U) << text.substr(start, 40);
  EXPECT_TRUE(contains(text, "contact.beta_scale: number [(2mu+lambda)/h_K], > 0, default 0.02\n"));
}

TEST(ranges, are_open_unless_they_say_equal) {
  const Range open{.low = 0, .high = 1}, closed{.low = 0, .high = 1, .or_equal = true};
  EXPECT_FALSE(open.holds(0));
  EXPECT_TRUE(closed.holds(0));
  EXPECT_TRUE(open.holds(0.5));
  EXPECT_FALSE(closed.holds(1));
  EXPECT_EQ(open.text(), "> 0 and < 1");
  EXPECT_EQ(closed.text(), ">= 0 and < 1");
  EXPECT_EQ(Range{}.text(), "");
}

}  // namespace
}  // namespace polyslip::scene
