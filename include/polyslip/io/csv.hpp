// CSV tables written row by row on rank 0 (history.csv, newton.csv); every row is flushed, so nothing is lost on failure.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace polyslip::io {

class CsvTable {
 public:
  CsvTable() = default;  ///< Writes nothing (ranks other than 0).
  CsvTable(const std::filesystem::path& file, const std::vector<std::string>& columns);
  /// One value a column; counts are printed without a point. Throws std::runtime_error when the disk refuses.
  void row(const std::vector<double>& values);

 private:
  std::ofstream out_;
  std::string file_;
  std::size_t columns_ = 0;
};

}  // namespace polyslip::io
