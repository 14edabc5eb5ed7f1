// Defaults in PETSc's options database that never overwrite what the user has set.
#pragma once

#include <array>
#include <string>

#include "polyslip/la/handle.hpp"

namespace polyslip::la {

/// Whether the user has set an option; the prefix of the solver without a dash, the name with one.
inline bool user_sets(const char* prefix, const char* name) {
  PetscBool set = PETSC_FALSE;
  POLYSLIP_PETSC(PetscOptionsHasName(nullptr, prefix, name, &set));
  return set == PETSC_TRUE;
}

/// Whether the user has given an option this value.
inline bool user_chooses(const char* prefix, const char* name, const std::string& value) {
  std::array<char, 64> text{};
  PetscBool set = PETSC_FALSE;
  POLYSLIP_PETSC(PetscOptionsGetString(nullptr, prefix, name, text.data(), text.size(), &set));
  return set == PETSC_TRUE && value == text.data();
}

/// Sets an option unless the user has set it; prefix and name without dashes.
inline void default_option(const std::string& prefix, const std::string& name, const char* value) {
  const std::string option = "-" + prefix + name;
  if (!user_sets(nullptr, option.c_str())) POLYSLIP_PETSC(PetscOptionsSetValue(nullptr, option.c_str(), value));
}

}  // namespace polyslip::la
