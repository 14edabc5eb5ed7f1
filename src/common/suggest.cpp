#include "polyslip/common/suggest.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <vector>

namespace polyslip {

namespace {
constexpr std::size_t longest_compared = 200;  // Longer words are junk; the distance costs the product of the lengths.
constexpr std::size_t most_listed = 12;

std::string lower(std::string_view word) {
  std::string result(word.substr(0, longest_compared));
  std::ranges::transform(result, result.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}
}  // namespace

// Optimal string alignment, three rows of the table at a time.
std::size_t edit_distance(std::string_view first, std::string_view second) {
  const std::string a = lower(first), b = lower(second);
  std::vector<std::size_t> two_above(b.size() + 1), above(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::swap(two_above, above);
    std::swap(above, row);
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({above[j] + 1, row[j - 1] + 1, above[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) row[j] = std::min(row[j], two_above[j - 2] + 1);
    }
  }
  return row[b.size()];
}

std::string nearest_word(std::string_view word, std::span<const std::string> known) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(1, std::min(word.size(), longest_compared) / 3) + 1;
  for (const std::string& candidate : known) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance < best_distance && distance < candidate.size()) {
      best = candidate;
      best_distance = distance;
    }
  }
  return best;
}

std::string did_you_mean(std::string_view word, std::span<const std::string> known) {
  if (known.empty()) return "None is known here";
  if (const std::string near = nearest_word(word, known); !near.empty()) return fmt::format("Did you mean \"{}\"?", near);
  const auto listed = known.first(std::min(known.size(), most_listed));
  return fmt::format("Known: {}{}", fmt::join(listed, ", "), known.size() > most_listed ? ", ..." : "");
}

std::string shown(const std::string& text, std::size_t most) {
  std::string result = text.size() <= most ? text : text.substr(0, most) + "...";
  std::ranges::replace_if(result, [](unsigned char c) { return std::iscntrl(c) != 0; }, '?');
  return result;
}

}  // namespace polyslip
