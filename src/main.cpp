// polyslip: frictional contact and flow in fractured rock on polytopal meshes.
#include <petscsys.h>

#include <cstdio>
#include <exception>
#include <vector>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/scene/run.hpp"
#include "polyslip/solver/active_set_search.hpp"

using namespace polyslip;

namespace {

/// PETSc from its first call to its last; every handle dies in between.
class PetscSession {
 public:
  explicit PetscSession(const std::vector<std::string>& arguments) : arguments_(arguments) {
    for (std::string& a : arguments_) pointers_.push_back(a.data());
    pointers_.push_back(nullptr);
    int argc = static_cast<int>(arguments_.size());
    char** argv = pointers_.data();
    mpi::choose_file_layer();
    if (PetscInitialize(&argc, &argv, nullptr, nullptr) != 0) throw std::runtime_error("PETSc does not start");
    if (solver::register_active_set_search() != 0) throw std::runtime_error("the line search cannot be registered");
  }
  ~PetscSession() { (void)PetscFinalize(); }
  PetscSession(const PetscSession&) = delete;
  PetscSession& operator=(const PetscSession&) = delete;

 private:
  std::vector<std::string> arguments_;
  std::vector<char*> pointers_;
};

int run(const scene::CommandLine& line) {
  const PetscSession session(line.petsc);
  const bool speaks = mpi::rank(PETSC_COMM_WORLD) == 0;
  try {
    return scene::run_scene(PETSC_COMM_WORLD, line);
  } catch (const InputError& e) {
    if (speaks) std::fprintf(stderr, "polyslip: %s\n", e.what());
    return scene::exit_bad_input;
  } catch (const std::exception& e) {
    // One rank alone may be here: the others must not wait for it.
    std::fprintf(stderr, "polyslip: internal error: %s\n", e.what());
    MPI_Abort(PETSC_COMM_WORLD, scene::exit_internal_error);
    return scene::exit_internal_error;
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const scene::CommandLine line = scene::parse_command_line(argc, argv);
    if (line.help || line.version) {
      std::fputs((line.help ? scene::full_help() : scene::version_text()).c_str(), stdout);
      return scene::exit_finished;
    }
    return run(line);
  } catch (const InputError& e) {
    std::fprintf(stderr, "polyslip: %s\n", e.what());
    return scene::exit_bad_input;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "polyslip: internal error: %s\n", e.what());
    return scene::exit_internal_error;
  }
}
