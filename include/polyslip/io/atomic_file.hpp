// Text files that are either the old or the new version, never half of one: a temporary file renamed.
#pragma once

#include <filesystem>
#include <string>

namespace polyslip::io {

/// Replaces `file` by `text`. Throws std::runtime_error, with the reason the system gives, when the disk refuses.
void write_atomically(const std::filesystem::path& file, const std::string& text);

}  // namespace polyslip::io
