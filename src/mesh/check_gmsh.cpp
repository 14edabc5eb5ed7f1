// Counts and references in Gmsh files, text and binary, number by number: PETSc's reader trusts them.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "polyslip/common/error.hpp"
#include "polyslip/common/suggest.hpp"
#include "polyslip/mesh/formats.hpp"

namespace polyslip::mesh {

namespace {

/// Nodes of an element of a Gmsh type; 0 for types that are not of first order or not known.
int nodes_of_type(long type) {
  constexpr std::array<int, 16> nodes{0, 2, 3, 4, 4, 8, 6, 5, 0, 0, 0, 0, 0, 0, 0, 1};
  return type > 0 && type < static_cast<long>(nodes.size()) ? nodes[type] : 0;
}

/// The numbers of one file, section by section.
class Tokens {
 public:
  explicit Tokens(const std::filesystem::path& file) : name_(file.string()) {
    std::ifstream in(file, std::ios::binary);
    std::ostringstream all;
    all << in.rdbuf();
    text_ = std::move(all).str();
    read_format();
  }

  [[nodiscard]] bool is_binary() const { return binary_; }
  [[nodiscard]] bool is_41() const { return is_41_; }

  /// Moves behind the title of a section; the sections are expected in this order.
  void enter(const std::string& section) {
    place_ = "section " + section;
    kind_ = nullptr;
    const auto found = text_.find(section, at_);
    if (found == std::string::npos) fail("it is missing");
    at_ = found + section.size();
    if (is_41_ && section != "$PhysicalNames") end_line();
  }

  /// Whether a section stands before another.
  [[nodiscard]] bool has_before(const std::string& section, const std::string& other) const {
    return text_.find(section, at_) < text_.find(other, at_);
  }

  /// The rest of a line of names, in quotes and short enough for PETSc's buffer.
  void quoted() {
    const auto end = std::min(text_.find('\n', at_), text_.size());
    const std::string line = text_.substr(at_, end - at_);
    const auto open = line.find_first_not_of(" \t"), close = line.find_last_not_of(" \t\r");
    if (open == std::string::npos || line[open] != '"' || line[close] != '"' || close == open || close - open > 127)
      fail(fmt::format("'{}' is not a name in quotes of at most 127 characters", shown(line, 40)));
    at_ = end;
  }

  long spelt() {
    const auto token = next();
    long value = 0;
    const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
    if (error != std::errc() || end != token.data() + token.size()) fail(fmt::format("'{}' is not an integer", shown(std::string(token), 40)));
    return value;
  }

  std::string_view next() {
    constexpr const char* blanks = " \t\r\n";
    const auto begin = text_.find_first_not_of(blanks, at_);
    if (begin == std::string::npos) fail("the file ends too early");
    at_ = std::min(text_.find_first_of(blanks, begin), text_.size());
    return std::string_view(text_).substr(begin, at_ - begin);
  }

  // In binary files: 32 bits; the bits of a number of a node or an element; and what counts entries.
  long integer() { return binary_ ? raw<std::int32_t>() : spelt(); }
  long index() { return binary_ && is_41_ ? raw<std::int64_t>() : integer(); }
  /// A number of entries to come, each of at least `tokens` tokens.
  long count(long tokens = 1) { return with_room(index(), tokens); }
  /// The same on a line of its own, which is text in binary files too.
  long count_line(long tokens) {
    const long value = with_room(spelt(), tokens);
    end_line();
    return value;
  }

  void skip_reals(long count) {
    if (!binary_) return skip(count);
    if (static_cast<std::size_t>(count) > (text_.size() - at_) / sizeof(double)) fail("the file ends too early");
    at_ += static_cast<std::size_t>(count) * sizeof(double);
  }

  void leave(const std::string& end) {
    if (const auto token = next(); token != end)
      fail(fmt::format("'{}' stands where {} should: a count is wrong", shown(std::string(token), 40), end));
  }

  /// Where we are, for messages.
  void at_entry(const char* kind, long number) {
    kind_ = kind;
    number_ = number;
  }

  [[noreturn]] void fail(const std::string& what) const {
    const std::string entry = kind_ == nullptr ? "" : fmt::format(", {} {}", kind_, number_);
    throw InputError(what, fmt::format("{}, {}{}", name_, place_, entry), "Write the file again with Gmsh as msh 4.1 or 2.2");
  }

 private:
  void read_format() {
    if (!text_.starts_with("$MeshFormat")) fail("the file does not begin with $MeshFormat");
    next();
    const std::string version(next());
    if (version != "2.2" && version != "4.1") fail(fmt::format("the version is '{}'", shown(version, 40)));
    is_41_ = version == "4.1";
    const long kind = spelt(), bytes = spelt();
    if ((kind != 0 && kind != 1) || bytes != 8) fail(fmt::format("file type {} with numbers of {} bytes is not known", kind, bytes));
    binary_ = kind == 1;
    if (!binary_) return;
    end_line();
    if (raw<std::int32_t>() != 1) fail("the numbers are in the byte order of another machine");
  }

  /// Before numbers in binary.
  void end_line() {
    if (binary_ && at_ < text_.size() && text_[at_] == '\r') ++at_;
    if (binary_ && at_ < text_.size() && text_[at_] == '\n') ++at_;
  }

  template <class T>
  long raw() {
    if (text_.size() - at_ < sizeof(T)) fail("the file ends too early");
    T value{};
    std::memcpy(&value, &text_[at_], sizeof(T));
    at_ += sizeof(T);
    return static_cast<long>(value);
  }

  void skip(long tokens) {
    for (long i = 0; i < tokens; ++i) next();
  }

  [[nodiscard]] long with_room(long value, long tokens) const {
    const long room = static_cast<long>(text_.size() - at_) / (2 * tokens);
    if (value < 0 || value > room) fail(fmt::format("it announces {} entries, which the rest of the file cannot hold", value));
    return value;
  }

  std::string name_, text_, place_ = "section $MeshFormat";
  std::size_t at_ = 0;
  const char* kind_ = nullptr;
  long number_ = 0;
  bool binary_ = false, is_41_ = false;
};

/// Numbers in use, for looking up.
class NumberSet {
 public:
  void add(long number) { numbers_.push_back(number); }
  void finish(const Tokens& tokens) {
    std::sort(numbers_.begin(), numbers_.end());
    const auto twice = std::adjacent_find(numbers_.begin(), numbers_.end());
    if (twice != numbers_.end()) tokens.fail(fmt::format("the number {} is given twice", *twice));
    // PETSc keeps an array from the lowest to the highest number.
    const long size = static_cast<long>(numbers_.size());
    if (size > 0 && (numbers_.front() < 0 || numbers_.back() > 1000000 + 100 * size)) {
      tokens.fail(fmt::format("the numbers run from {} to {} for {} entries: they must be positive and denser", numbers_.front(),
                              numbers_.back(), size));
    }
  }
  [[nodiscard]] bool holds(long number) const { return std::binary_search(numbers_.begin(), numbers_.end(), number); }

 private:
  std::vector<long> numbers_;
};

/// One element whose type is known: its nodes must exist.
void check_nodes(Tokens& tokens, long type, const NumberSet& nodes) {
  for (int i = 0; i < nodes_of_type(type); ++i) {
    if (const long node = tokens.index(); !nodes.holds(node)) tokens.fail(fmt::format("node {} does not exist", node));
  }
}

void check_type(const Tokens& tokens, long type) {
  if (nodes_of_type(type) == 0) {
    tokens.fail(fmt::format("element type {} is not one of first order (1 to 7, 15); set Mesh.ElementOrder = 1", type));
  }
}

void check_tags(Tokens& tokens, long tags) {
  for (long i = 0; i < tags; ++i) tokens.integer();
}

/// Elements in binary come in blocks of one type.
void check_blocks_22(Tokens& tokens, long left, const NumberSet& nodes) {
  while (left > 0) {
    const long type = tokens.integer(), count = tokens.count(), tags = tokens.count();
    check_type(tokens, type);
    if (count < 1 || count > left) tokens.fail(fmt::format("a block has {} elements, of which {} are left", count, left));
    for (long i = 0; i < count; ++i) {
      tokens.at_entry("element", tokens.integer());
      check_tags(tokens, tags);
      check_nodes(tokens, type, nodes);
    }
    left -= count;
  }
}

void check_elements_22(Tokens& tokens, long left, const NumberSet& nodes) {
  for (; left > 0; --left) {
    tokens.at_entry("element", tokens.integer());
    const long type = tokens.integer(), tags = tokens.count();
    check_type(tokens, type);
    if (tags > 100) tokens.fail(fmt::format("{} tags are more than an element can have", tags));
    check_tags(tokens, tags);
    check_nodes(tokens, type, nodes);
  }
}

void check_names(Tokens& tokens) {
  if (!tokens.has_before("$PhysicalNames", "$Nodes")) return;
  tokens.enter("$PhysicalNames");
  for (long left = tokens.count_line(3); left > 0; --left) {
    for (int number = 0; number < 2; ++number) tokens.spelt();  // dimension, group
    tokens.quoted();
  }
  tokens.leave("$EndPhysicalNames");
}

void check_22(Tokens& tokens) {
  NumberSet nodes;
  tokens.enter("$Nodes");
  for (long left = tokens.count_line(4); left > 0; --left) {
    nodes.add(tokens.integer());
    tokens.skip_reals(3);
  }
  nodes.finish(tokens);
  tokens.leave("$EndNodes");

  tokens.enter("$Elements");
  const long elements = tokens.count_line(4);
  tokens.is_binary() ? check_blocks_22(tokens, elements, nodes) : check_elements_22(tokens, elements, nodes);
  tokens.leave("$EndElements");
}

using Entities = std::array<NumberSet, 4>;  // by dimension

Entities check_entities(Tokens& tokens) {
  Entities entities;
  tokens.enter("$Entities");
  const std::array<long, 4> counts{tokens.count(), tokens.count(), tokens.count(), tokens.count()};
  for (int dim = 0; dim < 4; ++dim) {
    for (long left = counts[dim]; left > 0; --left) {
      entities[dim].add(tokens.integer());
      tokens.skip_reals(dim == 0 ? 3 : 6);
      for (int list = 0; list < (dim == 0 ? 1 : 2); ++list) {  // physical groups, and what bounds the entity
        for (long i = tokens.count(); i > 0; --i) tokens.integer();
      }
    }
    entities[dim].finish(tokens);
  }
  tokens.leave("$EndEntities");
  return entities;
}

void check_block(Tokens& tokens, const Entities& entities, long dim, long entity) {
  if (dim < 0 || dim > 3 || !entities[dim].holds(entity)) {
    tokens.fail(fmt::format("entity {} of dimension {} is not in $Entities", entity, dim));
  }
}

NumberSet check_nodes_41(Tokens& tokens, const Entities& entities) {
  NumberSet nodes;
  tokens.enter("$Nodes");
  const long blocks = tokens.count(4), total = tokens.count(), lowest = tokens.index(), highest = tokens.index();
  long found = 0;
  for (long block = 0; block < blocks; ++block) {
    const long dim = tokens.integer(), entity = tokens.integer(), parametric = tokens.integer(), count = tokens.count();
    check_block(tokens, entities, dim, entity);
    for (long i = 0; i < count; ++i) {
      const long node = tokens.index();
      if (node < lowest || node > highest) tokens.fail(fmt::format("node {} is outside the range {} to {}", node, lowest, highest));
      nodes.add(node);
    }
    tokens.skip_reals(count * (3 + (parametric != 0 ? dim : 0)));
    found += count;
  }
  if (found != total) tokens.fail(fmt::format("{} nodes are announced and {} given", total, found));
  nodes.finish(tokens);
  tokens.leave("$EndNodes");
  return nodes;
}

void check_41(Tokens& tokens) {
  const Entities entities = check_entities(tokens);
  const NumberSet nodes = check_nodes_41(tokens, entities);
  tokens.enter("$Elements");
  const long blocks = tokens.count(4), total = tokens.count();
  for (int bound = 0; bound < 2; ++bound) tokens.index();
  long found = 0;
  for (long block = 0; block < blocks; ++block) {
    const long dim = tokens.integer(), entity = tokens.integer(), type = tokens.integer(), count = tokens.count(2);
    check_block(tokens, entities, dim, entity);
    check_type(tokens, type);
    for (long i = 0; i < count; ++i) {
      tokens.at_entry("element", tokens.index());
      check_nodes(tokens, type, nodes);
    }
    found += count;
  }
  if (found != total) tokens.fail(fmt::format("{} elements are announced and {} given", total, found));
  tokens.leave("$EndElements");
}

}  // namespace

void check_gmsh(const std::filesystem::path& file) {
  Tokens tokens(file);
  check_names(tokens);
  tokens.is_41() ? check_41(tokens) : check_22(tokens);
}

}  // namespace polyslip::mesh
