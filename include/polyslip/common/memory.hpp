// Memory of this rank.
#pragma once

#include <cstddef>

namespace polyslip {

/// Throws ResourceError on ranks that would not get so much at once; for use before libraries that end the run without telling why.
void require_memory(std::size_t bytes);

}  // namespace polyslip
