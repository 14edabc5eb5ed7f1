#include "polyslip/common/expression.hpp"

#include <fmt/format.h>
#include <muParser.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <iterator>
#include <numbers>
#include <optional>
#include <regex>

#include "polyslip/common/error.hpp"
#include "polyslip/common/suggest.hpp"

namespace polyslip {

namespace {

constexpr std::array<const char*, 6> variable_names{"x", "y", "z", "t", "tip_distance", "fracture_length"};
constexpr std::size_t time_variable = 3, first_fracture_variable = 4;

/// muParser with our constants. Its functions, operators and the ternary are taken as they are.
mu::Parser make_parser() {
  mu::Parser parser;
  parser.DefineConst("pi", std::numbers::pi);
  return parser;
}

/// A name as it stands in a text.
struct Word {
  std::string name;
  std::size_t position = 0;  ///< From 0.
  bool called = false;       ///< Followed by "(".
};

bool starts_name(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_'; }
bool continues_name(char c) { return starts_name(c) || std::isdigit(static_cast<unsigned char>(c)) != 0; }

/// End of the number that starts at `i`; `i` itself if none does.
std::size_t skip_number(const std::string& text, std::size_t i) {
  static const std::regex number(R"((\d+\.?\d*|\.\d+)([eE][+-]?\d+)?)");
  std::smatch match;
  const auto from = text.begin() + static_cast<std::ptrdiff_t>(i);
  const bool found = std::regex_search(from, text.end(), match, number, std::regex_constants::match_continuous);
  return found ? i + static_cast<std::size_t>(match.length()) : i;
}

std::vector<Word> words_of(const std::string& text) {
  std::vector<Word> words;
  for (std::size_t i = 0; i < text.size();) {
    if (starts_name(text[i])) {
      std::size_t end = i;
      while (end < text.size() && continues_name(text[end])) ++end;
      const std::size_t next = text.find_first_not_of(" \t\r\n", end);
      words.push_back({text.substr(i, end - i), i, next != std::string::npos && text[next] == '('});
      i = end;
    } else {
      i = std::max(skip_number(text, i), i + 1);
    }
  }
  return words;
}

/// The value of a text that is a number and nothing else: by far the most frequent, and muParser takes 50 us to get ready.
std::optional<double> plain_number(const std::string& text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = error == std::errc() && end == text.data() + text.size() && std::isfinite(value);
  return whole ? std::optional(value) : std::nullopt;
}

constexpr const char* formula_remedy = "Write a number or a formula of x, y, z and t, such as 2*sin(pi*x)";

[[noreturn]] void refuse(const std::string& where, const std::string& text, const std::string& what, std::size_t position,
                         const std::string& remedy = "") {
  throw InputError(fmt::format("{} at column {} of the expression \"{}\"", what, position + 1, shown(text)), where, remedy);
}

void refuse_infinite(double value, const std::string& text, const std::string& where) {
  if (!std::isfinite(value))
    throw InputError(fmt::format("the expression \"{}\" gives {}", shown(text), value), where, "Give a finite number");
}

/// What muParser takes without a word: it assigns by "=", which would change a variable behind our back, and it stops at a null
/// character.
void refuse_traps(const std::string& text, const std::string& where) {
  if (text.find_first_not_of(" \t\r\n") == std::string::npos)
    throw InputError("the expression is empty", where, formula_remedy);
  if (const std::size_t i = text.find('\0'); i != std::string::npos) refuse(where, text, "a null character", i, formula_remedy);
  for (std::size_t i = text.find('='); i != std::string::npos; i = text.find('=', i + 1)) {
    const bool after_operator = i > 0 && (text[i - 1] == '<' || text[i - 1] == '>' || text[i - 1] == '!');
    const bool doubled = i + 1 < text.size() && text[i + 1] == '=';
    if (!after_operator && !doubled) refuse(where, text, "assignment", i, "Compare with \"==\"");
    if (doubled) ++i;
  }
}

/// muParser's message, without its position (counted from 0) and final point.
std::string spoken(const mu::ParserError& error) {
  static const std::regex position(R"(\s*(found )?(at|\(position:) ?(expression )?(position)? ?\d+\)?\.?$)");
  std::string message = std::regex_replace(error.GetMsg(), position, "");
  while (!message.empty() && (message.back() == '.' || message.back() == '!')) message.pop_back();
  if (!message.empty()) message[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(message[0])));
  return message;
}

/// Adds the numbers of `more` that `numbers` lacks; ascending.
void merge(std::vector<std::size_t>& numbers, const std::vector<std::size_t>& more) {
  std::vector<std::size_t> both;
  std::ranges::set_union(numbers, more, std::back_inserter(both));
  numbers = std::move(both);
}

}  // namespace

/// Variables and definitions as formulas read them, shared by all expressions with the same definitions: at one point each definition is
/// evaluated once, however many expressions use it.
struct Definitions::Tape {
  /// A formula ready to evaluate. What it uses is ascending, an order in which each definition comes after those it uses itself.
  struct Formula {
    mu::Parser parser;
    std::vector<std::size_t> uses;  ///< Definitions that vary, directly or through others.
    bool varies = false, time = false, fracture = false;
  };
  struct Definition {
    std::optional<Formula> formula;  ///< Once it is used.
    double value = 0;
    unsigned long long point = 0;  ///< At which `value` was found, by number; 0: nowhere.
  };

  explicit Tape(const Definitions& from) : items(from.items), definitions(from.items.size()) {}

  void move_to(const EvalPoint& at) {
    const std::array<double, variable_names.size()> now{at.x[0], at.x[1], at.x[2], at.t, at.tip_distance, at.fracture_length};
    if (now == variables && point > 0) return;
    variables = now;
    ++point;
  }

  /// At the point moved to.
  double evaluate(const Formula& formula) {
    for (const std::size_t i : formula.uses) {
      Definition& definition = definitions[i];
      if (definition.point == point) continue;
      definition.value = definition.formula->parser.Eval();
      definition.point = point;
    }
    return formula.parser.Eval();
  }

  const std::vector<std::pair<std::string, std::string>> items;
  std::array<double, variable_names.size()> variables{};  ///< In the order of variable_names.
  std::vector<Definition> definitions;                    ///< Formulas read them where they stand: never resized.
  unsigned long long point = 0;                           ///< Number of the point moved to.
};

namespace {

using Tape = Definitions::Tape;

/// The tape of the definitions, made anew where they have changed since.
std::shared_ptr<Tape> tape_of(const Definitions& definitions) {
  if (!definitions.tape || definitions.tape->items != definitions.items) definitions.tape = std::make_shared<Tape>(definitions);
  return definitions.tape;
}

/// Compiles a text and, once each, the definitions that it uses; those that turn out constant become constants.
class Compiler {
 public:
  /// `variables`, the first of variable_names, may be used.
  Compiler(Tape& tape, std::size_t variables) : tape_(tape), n_variables_(variables) {}

  /// `visible` definitions, the first ones, may be used.
  Tape::Formula compile(const std::string& text, std::size_t visible, const std::string& where) {
    refuse_traps(text, where);
    Tape::Formula result;
    result.parser = make_parser();
    for (const Word& word : words_of(text)) bind(word, text, visible, where, result);
    try {
      result.parser.SetExpr(text);
      result.parser.Eval();  // The first evaluation is the one that compiles.
      if (result.parser.GetNumResults() != 1) refuse(where, text, "a second value", text.find(','), "Give one value");
    } catch (const mu::ParserError& error) {
      // The position is -1 when muParser cannot tell, and one too far at the end.
      refuse(where, text, shown(spoken(error)), static_cast<std::size_t>(std::clamp(error.GetPos(), 0, static_cast<int>(text.size()))),
             formula_remedy);
    }
    return result;
  }

 private:
  void bind(const Word& word, const std::string& text, std::size_t visible, const std::string& where, Tape::Formula& result) {
    const auto variable = std::ranges::find(variable_names, word.name);
    if (variable != variable_names.end()) {
      const auto i = static_cast<std::size_t>(variable - variable_names.begin());
      if (i >= n_variables_) refuse(where, text, fmt::format("\"{}\" varies", word.name), word.position, "A constant belongs here");
      result.parser.DefineVar(word.name, &tape_.variables[i]);
      result.varies = true;
      result.time = result.time || i == time_variable;
      result.fracture = result.fracture || i >= first_fracture_variable;
      return;
    }
    if (word.called ? result.parser.GetFunDef().contains(word.name) : result.parser.GetConst().contains(word.name)) return;
    const auto item = std::ranges::find(tape_.items, word.name, [](const auto& named) { return named.first; });
    const auto i = static_cast<std::size_t>(item - tape_.items.begin());
    if (i >= visible) refuse_unknown(word, i, text, visible, where, result.parser);
    use(i, where, result);
  }

  void use(std::size_t i, const std::string& where, Tape::Formula& user) {
    const std::string& name = tape_.items[i].first;
    Tape::Definition& definition = tape_.definitions[i];
    if (!definition.formula) {
      definition.formula = compile(tape_.items[i].second, i, where);
      if (!definition.formula->varies) definition.value = definition.formula->parser.Eval();
    }
    const Tape::Formula& used = *definition.formula;
    if (!used.varies) return user.parser.DefineConst(name, definition.value);
    user.parser.DefineVar(name, &definition.value);
    user.varies = true;
    user.time = user.time || used.time;
    user.fracture = user.fracture || used.fracture;
    merge(user.uses, used.uses);
    merge(user.uses, {i});
  }

  [[noreturn]] void refuse_unknown(const Word& word, std::size_t item, const std::string& text, std::size_t visible,
                                   const std::string& where, const mu::Parser& parser) {
    if (item < tape_.items.size())
      refuse(where, text, fmt::format("\"{}\" used before it is defined", word.name), word.position,
             "Order the definitions so that each uses only those before it");
    std::vector<std::string> known;
    if (word.called) {
      for (const auto& [name, function] : parser.GetFunDef()) known.push_back(name);
    } else {
      known.assign(variable_names.begin(), variable_names.begin() + static_cast<std::ptrdiff_t>(n_variables_));
      known.emplace_back("pi");
      for (std::size_t i = 0; i < visible; ++i) known.push_back(tape_.items[i].first);
    }
    refuse(where, text, fmt::format("unknown {} \"{}\"", word.called ? "function" : "name", shown(word.name)), word.position,
           did_you_mean(word.name, known));
  }

  Tape& tape_;
  std::size_t n_variables_;
};

}  // namespace

struct Expression::Compiled {
  std::string text, where;
  std::optional<double> constant;
  std::shared_ptr<Tape> tape;  ///< With a formula only.
  Tape::Formula formula;
};

Expression::Expression(double constant) : compiled_(std::make_shared<Compiled>()) {
  compiled_->text = fmt::format("{}", constant);
  compiled_->constant = constant;
}

Expression::Expression(const std::string& text, const Definitions& definitions, const std::string& where)
    : compiled_(std::make_shared<Compiled>()) {
  compiled_->text = text;
  compiled_->where = where;
  compiled_->constant = plain_number(text);
  if (compiled_->constant) return;
  compiled_->tape = tape_of(definitions);
  compiled_->formula = Compiler(*compiled_->tape, variable_names.size()).compile(text, definitions.items.size(), where);
  if (compiled_->formula.varies) return;
  compiled_->constant = compiled_->formula.parser.Eval();
  refuse_infinite(*compiled_->constant, text, where);
}

double Expression::operator()(const EvalPoint& at) const {
  Compiled& c = *compiled_;
  if (c.constant) return *c.constant;
  c.tape->move_to(at);
  const double value = c.tape->evaluate(c.formula);
  if (!std::isfinite(value))
    throw InputError(fmt::format("the expression \"{}\" gives {} at x = {}, y = {}, z = {}, t = {}", shown(c.text), value, at.x[0],
                                 at.x[1], at.x[2], at.t),
                     c.where, "Change it so that it is finite wherever it is used");
  return value;
}

bool Expression::is_constant() const { return compiled_->constant.has_value(); }
bool Expression::depends_on_time() const { return compiled_->formula.time; }
bool Expression::depends_on_fracture() const { return compiled_->formula.fracture; }
bool Expression::is_zero() const { return compiled_->constant == 0.0; }
const std::string& Expression::text() const { return compiled_->text; }

const std::vector<std::string>& expression_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> result(variable_names.begin(), variable_names.end());
    const mu::Parser parser = make_parser();
    for (const auto& [name, value] : parser.GetConst()) result.push_back(name);
    for (const auto& [name, function] : parser.GetFunDef()) result.push_back(name);
    return result;
  }();
  return names;
}

double constant_value(const std::string& text, const Definitions& definitions, const std::string& where) {
  if (const auto number = plain_number(text)) return *number;
  Tape scratch(definitions);
  const double value = Compiler(scratch, 0).compile(text, definitions.items.size(), where).parser.Eval();
  refuse_infinite(value, text, where);
  return value;
}

}  // namespace polyslip
