// An HDF5 file in the native mesh format as tables that are written whole and read whole or in rows (format: native_mesh.cpp).
#pragma once

#include <hdf5.h>

#include <filesystem>
#include <string>
#include <type_traits>
#include <vector>

#include "polyslip/mesh/row_range.hpp"

namespace polyslip::mesh {

/// Sole owner of one HDF5 identifier.
class Id {
 public:
  Id(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Id() {
    if (id_ >= 0) close_(id_);
  }
  Id(const Id&) = delete;
  Id& operator=(const Id&) = delete;
  operator hid_t() const { return id_; }  // NOLINT: borrowed on purpose

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

/// HDF5 prints nothing while this lives: our exceptions say what is wrong.
class QuietHdf5 {
 public:
  QuietHdf5() {
    H5Eget_auto2(H5E_DEFAULT, &print_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~QuietHdf5() { H5Eset_auto2(H5E_DEFAULT, print_, data_); }
  QuietHdf5(const QuietHdf5&) = delete;
  QuietHdf5& operator=(const QuietHdf5&) = delete;

 private:
  H5E_auto2_t print_ = nullptr;
  void* data_ = nullptr;
};

/// How an entry of an array lies in a table: so many columns of doubles or of integers.
template <class T>
struct Entry {
  using Scalar = std::conditional_t<std::is_same_v<T, double> || std::is_same_v<T, Vec3>, double, Index>;
  static constexpr int columns = sizeof(T) / sizeof(Scalar);
  static hid_t type() { return std::is_same_v<Scalar, double> ? H5T_NATIVE_DOUBLE : H5T_NATIVE_INT32; }
  static H5T_class_t type_class() { return std::is_same_v<Scalar, double> ? H5T_FLOAT : H5T_INTEGER; }
};

/// Throws InputError with file and dataset where something is missing or of another kind.
class NativeFile {
 public:
  enum class Mode { create, read };

  NativeFile(const std::filesystem::path& file, Mode mode);

  void write_attribute(const char* name, int value);
  [[nodiscard]] int read_attribute(const char* name) const;

  [[nodiscard]] bool has(const char* dataset) const { return H5Lexists(file_, dataset, H5P_DEFAULT) > 0; }
  void create_group(const char* group);

  template <class T>
  void write(const std::string& dataset, const std::vector<T>& values) {
    write_table(dataset, values.size(), Entry<T>::columns, Entry<T>::type(), values.data());
  }
  void write(const std::string& dataset, const std::vector<std::string>& texts);

  /// Number of rows of a table of T.
  template <class T>
  [[nodiscard]] Index rows(const std::string& dataset) const {
    return rows_of(open<T>(dataset), dataset, Entry<T>::columns);
  }
  /// Rows of a table that must have rows.total of them.
  template <class T>
  [[nodiscard]] std::vector<T> read(const std::string& dataset, const RowRange& rows) const {
    const Id table = open<T>(dataset);
    require_rows(dataset, rows_of(table, dataset, Entry<T>::columns), rows.total);
    std::vector<T> values(static_cast<std::size_t>(rows.size));
    read_rows(table, dataset, Entry<T>::type(), Entry<T>::columns, rows, values.data());
    return values;
  }
  [[nodiscard]] std::vector<std::string> read_texts(const std::string& dataset) const;

  /// Hands everything to the system; a destructor cannot report a full disk.
  void flush();

  void require_rows(const std::string& dataset, Index actual, Index expected) const;
  [[noreturn]] void fail(const std::string& dataset, const std::string& what,
                         const std::string& remedy = "Repair the file or write it again") const;

 private:
  template <class T>
  [[nodiscard]] Id open(const std::string& dataset) const {
    return open(dataset, Entry<T>::type_class(), std::is_same_v<typename Entry<T>::Scalar, double> ? "real numbers" : "integers");
  }
  [[nodiscard]] Id open(const std::string& dataset, H5T_class_t expected, const char* kind) const;
  [[nodiscard]] Index rows_of(hid_t table, const std::string& dataset, int columns) const;
  void read_rows(hid_t table, const std::string& dataset, hid_t type, int columns, const RowRange& rows, void* values) const;
  void write_table(const std::string& dataset, hsize_t rows, int columns, hid_t type, const void* values);
  [[nodiscard]] std::vector<std::string> read_columns(hid_t table, const std::string& dataset, std::size_t count, std::size_t width) const;
  [[nodiscard]] std::vector<std::string> read_pointers(hid_t table, const std::string& dataset, std::size_t count) const;
  void written(hid_t status) const;
  [[noreturn]] void unreadable(const std::string& dataset) const { fail(dataset, "the values cannot be read"); }

  std::string name_;
  Id file_;
};

}  // namespace polyslip::mesh
