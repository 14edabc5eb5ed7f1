// Checkpoints: all that a run needs to go on, in one HDF5 file that is whole or not there, readable on any number of ranks.
//
//   first 512 bytes   "polyslip checkpoint 1", size of the file and CRC-32 of all that follows (HDF5's user block)
//   /scalars          one attribute (double) each
//   /texts/NAME       one string each
//   /tables/NAME/numbers [rows], /tables/NAME/values [rows x columns]
//
// Rows are known by their number in the serial mesh (cell_input, copy_input ... of mesh::DistributedMesh), the same on any number of
// ranks.
#pragma once

#include <mpi.h>

#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "polyslip/common/types.hpp"

namespace polyslip::io {

class H5File;

/// The rows of one rank in one table. Each number stands on one rank, once.
struct CheckpointTable {
  std::string name;  ///< No '/'.
  int columns = 1;
  std::span<const GlobalIndex> numbers;  ///< Of the rows of this rank, in the serial mesh; not negative.
  std::vector<double> values;            ///< numbers.size() * columns, row by row.
};

/// The same on all ranks.
struct CheckpointValues {
  std::map<std::string, double> scalars;     ///< Time, step sizes, counters (exact below 2^53), rank count.
  std::map<std::string, std::string> texts;  ///< The resolved scene, the version.
};

/// Where the checkpoint before `file` is kept: "checkpoint.previous.h5" beside "checkpoint.h5".
std::filesystem::path previous_checkpoint(const std::filesystem::path& file);

/// Replaces `file`, which becomes the previous checkpoint. It is written beside its place (FILE.part), brought to the disk and renamed:
/// whenever the run is killed, either the old or the new one is whole. Collective; throws ResourceError on all ranks alike when the disk
/// refuses.
void write_checkpoint(MPI_Comm comm, const std::filesystem::path& file, const CheckpointValues& values,
                      std::span<const CheckpointTable> tables);

/// A checkpoint open for reading, by as many ranks as one likes. Member functions are collective and throw InputError on all ranks
/// alike where it lacks what is asked for.
class Checkpoint {
 public:
  /// Reads the whole file once for its checksum. Throws InputError where there is none, or where it is damaged, cut short,
  /// unfinished or of another version.
  Checkpoint(MPI_Comm comm, const std::filesystem::path& file);
  ~Checkpoint();
  Checkpoint(const Checkpoint&) = delete;
  Checkpoint& operator=(const Checkpoint&) = delete;

  [[nodiscard]] bool has_scalar(const std::string& name) const;
  [[nodiscard]] bool has_text(const std::string& name) const;
  [[nodiscard]] bool has_table(const std::string& name) const;

  [[nodiscard]] double scalar(const std::string& name) const;
  [[nodiscard]] std::string text(const std::string& name) const;
  /// Rows of a table over all ranks.
  [[nodiscard]] GlobalIndex total_rows(const std::string& table) const;
  /// The rows with the numbers that this rank asks for, in that order: numbers.size() * columns values, to the bit as written.
  /// Ranks may ask for the same row. No rank holds more than its share of the table and what it asks for.
  [[nodiscard]] std::vector<double> rows(const std::string& table, int columns, std::span<const GlobalIndex> numbers) const;

 private:
  void need(bool there, const std::string& what) const;

  MPI_Comm comm_;
  std::string name_;
  std::unique_ptr<H5File> file_;
};

}  // namespace polyslip::io
