#include "polyslip/io/atomic_file.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <fstream>
#include <stdexcept>
#include <system_error>

namespace polyslip::io {

void write_atomically(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::path temporary = file;
  temporary += ".tmp";
  errno = 0;
  std::ofstream out(temporary, std::ios::trunc);
  out << text;
  out.close();
  if (!out) {
    throw std::runtime_error(
        fmt::format("{}: cannot write the file ({}). Check that the directory exists, is writable and has room", file.string(),
                    std::generic_category().message(errno)));
  }
  std::filesystem::rename(temporary, file);
}

}  // namespace polyslip::io
