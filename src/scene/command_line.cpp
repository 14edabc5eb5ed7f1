#include "polyslip/scene/command_line.hpp"

#include <fmt/format.h>
#include <petscsys.h>

#include "polyslip/common/error.hpp"
#include "polyslip/scene/scene.hpp"

namespace polyslip::scene {

namespace {

constexpr const char* usage = R"(polyslip SCENE.yaml [-o DIR] [-set KEY=VALUE]... [-validate] [-restart [FILE]] [any PETSc option, -options_file FILE]
alone or under mpirun -n N

  -o DIR             results go to DIR (default: <scene name>.out)
  -set KEY=VALUE     overrides a scene key by its path, as often as wanted: -set mesh.box.cells=[16,16,16] -set time.step=10
  -validate          checks scene and mesh, warns as a run would, and runs nothing
  -restart [FILE]    goes on from a checkpoint (default: checkpoint.h5 of DIR) as if the run had not ended, on any number of ranks;
                     time.end and output may differ from the scene of the checkpoint
  -restart_changed_scene   lets everything else of the scene differ too; the mesh must be the same
  -help, -version

Exit codes: 0 finished; 2 bad input, nothing computed; 3 not converged after the last step cut, or input that is bad at a later time; 4 no disk
or memory left, or an internal error; 143 stopped by SIGTERM or SIGINT after writing a checkpoint. Accepted steps are on disk after all but 2.

Numerics are PETSc options:
  Newton (no prefix)        -snes_rtol 1e-10, -snes_max_it 25 (before the next remedy), -snes_view, -snes_linesearch_type activeset,
                            -snes_linesearch_max_it 12, -snes_linesearch_activeset_memory 5, _decrease 1e-4, _revisits 2
  nonlinear elimination     -elimination_share 0.2 (of the displacements; 3D: 1; 0: off), _rings 4 (3D: 2), _max_it 8, every _ksp_* and
                            _pc_* option; _rock true: all displacements after that, where fluid comes with multigrid (_rock_ksp_*)
  condensed nodal system    -displacement_ksp_type, -displacement_ksp_rtol 1e-8, -displacement_pc_type (cholesky or gamg by size; lu
                            factorises the exact unsymmetric matrix), every -displacement_pc_gamg_*, _hypre_*, _mumps_* option
                            -galerkin_by_blocks true (products of GAMG, else by PETSc)
  saddle formulation        -ksp_type, -pc_type (contact.formulation: saddle; default: LU by MUMPS)
  recipes                   -options_file options/direct.opts, options/amg.opts, options/hypre.opts
  profile                   -log_view (stages read, partition, assemble, contact, condense, solve, eliminate, write)
)";

}  // namespace

CommandLine parse_command_line(int argc, char** argv) {
  CommandLine line;
  line.petsc.emplace_back(argv[0]);
  const auto value = [&](int& i) {
    if (i + 1 >= argc) throw InputError("a value is missing", fmt::format("command line, {}", argv[i]), "See polyslip -help");
    return std::string(argv[++i]);
  };
  for (int i = 1; i < argc; ++i) {
    const std::string a = argv[i];
    if (a == "-o") {
      line.output = value(i);
    } else if (a == "-set") {
      line.overrides.push_back(value(i));
    } else if (a == "-validate") {
      line.validate = true;
    } else if (a == "-restart") {
      line.restart = true;
      const bool names_file = i + 1 < argc && argv[i + 1][0] != '-' && std::filesystem::path(argv[i + 1]).extension() != ".yaml";
      if (names_file) line.checkpoint = argv[++i];
    } else if (a == "-restart_changed_scene") {
      line.restart = line.restart_changed_scene = true;
    } else if (a == "-help" || a == "--help" || a == "-h") {
      line.help = true;
    } else if (a == "-version" || a == "--version") {
      line.version = true;
    } else if (a.empty() || a[0] == '-') {
      line.petsc.push_back(a);
      // PETSc takes the next word as this option's value unless that is an option itself; a word that ends in .yaml is the scene.
      const bool has_value =
          i + 1 < argc && (argv[i + 1][0] != '-' || std::isdigit(static_cast<unsigned char>(argv[i + 1][1])) != 0);
      const bool next_is_scene = has_value && a != "-options_file" && std::filesystem::path(argv[i + 1]).extension() == ".yaml";
      if (has_value && !next_is_scene) line.petsc.emplace_back(argv[++i]);
    } else if (line.scene.empty()) {
      line.scene = a;
    } else {
      throw InputError(fmt::format("two scenes: '{}' and '{}'", line.scene.string(), a), "command line", "Give one scene file");
    }
  }
  if (line.scene.empty() && !line.help && !line.version)
    throw InputError("no scene file", "command line", "Usage: polyslip SCENE.yaml; see polyslip -help");
  return line;
}

std::string full_help() { return std::string(usage) + "\nScene keys:\n" + help_text(); }

std::string petsc_version() { return fmt::format("{}.{}.{}", PETSC_VERSION_MAJOR, PETSC_VERSION_MINOR, PETSC_VERSION_SUBMINOR); }

std::string version_text() {
  std::string text = fmt::format("polyslip {}\nPETSc {}", POLYSLIP_VERSION, petsc_version());
#ifdef PETSC_HAVE_HYPRE
  text += ", hypre";
#endif
#ifdef PETSC_HAVE_MUMPS
  text += ", MUMPS";
#endif
  return text + ", METIS, HDF5, voro++, muParser, yaml-cpp, Eigen\n";
}

}  // namespace polyslip::scene
