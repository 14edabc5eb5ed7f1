#include "polyslip/mesh/native_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

#include "polyslip/common/error.hpp"

namespace polyslip::mesh {

namespace {

/// In the format of HDF5 1.8, which has checksums on all but the numbers: on damaged files of the older one HDF5 reads beyond its buffers.
hid_t create(const std::string& name) {
  const Id access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_libver_bounds(access, H5F_LIBVER_V18, H5F_LIBVER_LATEST);
  return H5Fcreate(name.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access);
}

Id text_type(std::size_t width) {
  const hid_t type = H5Tcopy(H5T_C_S1);
  H5Tset_size(type, width);
  if (width != H5T_VARIABLE) H5Tset_strpad(type, H5T_STR_NULLPAD);
  H5Tset_cset(type, H5T_CSET_UTF8);
  return {type, H5Tclose};
}

}  // namespace

NativeFile::NativeFile(const std::filesystem::path& file, Mode mode)
    : name_(file.string()),
      file_(mode == Mode::create ? create(name_) : H5Fopen(name_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose) {
  if (file_ >= 0) return;
  if (mode == Mode::create)
    throw InputError("the file cannot be written", name_, "Check that the folder exists and may be written to");
  throw InputError("this is not an HDF5 file, or a part of it is missing", name_, "Write it again or copy it completely");
}

void NativeFile::write_attribute(const char* name, int value) {
  const Id space(H5Screate(H5S_SCALAR), H5Sclose);
  const Id attribute(H5Acreate2(file_, name, H5T_NATIVE_INT, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  written(H5Awrite(attribute, H5T_NATIVE_INT, &value));
}

int NativeFile::read_attribute(const char* name) const {
  int value = 0;
  if (H5Aexists(file_, name) > 0) {
    const Id attribute(H5Aopen(file_, name, H5P_DEFAULT), H5Aclose);
    if (H5Aread(attribute, H5T_NATIVE_INT, &value) >= 0) return value;
  }
  throw InputError(fmt::format("attribute {} is missing, so this is not a mesh in the native format", name), name_,
                   "Native meshes are written by polyslip, or by a script that follows the format in its documentation");
}

void NativeFile::create_group(const char* group) {
  written(Id(H5Gcreate2(file_, group, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose));
}

void NativeFile::write(const std::string& dataset, const std::vector<std::string>& texts) {
  std::size_t width = 1;
  for (const auto& text : texts) width = std::max(width, text.size());
  std::string columns;
  for (const auto& text : texts) columns += text + std::string(width - text.size(), '\0');
  const Id type = text_type(width);
  write_table(dataset, texts.size(), 1, type, columns.data());
}

std::vector<std::string> NativeFile::read_texts(const std::string& dataset) const {
  const Id table = open(dataset, H5T_STRING, "strings");
  const auto count = static_cast<std::size_t>(rows_of(table, dataset, 1));
  if (count == 0) return {};
  const Id type(H5Dget_type(table), H5Tclose);
  return H5Tis_variable_str(type) > 0 ? read_pointers(table, dataset, count) : read_columns(table, dataset, count, H5Tget_size(type));
}

void NativeFile::flush() { written(H5Fflush(file_, H5F_SCOPE_GLOBAL)); }

void NativeFile::require_rows(const std::string& dataset, Index actual, Index expected) const {
  if (actual != expected) fail(dataset, fmt::format("it has {} entries instead of {}", actual, expected));
}

void NativeFile::fail(const std::string& dataset, const std::string& what, const std::string& remedy) const {
  throw InputError(what, fmt::format("{}, dataset {}", name_, dataset), remedy);
}

Id NativeFile::open(const std::string& dataset, H5T_class_t expected, const char* kind) const {
  const hid_t table = H5Dopen2(file_, dataset.c_str(), H5P_DEFAULT);
  if (table < 0) fail(dataset, "the dataset is missing");
  const Id type(H5Dget_type(table), H5Tclose);
  if (H5Tget_class(type) != expected) {
    H5Dclose(table);
    fail(dataset, fmt::format("the entries are not {}", kind));
  }
  return {table, H5Dclose};
}

Index NativeFile::rows_of(hid_t table, const std::string& dataset, int columns) const {
  const Id space(H5Dget_space(table), H5Sclose);
  std::array<hsize_t, 2> shape{0, 1};
  const int rank = H5Sget_simple_extent_ndims(space);
  if (rank == (columns == 1 ? 1 : 2)) H5Sget_simple_extent_dims(space, shape.data(), nullptr);
  if (rank != (columns == 1 ? 1 : 2) || shape[1] != static_cast<hsize_t>(columns)) {
    fail(dataset, columns == 1 ? "the table must have one dimension" : fmt::format("the table must have {} columns", columns));
  }
  if (shape[0] > static_cast<hsize_t>(std::numeric_limits<Index>::max())) {
    fail(dataset, fmt::format("{} rows are more than 32-bit numbers can count", shape[0]), "Use a smaller mesh");
  }
  return static_cast<Index>(shape[0]);
}

void NativeFile::read_rows(hid_t table, const std::string& dataset, hid_t type, int columns, const RowRange& rows, void* values) const {
  if (rows.size == 0) return;
  const std::array<hsize_t, 2> first{static_cast<hsize_t>(rows.first), 0};
  const std::array<hsize_t, 2> shape{static_cast<hsize_t>(rows.size), static_cast<hsize_t>(columns)};
  const Id in_file(H5Dget_space(table), H5Sclose), in_memory(H5Screate_simple(columns == 1 ? 1 : 2, shape.data(), nullptr), H5Sclose);
  if (H5Sselect_hyperslab(in_file, H5S_SELECT_SET, first.data(), nullptr, shape.data(), nullptr) < 0 ||
      H5Dread(table, type, in_memory, in_file, H5P_DEFAULT, values) < 0) {
    unreadable(dataset);
  }
}

void NativeFile::write_table(const std::string& dataset, hsize_t rows, int columns, hid_t type, const void* values) {
  const std::array<hsize_t, 2> shape{rows, static_cast<hsize_t>(columns)};
  const Id space(H5Screate_simple(columns == 1 ? 1 : 2, shape.data(), nullptr), H5Sclose);
  const Id table(H5Dcreate2(file_, dataset.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
  written(table);
  if (rows > 0) written(H5Dwrite(table, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values));
}

std::vector<std::string> NativeFile::read_columns(hid_t table, const std::string& dataset, std::size_t count, std::size_t width) const {
  constexpr std::size_t widest = 100'000;
  if (width > widest) fail(dataset, fmt::format("a string of {} bytes is not a name", width));
  std::string columns(count * width, '\0');
  const Id type = text_type(width);
  if (H5Dread(table, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, columns.data()) < 0) unreadable(dataset);
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < count; ++i) {
    const std::string text = columns.substr(i * width, width);
    texts.push_back(text.substr(0, text.find('\0')));
  }
  return texts;
}

std::vector<std::string> NativeFile::read_pointers(hid_t table, const std::string& dataset, std::size_t count) const {
  std::vector<char*> pointers(count, nullptr);
  std::vector<std::string> texts;
  const Id type = text_type(H5T_VARIABLE);
  if (H5Dread(table, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, pointers.data()) < 0) unreadable(dataset);
  for (const char* text : pointers) texts.emplace_back(text == nullptr ? "" : text);
  const Id space(H5Dget_space(table), H5Sclose);
  H5Dvlen_reclaim(type, space, H5P_DEFAULT, pointers.data());
  return texts;
}

void NativeFile::written(hid_t status) const {
  if (status < 0) throw InputError("writing failed", name_, "Check the space left on the disk");
}

}  // namespace polyslip::mesh
