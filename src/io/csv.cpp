#include "polyslip/io/csv.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cassert>
#include <stdexcept>

namespace polyslip::io {

namespace {
void flush_or_throw(std::ofstream& out, const std::string& file) {
  out.flush();
  if (!out) throw std::runtime_error(file + ": cannot write the table. Check that the directory exists, is writable and has room");
}
}  // namespace

CsvTable::CsvTable(const std::filesystem::path& file, const std::vector<std::string>& columns)
    : out_(file), file_(file.string()), columns_(columns.size()) {
  out_ << fmt::format("{}\n", fmt::join(columns, ","));
  flush_or_throw(out_, file_);
}

void CsvTable::row(const std::vector<double>& values) {
  if (columns_ == 0) return;
  assert(values.size() == columns_);
  out_ << fmt::format("{}\n", fmt::join(values, ","));  // the shortest text that reads back to the same double
  flush_or_throw(out_, file_);
}

}  // namespace polyslip::io
