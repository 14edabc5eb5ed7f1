#include "polyslip/io/atomic_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <system_error>

#include "polyslip/common/error.hpp"

namespace polyslip::io {

void write_atomically(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::path temporary = file;
  temporary += ".tmp";
  errno = 0;
  std::ofstream out(temporary, std::ios::trunc);
  out << text;
  out.close();
  if (!out) {
    throw ResourceError(
        fmt::format("{}: cannot write the file ({}). Check that the directory exists, is writable and has room", file.string(),
                    std::generic_category().message(errno)));
  }
  std::filesystem::rename(temporary, file);
}

void sync_to_disk(const std::filesystem::path& file_or_directory) {
  const int descriptor = ::open(file_or_directory.c_str(), O_RDONLY | O_CLOEXEC);
  const bool done = descriptor >= 0 && ::fsync(descriptor) == 0;
  const int reason = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (!done) {
    throw ResourceError(fmt::format("{}: cannot be brought to the disk ({}). Check that the disk has room and is in order",
                                         file_or_directory.string(), std::generic_category().message(reason)));
  }
}

}  // namespace polyslip::io
