#include "polyslip/io/checksum.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <vector>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/io/hdf5.hpp"

namespace polyslip::io {

namespace {

constexpr std::uint64_t chunk = std::uint64_t{1} << 20;  // bytes read at a time

std::uint64_t checksum_of(const std::filesystem::path& file, std::uint64_t begin, std::uint64_t bytes) {
  std::ifstream in(file, std::ios::binary);
  in.seekg(static_cast<std::streamoff>(begin));
  std::vector<char> buffer(std::min(bytes, chunk));
  uLong crc = crc32(0, nullptr, 0);
  for (std::uint64_t left = bytes; left > 0;) {
    const std::uint64_t n = std::min(left, chunk);
    if (!in.read(buffer.data(), static_cast<std::streamsize>(n))) {
      throw ResourceError(fmt::format("{}: the file cannot be read to its end ({} bytes)", file.string(), begin + bytes));
    }
    crc = crc32(crc, reinterpret_cast<const Bytef*>(buffer.data()), static_cast<uInt>(n));
    left -= n;
  }
  return crc;
}

}  // namespace

std::uint32_t file_checksum(MPI_Comm comm, const std::filesystem::path& file, std::uint64_t begin, std::uint64_t size) {
  const RowRange stretch = RowRange::even(comm, size - begin);
  std::array<std::uint64_t, 2> mine{0, stretch.count};
  mpi::together(comm, [&] { mine[0] = checksum_of(file, begin + stretch.first, stretch.count); });

  std::vector<std::array<std::uint64_t, 2>> all(mpi::size(comm));
  MPI_Allgather(mine.data(), 2, MPI_UINT64_T, all.data(), 2, MPI_UINT64_T, comm);
  uLong crc = crc32(0, nullptr, 0);
  for (const auto& [of_stretch, bytes] : all) crc = crc32_combine(crc, of_stretch, static_cast<z_off_t>(bytes));
  return static_cast<std::uint32_t>(crc);
}

}  // namespace polyslip::io
