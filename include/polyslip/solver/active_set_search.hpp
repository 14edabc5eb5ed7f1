// SNESLineSearch type "activeset": a nonmonotone search on the contact rows alone, with detection of cycles of the active set.
//
// The momentum rows are linear: at x - alpha y they are R - alpha A y with one product A y. Only contact rows are evaluated again:
//   accept the first alpha in 1, 1/2, 1/4, ... with  phi(alpha) <= (1 - 2 sigma alpha) max(last m values of phi),   phi = |R_contact|^2,
//   or phi(alpha) so small that the contact rows count as solved, else the best of those tried. The first step of a solve is always full: it brings the momentum rows into balance.
// After each step the states of all faces are hashed; a set of states met before, left since, and met again without the residual
// having halved, is a revisit; the second revisit is a cycle and ends the solve (SNES_DIVERGED_LINE_SEARCH).
//
// | option                                 | meaning                                   | default |
// | -snes_linesearch_max_it                | values of alpha tried                     | 12      |
// | -snes_linesearch_activeset_memory      | m                                         | 5       |
// | -snes_linesearch_activeset_decrease    | sigma                                     | 1e-4    |
// | -snes_linesearch_activeset_revisits    | revisits that make a cycle, 0: never      | 2       |
#pragma once

#include <string>
#include <vector>

#include "polyslip/assembly/mechanics_system.hpp"

namespace polyslip::solver {

inline constexpr const char* active_set_search = "activeset";

/// What the search knows and leaves for the convergence test and the monitor; the SNES's application context.
struct ActiveSetTrace {
  assembly::MechanicsSystem* system = nullptr;

  std::vector<physics::ContactState> states;  ///< Of the owned faces at the current iterate.
  std::vector<int> flips;                     ///< How often each owned face has changed state in this solve.
  assembly::StateCounts counts;
  long long changed = 0;      ///< Faces that changed state in the last step, over all ranks.
  long long opened_or_closed = 0;  ///< Those of them that opened or closed.
  double step_length = 1;     ///< alpha of the last step
  double settled_merit = 0;   ///< phi below which no step is shortened: what is left of the contact rows is round-off, or less than the other rows.
  bool cycle = false;
  long long cycles = 0;       ///< Cycles met since the start of the run.

  /// Forgets the past before a new solve from x.
  void start(Vec x);
  /// Takes over the states at the new iterate; `merit` is phi there.
  void advance(Vec x, double merit, int revisits_of_a_cycle);
  /// Takes over the states at x, which something else than a step has changed.
  void adjust(Vec x);
  /// phi values of the last iterations, newest last.
  std::vector<double> merits;

  /// Sentence that names the faces which change state most often, on all ranks; empty where there is none.
  [[nodiscard]] std::string flickering() const;

 private:
  struct Visit {
    std::uint64_t hash;
    double merit;
  };
  std::vector<Visit> visits_;
  int revisits_ = 0;
  [[nodiscard]] std::uint64_t hash() const;
};

/// Registers the type with PETSc; call once after PetscInitialize.
PetscErrorCode register_active_set_search();

}  // namespace polyslip::solver
