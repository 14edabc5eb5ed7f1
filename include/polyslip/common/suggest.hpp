// The nearest known word for a misspelt one, for messages.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace polyslip {

/// Smallest number of insertions, deletions, replacements and swaps of neighbours that turn `a` into `b`, case ignored.
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The first of the nearest words of `known` if it is near enough to be a slip of the pen; empty otherwise.
std::string nearest_word(std::string_view word, std::span<const std::string> known);

/// 'Did you mean "young"?', or 'Known: a, b, c' (at most twelve words) when nothing is near; for the remedy of an InputError.
std::string did_you_mean(std::string_view word, std::span<const std::string> known);

}  // namespace polyslip
