#include "polyslip/common/memory.hpp"

#include <sys/mman.h>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"

namespace polyslip {

void require_memory(std::size_t bytes) {
  void* const room = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (room == MAP_FAILED) throw ResourceError(mpi::out_of_memory());
  munmap(room, bytes);
}

}  // namespace polyslip
