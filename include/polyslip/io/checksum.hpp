// Checksum of a file that all ranks read together: zlib's CRC-32, the same on any number of ranks.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <filesystem>

namespace polyslip::io {

/// CRC-32 of the bytes of a file from `begin` to its end (`size`, in bytes). Each rank reads one stretch. Collective; throws
/// InputError on all ranks alike where the file cannot be read or is shorter.
std::uint32_t file_checksum(MPI_Comm comm, const std::filesystem::path& file, std::uint64_t begin, std::uint64_t size);

}  // namespace polyslip::io
