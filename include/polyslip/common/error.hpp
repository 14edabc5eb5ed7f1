// Errors that a user can act on, and assertions for our own bugs (house.md section 6).
#pragma once

#include <cassert>
#include <stdexcept>
#include <string>

namespace polyslip {

/// Bad input: what is wrong, where (scene key and line, file, cell or face) with the value met, and the remedy.
/// main prints it once, from rank 0, and exits with code 2.
class InputError : public std::runtime_error {
 public:
  explicit InputError(const std::string& sentence) : std::runtime_error(sentence) {}
  InputError(const std::string& what, const std::string& where, const std::string& remedy = "")
      : std::runtime_error(where + ": " + what + (remedy.empty() ? "" : ". " + remedy)) {}
};

/// The machine gives out under a run that may be in order: a full disk, no memory. The sentence has place and remedy; main prints it and
/// exits with code 4. What has been accepted stays on disk.
class ResourceError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace polyslip
