// CSV tables written row by row on rank 0 (history.csv, newton.csv); every row is flushed, so nothing is lost on failure.
#pragma once

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

namespace polyslip::io {

class CsvTable {
 public:
  CsvTable() = default;  ///< Writes nothing (ranks other than 0).
  /// Replaces a file of an earlier run; with `kept`, goes on behind its rows whose first value is at most that. Columns are known
  /// by name: those that the kept rows lack are nan there. Throws std::runtime_error when the disk refuses.
  CsvTable(const std::filesystem::path& file, const std::vector<std::string>& columns, std::optional<double> kept = {});
  /// One value a column; counts are printed without a point. Throws std::runtime_error when the disk refuses.
  void row(const std::vector<double>& values);

 private:
  std::ofstream out_;
  std::string file_;
  std::size_t columns_ = 0;
};

}  // namespace polyslip::io
