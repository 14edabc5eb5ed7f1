#include "polyslip/io/hdf5.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cassert>

#include "polyslip/common/error.hpp"
#include "polyslip/common/memory.hpp"
#include "polyslip/common/mpi.hpp"

namespace polyslip::io {

namespace {

constexpr std::size_t needed_by_mpi = 40'000'000;  ///< ROMIO takes 16 MiB for each file, and ends the run without them [bytes].

/// Last reason on HDF5's error stack, "" when there is none.
std::string reason() {
  std::string text;
  H5Ewalk2(
      H5E_DEFAULT, H5E_WALK_UPWARD,
      [](unsigned, const H5E_error2_t* error, void* out) -> herr_t {
        auto& found = *static_cast<std::string*>(out);
        if (found.empty() && error->desc != nullptr) found = error->desc;
        return 0;
      },
      &text);
  return text;
}

/// A table of one column has one dimension.
int dimensions(hsize_t columns) { return columns == 1 ? 1 : 2; }

/// This rank's part of a table's space; nothing where it has no rows.
void select_rows(hid_t space, const RowRange& rows, hsize_t columns) {
  const std::array<hsize_t, 2> start{rows.first, 0}, count{rows.count, columns};
  if (rows.count == 0) {
    H5Sselect_none(space);
  } else {
    H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr);
  }
}

H5Handle local_space(const RowRange& rows, hsize_t columns) {
  const std::array<hsize_t, 2> count{rows.count, columns};
  H5Handle space(H5Screate_simple(dimensions(columns), count.data(), nullptr), H5Sclose);
  if (rows.count == 0) H5Sselect_none(space);
  return space;
}

}  // namespace

RowRange RowRange::in_rank_order(MPI_Comm comm, std::size_t count) {
  const auto n = static_cast<long long>(count);
  return {count, static_cast<hsize_t>(mpi::exclusive_sum(comm, n)), static_cast<hsize_t>(mpi::sum(comm, n))};
}

RowRange RowRange::even(MPI_Comm comm, hsize_t total) {
  const auto rank = static_cast<hsize_t>(mpi::rank(comm)), ranks = static_cast<hsize_t>(mpi::size(comm));
  const hsize_t first = total * rank / ranks;
  return {total * (rank + 1) / ranks - first, first, total};
}

H5File::H5File(MPI_Comm comm, const std::filesystem::path& file, Mode mode, hsize_t head_bytes) : name_(file.string()) {
  require_memory(needed_by_mpi);
  H5Eget_auto2(H5E_DEFAULT, &print_errors_, &print_data_);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  const H5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_fapl_mpio(access, comm, MPI_INFO_NULL);
  if (mode == Mode::create) {
    const H5Handle creation(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
    H5Pset_userblock(creation, head_bytes);
    file_ = H5Handle(H5Fcreate(name_.c_str(), H5F_ACC_TRUNC, creation, access), H5Fclose);
  } else {
    file_ = H5Handle(H5Fopen(name_.c_str(), mode == Mode::read ? H5F_ACC_RDONLY : H5F_ACC_RDWR, access), H5Fclose);
  }
  if (file_ < 0) {
    H5Eset_auto2(H5E_DEFAULT, print_errors_, print_data_);
    refuse(mode == Mode::create ? "create the file" : "open the file");
  }
  first_rank_ = mpi::rank(comm) == 0;
  transfer_ = H5Handle(H5Pcreate(H5P_DATASET_XFER), H5Pclose);
  H5Pset_dxpl_mpio(transfer_, H5FD_MPIO_COLLECTIVE);
}

H5File::~H5File() { H5Eset_auto2(H5E_DEFAULT, print_errors_, print_data_); }

void H5File::refuse(const std::string& what) const {
  throw ResourceError(
      fmt::format("{}: HDF5 cannot {} ({}). Check that the path exists, is accessible and has room", name_, what, reason()));
}

bool H5File::has(const std::string& path) const { return H5Lexists(file_, path.c_str(), H5P_DEFAULT) > 0; }

void H5File::create_group(const std::string& path) {
  const H5Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
  H5Pset_create_intermediate_group(links, 1);
  const H5Handle group(H5Gcreate2(file_, path.c_str(), links, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  if (group < 0) refuse("create the group " + path);
}

void H5File::remove(const std::string& path) {
  if (H5Ldelete(file_, path.c_str(), H5P_DEFAULT) < 0) refuse("remove " + path);
}

void H5File::write_attribute(const std::string& path, const std::string& name, double value) {
  if (has_attribute(path, name)) H5Adelete_by_name(file_, path.c_str(), name.c_str(), H5P_DEFAULT);
  const H5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const H5Handle attribute(
      H5Acreate_by_name(file_, path.c_str(), name.c_str(), H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
      H5Aclose);
  if (attribute < 0 || H5Awrite(attribute, H5T_NATIVE_DOUBLE, &value) < 0) refuse("write the attribute " + name + " of " + path);
}

double H5File::read_attribute(const std::string& path, const std::string& name) const {
  double value = 0;
  const H5Handle attribute(H5Aopen_by_name(file_, path.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (attribute < 0 || H5Aread(attribute, H5T_NATIVE_DOUBLE, &value) < 0) refuse("read the attribute " + name + " of " + path);
  return value;
}

bool H5File::has_attribute(const std::string& path, const std::string& name) const {
  return H5Aexists_by_name(file_, path.c_str(), name.c_str(), H5P_DEFAULT) > 0;
}

void H5File::write_table(const std::string& path, const RowRange& rows, int columns, hid_t type, const void* values) {
  const std::array<hsize_t, 2> extent{rows.total, static_cast<hsize_t>(columns)};
  const H5Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
  H5Pset_create_intermediate_group(links, 1);
  const H5Handle space(H5Screate_simple(dimensions(extent[1]), extent.data(), nullptr), H5Sclose);
  const H5Handle table(H5Dcreate2(file_, path.c_str(), type, space, links, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
  if (table < 0) refuse("create the table " + path);
  select_rows(space, rows, extent[1]);
  const H5Handle memory = local_space(rows, extent[1]);  // outlives the error, whose reason a call to HDF5 would forget
  if (H5Dwrite(table, type, memory, space, transfer_, values) < 0) refuse("write the table " + path);
}

void H5File::write(const std::string& path, const RowRange& rows, int columns, std::span<const double> values) {
  assert(values.size() >= rows.count * static_cast<hsize_t>(columns));
  write_table(path, rows, columns, H5T_NATIVE_DOUBLE, values.data());
}

void H5File::write(const std::string& path, const RowRange& rows, int columns, std::span<const std::int32_t> values) {
  assert(values.size() >= rows.count * static_cast<hsize_t>(columns));
  write_table(path, rows, columns, H5T_NATIVE_INT32, values.data());
}

void H5File::write_text(const std::string& path, const std::string& text) {
  const H5Handle links(H5Pcreate(H5P_LINK_CREATE), H5Pclose);
  H5Pset_create_intermediate_group(links, 1);
  const H5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, std::max<std::size_t>(1, text.size()));
  H5Tset_strpad(type, H5T_STR_NULLPAD);
  H5Tset_cset(type, H5T_CSET_UTF8);
  const H5Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const H5Handle table(H5Dcreate2(file_, path.c_str(), type, space, links, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
  if (table < 0) refuse("create the text " + path);
  if (!first_rank_) H5Sselect_none(space);
  if (H5Dwrite(table, type, space, space, transfer_, text.c_str()) < 0) refuse("write the text " + path);
}

std::string H5File::read_text(const std::string& path) const {
  const H5Handle table(H5Dopen2(file_, path.c_str(), H5P_DEFAULT), H5Dclose);
  if (table < 0) refuse("open the text " + path);
  const H5Handle type(H5Dget_type(table), H5Tclose);
  std::string text(H5Tget_size(type), '\0');
  if (H5Dread(table, type, H5S_ALL, H5S_ALL, transfer_, text.data()) < 0) refuse("read the text " + path);
  text.resize(text.find_last_not_of('\0') + 1);  // npos + 1 is 0
  return text;
}

void H5File::close() {
  flush();
  if (file_.close() < 0) refuse("close the file");
}

void H5File::flush() {
  if (H5Fflush(file_, H5F_SCOPE_LOCAL) < 0) refuse("write the file");
}

std::pair<hsize_t, int> H5File::shape(const std::string& path) const {
  std::array<hsize_t, 2> extent{0, 1};
  const H5Handle table(H5Dopen2(file_, path.c_str(), H5P_DEFAULT), H5Dclose);
  if (table < 0) refuse("open the table " + path);
  const H5Handle space(H5Dget_space(table), H5Sclose);
  if (const int n = H5Sget_simple_extent_ndims(space); n != 1 && n != 2) {
    refuse(fmt::format("read {} as a table: it has {} dimensions", path, n));
  }
  H5Sget_simple_extent_dims(space, extent.data(), nullptr);
  return {extent[0], static_cast<int>(extent[1])};
}

template <class T>
std::vector<T> H5File::read_table(const std::string& path, const RowRange& rows, hid_t type) const {
  const auto [total, columns] = shape(path);
  if (total != rows.total) refuse(fmt::format("read the table {}: it has {} rows where {} are expected", path, total, rows.total));
  std::vector<T> values(rows.count * static_cast<hsize_t>(columns));
  const H5Handle table(H5Dopen2(file_, path.c_str(), H5P_DEFAULT), H5Dclose);
  const H5Handle space(H5Dget_space(table), H5Sclose);
  select_rows(space, rows, static_cast<hsize_t>(columns));
  const H5Handle memory = local_space(rows, static_cast<hsize_t>(columns));
  if (H5Dread(table, type, memory, space, transfer_, values.data()) < 0) {
    refuse("read the table " + path);
  }
  return values;
}

std::vector<double> H5File::read_doubles(const std::string& path, const RowRange& rows) const {
  return read_table<double>(path, rows, H5T_NATIVE_DOUBLE);
}

std::vector<std::int32_t> H5File::read_integers(const std::string& path, const RowRange& rows) const {
  return read_table<std::int32_t>(path, rows, H5T_NATIVE_INT32);
}

}  // namespace polyslip::io
