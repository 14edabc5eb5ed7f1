// A directory for one test, the same on all ranks, removed at the end.
#pragma once

#include <petscsys.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "polyslip/common/mpi.hpp"

namespace polyslip::test {

class TemporaryDirectory {
 public:
  explicit TemporaryDirectory(MPI_Comm comm = PETSC_COMM_WORLD) : comm_(comm) {
    std::string path = (std::filesystem::temp_directory_path() / "polyslip_XXXXXX").string();
    if (mpi::rank(comm_) == 0) path = mkdtemp(path.data());
    path_ = mpi::broadcast(comm_, path);
  }
  ~TemporaryDirectory() {
    MPI_Barrier(comm_);  // nobody still reads
    if (mpi::rank(comm_) == 0) std::filesystem::remove_all(path_);
  }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  MPI_Comm comm_;
  std::filesystem::path path_;
};

}  // namespace polyslip::test
