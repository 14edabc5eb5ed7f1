#include "polyslip/common/suggest.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace polyslip {
namespace {

TEST(edit_distances, count_insertions_deletions_replacements_and_swaps) {
  EXPECT_EQ(edit_distance("young", "young"), 0U);
  EXPECT_EQ(edit_distance("yong", "young"), 1U);
  EXPECT_EQ(edit_distance("younng", "young"), 1U);
  EXPECT_EQ(edit_distance("yound", "young"), 1U);
  EXPECT_EQ(edit_distance("yuong", "young"), 1U);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3U);
  EXPECT_EQ(edit_distance("", "abc"), 3U);
  EXPECT_EQ(edit_distance("Young", "young"), 0U);
}

TEST(suggestions, propose_the_nearest_word_or_list_the_known) {
  const std::vector<std::string> known{"young", "poisson", "lame_mu", "lame_lambda"};
  EXPECT_EQ(nearest_word("poison", known), "poisson");
  EXPECT_EQ(nearest_word("lame_lamda", known), "lame_lambda");
  EXPECT_EQ(nearest_word("density", known), "");
  EXPECT_EQ(did_you_mean("yong", known), "Did you mean \"young\"?");
  EXPECT_EQ(did_you_mean("density", known), "Known: young, poisson, lame_mu, lame_lambda");
  EXPECT_EQ(did_you_mean("density", {}), "None is known here");
}

TEST(suggestions, never_turn_a_short_word_into_an_unrelated_one) {
  const std::vector<std::string> known{"x", "y", "pi"};
  EXPECT_EQ(nearest_word("q", known), "");
  EXPECT_EQ(nearest_word("pu", known), "pi");
}

TEST(suggestions, are_bounded_for_junk) {
  const std::vector<std::string> many(100, std::string(1000, 'a'));
  EXPECT_LT(did_you_mean(std::string(100000, 'b'), many).size(), 15000U);
}

TEST(shown, is_one_line_of_limited_length) {
  EXPECT_EQ(shown("a b"), "a b");
  EXPECT_EQ(shown(std::string("a\nb\0c", 5)), "a?b?c");
  EXPECT_EQ(shown("abcdef", 3), "abc...");
}

}  // namespace
}  // namespace polyslip
