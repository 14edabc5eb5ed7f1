// polyslip: frictional contact and flow in fractured rock on polytopal meshes.
#include <petscsys.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <utility>
#include <vector>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/la/memory.hpp"
#include "polyslip/scene/run.hpp"
#include "polyslip/solver/registration.hpp"

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
    la::return_lack_of_memory();
    if (solver::register_types() != 0) throw std::runtime_error("its types cannot be registered with PETSc");
  }
  ~PetscSession() { (void)PetscFinalize(); }
  PetscSession(const PetscSession&) = delete;
  PetscSession& operator=(const PetscSession&) = delete;

 private:
  std::vector<std::string> arguments_;
  std::vector<char*> pointers_;
};

[[noreturn]] void abort_all(const std::string& message, int code) {
  static bool is_ending = false;  // some MPI_Abort calls exit(), which comes here again
  if (std::exchange(is_ending, true)) std::_Exit(code);
  std::fprintf(stderr, "polyslip: %s\n", message.c_str());
  std::fflush(nullptr);
  PMPI_Abort(PETSC_COMM_WORLD, code);
  std::abort();
}

[[noreturn]] void abort_after_library() {
  abort_all("a library has ended the run, most likely " + mpi::out_of_memory(), scene::exit_internal_error);
}

/// Some libraries (PORD within MUMPS, voro++) call exit() where they get no memory: the last words and the exit code are ours.
class ExitWatch {
 public:
  ExitWatch() {
    is_running_ = true;
    std::atexit([] {
      if (is_running_) abort_after_library();
    });
  }
  ~ExitWatch() { is_running_ = false; }
  ExitWatch(const ExitWatch&) = delete;
  ExitWatch& operator=(const ExitWatch&) = delete;

 private:
  static inline bool is_running_ = false;
};

int run(const scene::CommandLine& line) {
  la::reserve_work_space();
  const PetscSession session(line.petsc);
  const ExitWatch watch;
  const mpi::Muster muster(PETSC_COMM_WORLD);
  // One rank alone may come to one of these: the others must not wait for it. Nor can files be closed in order on a full disk.
  try {
    return scene::run_scene(PETSC_COMM_WORLD, line);
  } catch (const InputError& e) {
    if (!muster.all_come()) abort_all(e.what(), scene::exit_bad_input);
    if (mpi::rank(PETSC_COMM_WORLD) == 0) std::fprintf(stderr, "polyslip: %s\n", e.what());
    return scene::exit_bad_input;
  } catch (const ResourceError& e) {
    if (!muster.all_come() || mpi::rank(PETSC_COMM_WORLD) == 0) abort_all(e.what(), scene::exit_internal_error);
  } catch (const std::bad_alloc&) {
    abort_all(mpi::out_of_memory(), scene::exit_internal_error);
  } catch (const std::exception& e) {
    abort_all(std::string("internal error: ") + e.what(), scene::exit_internal_error);
  }
  sleep(10);  // for rank 0, which speaks, to end all
  return scene::exit_internal_error;
}

}  // namespace

/// In the place of MPI's own, as MPI's profiling interface provides for: hypre calls it, with -1, where it gets no memory.
int MPI_Abort(MPI_Comm comm, int code) {
  if (code == -1) abort_after_library();
  return PMPI_Abort(comm, code);
}

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
  } catch (const ResourceError& e) {
    std::fprintf(stderr, "polyslip: %s\n", e.what());
    return scene::exit_internal_error;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "polyslip: internal error: %s\n", e.what());
    return scene::exit_internal_error;
  }
}
