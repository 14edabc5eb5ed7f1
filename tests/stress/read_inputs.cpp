// Reads many scenes in one process, as far as a run goes before its first output: starting MPI and PETSc anew for each would take most of
// the time.
//
// usage: read_inputs < JOBS. A job is a line: a scene file and overrides KEY=VALUE, separated by tabs; a job whose line starts with "+" is
// also taken through its first step. For each one line of JSON is written: {"end": "accepted" | "refused" | "foreign", "message": ...}.
#include <petscsys.h>
#include <unistd.h>
#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/lsan_interface.h>
#endif

#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "polyslip/common/error.hpp"
#include "polyslip/common/mpi.hpp"
#include "polyslip/scene/prepare.hpp"
#include "stress/set_up.hpp"

using namespace polyslip;

namespace {

constexpr unsigned seconds_allowed = 20;    ///< For one job; then SIGALRM ends the process.
constexpr double most_cells = 20'000;       ///< Boxes with more are not meshed: that is correct, but takes its time.

double cells_of(const mesh::BoxSpec& box) {
  double cells = 1;
  for (int axis = 0; axis < box.dim; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    cells *= box.grading[i] ? (box.max[i] - box.min[i]) / box.grading[i]->size : box.cells[i];
  }
  return cells;
}

/// The same order as in a run.
void read(const scene::CommandLine& line, bool first_step) {
  const scene::Scene scene = scene::read_scene(PETSC_COMM_SELF, line);
  if (scene.mesh.box && cells_of(*scene.mesh.box) > most_cells) return;
  stress::set_up(scene, scene::build_serial_mesh(PETSC_COMM_SELF, scene, {}), first_step);
}

nlohmann::json outcome(const std::string& job) {
  const bool first_step = job.starts_with('+');
  scene::CommandLine line;
  std::istringstream words(job.substr(first_step ? 1 : 0));
  std::string word;
  std::getline(words, word, '\t');
  line.scene = word;
  while (std::getline(words, word, '\t')) line.overrides.push_back(word);
  try {
    read(line, first_step);
    return {{"end", "accepted"}, {"message", ""}};
  } catch (const InputError& error) {
    return {{"end", "refused"}, {"message", error.what()}};
  } catch (const std::exception& error) {
    return {{"end", "foreign"}, {"message", error.what()}};
  }
}

/// Whether memory has been lost since start-up, as far as the address sanitizer is there to tell. To be asked before Open MPI unloads its modules, as what
/// they leak could not be told from our leaks afterwards.
int leaks() {
#ifdef __SANITIZE_ADDRESS__
  return __lsan_do_recoverable_leak_check();
#else
  return 0;
#endif
}

bool start(int* argc, char*** argv) {
#ifdef __SANITIZE_ADDRESS__
  const __lsan::ScopedDisabler not_ours;
#endif
  mpi::choose_file_layer();
  return PetscInitialize(argc, argv, nullptr, nullptr) == 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (!start(&argc, &argv)) return 1;
  stress::prepare();
  for (std::string job; std::getline(std::cin, job);) {
    alarm(seconds_allowed);
    std::cout << outcome(job).dump(-1, ' ', true, nlohmann::json::error_handler_t::replace) << std::endl;
  }
  alarm(0);
  if (leaks() != 0) _exit(1);
  PetscFinalize();
  _exit(0);  // what the libraries keep until then is not ours
}
