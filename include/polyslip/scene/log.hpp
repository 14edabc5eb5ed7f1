// The log of a run: lines of rank 0 on standard output.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <iostream>
#include <string>

#include "polyslip/common/mpi.hpp"

namespace polyslip::scene {

class Log {
 public:
  explicit Log(MPI_Comm comm) : speaks_(mpi::rank(comm) == 0), shows_progress_(speaks_ && isatty(STDOUT_FILENO) != 0) {}

  /// One line, flushed at once.
  template <class... Args>
  void line(fmt::format_string<Args...> format, Args&&... args) const {
    if (speaks_) std::cout << erase_ << fmt::format(format, std::forward<Args>(args)...) << std::endl;
  }

  /// Text at the bottom of a terminal until the next line; nothing where standard output is a file or a pipe.
  void progress(const std::string& text) const {
    if (shows_progress_) std::cout << erase_ << text << std::flush;
  }
  [[nodiscard]] bool shows_progress() const { return shows_progress_; }

 private:
  bool speaks_, shows_progress_;
  const char* erase_ = shows_progress_ ? "\r\033[K" : "";
};

}  // namespace polyslip::scene
