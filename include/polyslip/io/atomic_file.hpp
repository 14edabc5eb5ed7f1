// Text files that are either the old or the new version, never half of one: a temporary file renamed.
#pragma once

#include <filesystem>
#include <string>

namespace polyslip::io {

/// Replaces `file` by `text`. Throws std::runtime_error, with the reason the system gives, when the disk refuses.
void write_atomically(const std::filesystem::path& file, const std::string& text);

/// Returns once the system has put a file's content, or the names in a directory, on the disk, so that they outlive a power cut.
/// Throws std::runtime_error when it cannot.
void sync_to_disk(const std::filesystem::path& file_or_directory);

}  // namespace polyslip::io
