#include "polyslip/io/csv.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cassert>
#include <cstdlib>
#include <sstream>

#include "polyslip/common/error.hpp"
#include "polyslip/io/atomic_file.hpp"

namespace polyslip::io {

namespace {

void flush_or_throw(std::ofstream& out, const std::string& file) {
  out.flush();
  if (!out) throw ResourceError(file + ": cannot write the table. Check that the directory exists, is writable and has room");
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

/// The rows of a table whose first value is at most `last`, with the columns wanted, each with its newline. A row that was not
/// finished when its run was killed is dropped.
std::string kept_rows(const std::filesystem::path& file, const std::vector<std::string>& columns, double last) {
  std::ifstream in(file);
  std::string line, rows;
  if (!std::getline(in, line)) return rows;
  const std::vector<std::string> names = cells_of(line);
  std::vector<std::size_t> from;
  for (const std::string& column : columns)
    from.push_back(static_cast<std::size_t>(std::find(names.begin(), names.end(), column) - names.begin()));
  while (std::getline(in, line) && !in.eof()) {
    std::vector<std::string> cells = cells_of(line), wanted;
    if (cells.size() != names.size() || std::atof(cells[0].c_str()) > last) continue;
    cells.emplace_back("nan");
    for (const std::size_t column : from) wanted.push_back(cells[column]);
    rows += fmt::format("{}\n", fmt::join(wanted, ","));
  }
  return rows;
}

}  // namespace

CsvTable::CsvTable(const std::filesystem::path& file, const std::vector<std::string>& columns, std::optional<double> kept)
    : file_(file.string()), columns_(columns.size()) {
  const std::string head = fmt::format("{}\n", fmt::join(columns, ","));
  write_atomically(file, head + (kept ? kept_rows(file, columns, *kept) : ""));
  out_.open(file, std::ios::app);
  flush_or_throw(out_, file_);
}

void CsvTable::row(const std::vector<double>& values) {
  if (columns_ == 0) return;
  assert(values.size() == columns_);
  out_ << fmt::format("{}\n", fmt::join(values, ","));  // the shortest text that reads back to the same double
  flush_or_throw(out_, file_);
}

}  // namespace polyslip::io
