// Parallel HDF5 by MPI-IO: tables whose rows lie on the ranks in rank order, written and read collectively.
#pragma once

#include <hdf5.h>
#include <mpi.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace polyslip::io {

/// Sole owner of one HDF5 identifier: move-only, closed once by the function of its kind.
class H5Handle {
 public:
  using Closer = herr_t (*)(hid_t);

  H5Handle() = default;
  H5Handle(hid_t id, Closer closer) : id_(id), close_(closer) {}
  H5Handle(H5Handle&& other) noexcept : id_(std::exchange(other.id_, H5I_INVALID_HID)), close_(other.close_) {}
  H5Handle& operator=(H5Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  H5Handle(const H5Handle&) = delete;
  H5Handle& operator=(const H5Handle&) = delete;
  ~H5Handle() {
    if (id_ >= 0) close_(id_);
  }

  operator hid_t() const { return id_; }  // NOLINT: borrowed on purpose
  /// Closes now; negative where HDF5 fails to.
  herr_t close() { return id_ < 0 ? 0 : close_(std::exchange(id_, H5I_INVALID_HID)); }

 private:
  hid_t id_ = H5I_INVALID_HID;
  Closer close_ = nullptr;
};

/// Rows of one rank in a table of all ranks.
struct RowRange {
  hsize_t count = 0;  ///< Rows of this rank; may be 0.
  hsize_t first = 0;  ///< Row of the table where they start.
  hsize_t total = 0;  ///< Over all ranks.

  /// For `count` rows a rank, in rank order. Collective.
  static RowRange in_rank_order(MPI_Comm comm, std::size_t count);
  /// `total` rows shared out evenly.
  static RowRange even(MPI_Comm comm, hsize_t total);
};

/// One open file. Every member function is collective over the communicator and throws std::runtime_error with file, table and
/// what was tried when HDF5 refuses.
class H5File {
 public:
  enum class Mode { create, read_write, read };  ///< create: an existing file is replaced.

  /// A file that is created has `head_bytes` (0, or a power of two from 512) before what HDF5 writes, for the caller to use once
  /// the file is closed (HDF5's user block).
  H5File(MPI_Comm comm, const std::filesystem::path& file, Mode mode, hsize_t head_bytes = 0);
  ~H5File();
  H5File(const H5File&) = delete;
  H5File& operator=(const H5File&) = delete;

  [[nodiscard]] bool has(const std::string& path) const;
  void create_group(const std::string& path);
  /// Unlinks a group or table; its room in the file is lost.
  void remove(const std::string& path);
  /// Replaces an attribute of that name.
  void write_attribute(const std::string& path, const std::string& name, double value);
  [[nodiscard]] double read_attribute(const std::string& path, const std::string& name) const;
  [[nodiscard]] bool has_attribute(const std::string& path, const std::string& name) const;

  /// Table `path` of rows.total x columns (one dimension for one column, which ParaView 5.11 insists on); this rank gives
  /// rows.count * columns values, row by row. Groups on the way are made.
  void write(const std::string& path, const RowRange& rows, int columns, std::span<const double> values);
  void write(const std::string& path, const RowRange& rows, int columns, std::span<const std::int32_t> values);
  /// A text, the same on all ranks.
  void write_text(const std::string& path, const std::string& text);
  [[nodiscard]] std::string read_text(const std::string& path) const;
  /// Hands everything to the system. Call before the file goes: a destructor cannot report a full disk.
  void flush();
  /// The same, and ends the use of this object.
  void close();

  /// Rows and columns of a table.
  [[nodiscard]] std::pair<hsize_t, int> shape(const std::string& path) const;
  /// rows.count * columns values of this rank's rows; `rows` as in write.
  [[nodiscard]] std::vector<double> read_doubles(const std::string& path, const RowRange& rows) const;
  [[nodiscard]] std::vector<std::int32_t> read_integers(const std::string& path, const RowRange& rows) const;

 private:
  void write_table(const std::string& path, const RowRange& rows, int columns, hid_t type, const void* values);
  template <class T>
  std::vector<T> read_table(const std::string& path, const RowRange& rows, hid_t type) const;
  [[noreturn]] void refuse(const std::string& what) const;

  std::string name_;
  bool first_rank_ = true;
  H5E_auto2_t print_errors_ = nullptr;  ///< HDF5's own error printing, off while the file is open: our exceptions say it.
  void* print_data_ = nullptr;
  H5Handle file_, transfer_;
};

}  // namespace polyslip::io
