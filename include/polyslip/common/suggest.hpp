// What messages say of words: how they are shown, and the nearest known one for a misspelt one.
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

/// At most so many characters of a text that was met, in one line whatever is in it.
std::string shown(const std::string& text, std::size_t most = 200);

}  // namespace polyslip
