#include "polyslip/solver/active_set_search.hpp"

#include <fmt/format.h>
#include <petsc/private/linesearchimpl.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <string_view>

#include "polyslip/common/mpi.hpp"

namespace polyslip::solver {

using assembly::MechanicsSystem;

std::uint64_t ActiveSetTrace::hash() const {
  const std::string_view bytes(reinterpret_cast<const char*>(states.data()), states.size());
  // Ranks are told apart by a salt; the sum does not depend on the order of reduction.
  const MPI_Comm comm = system->mesh().comm;
  const std::size_t here = std::hash<std::string>{}(std::string(bytes) + std::to_string(mpi::rank(comm)));
  return static_cast<std::uint64_t>(mpi::sum(comm, static_cast<long long>(here >> 1)));
}

void ActiveSetTrace::start(Vec x) {
  adjust(x);
  flips.assign(states.size(), 0);
  merits.clear();
  visits_.clear();
  revisits_ = 0;
  changed = 0;
  step_length = 1;
  cycle = false;
}

void ActiveSetTrace::advance(Vec x, double merit, int revisits_of_a_cycle) {
  const auto before = std::exchange(states, system->states(x));
  std::array<long long, 2> flipped{};
  for (std::size_t f = 0; f < states.size(); ++f)
    if (states[f] != before[f]) {
      using enum physics::ContactState;
      ++flips[f];
      ++flipped[0];
      if (states[f] == open || before[f] == open) ++flipped[1];
    }
  mpi::sum_in_place(system->mesh().comm, flipped);
  changed = flipped[0];
  opened_or_closed = flipped[1];
  counts = system->count(states);
  merits.push_back(merit);
  const std::uint64_t now = hash();
  if (revisits_of_a_cycle > 0 && changed > 0) {
    const auto met = std::find_if(visits_.rbegin(), visits_.rend(), [&](const Visit& v) { return v.hash == now; });
    if (met != visits_.rend() && merit > 0.25 * met->merit) ++revisits_;
    if (revisits_ >= revisits_of_a_cycle) {
      cycle = true;
      ++cycles;
    }
  }
  visits_.push_back({now, merit});
}

void ActiveSetTrace::adjust(Vec x) {
  states = system->states(x);
  counts = system->count(states);
}

std::string ActiveSetTrace::flickering() const {
  constexpr std::size_t most = 5;
  std::vector<std::size_t> order(flips.size());
  std::iota(order.begin(), order.end(), 0);
  const std::size_t n = std::min(most, order.size());
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(n), order.end(),
                    [&](std::size_t a, std::size_t b) { return flips[a] > flips[b]; });
  std::string text;
  const mesh::DistributedMesh& mesh = system->mesh();
  for (std::size_t k = 0; k < n && flips[order[k]] > 2; ++k) {
    const auto f = static_cast<Index>(order[k]);
    const Vec3& x = system->contact_cells().faces()[f].centre;
    text += fmt::format("{}{} at ({:.4g}, {:.4g}, {:.4g}) {} times", text.empty() ? "" : "; ",
                        mesh.mesh.fracture_names[mesh.mesh.face_fracture[mesh.fracture_faces[f]]], x.x(), x.y(), x.z(), flips[order[k]]);
  }
  std::string all;
  for (int rank = 0; rank < mpi::size(mesh.comm); ++rank) {
    const std::string part = mpi::broadcast(mesh.comm, text, rank);
    if (!part.empty()) all += (all.empty() ? "" : "; ") + part;
  }
  return all.empty() ? all : "faces that keep changing state: " + all;
}

namespace {

/// Options of the type, kept in SNESLineSearch::data.
struct ActiveSetOptions {
  PetscInt memory = 5;
  PetscReal decrease = 1e-4;
  PetscInt revisits = 2;
};

/// The step length by the rule at the head of the header; its merit comes back in `merit`.
double search(const MechanicsSystem& system, const assembly::ContactLine& line, const ActiveSetTrace& trace,
              const ActiveSetOptions& options, int max_it, double* merit) {
  const std::vector<double>& merits = trace.merits;
  if (merits.empty()) {
    // The start need not be in equilibrium, and its contact rows mean nothing then: the full step balances the momentum rows for good.
    *merit = system.contact_merit(line, 1.0);
    return 1;
  }
  const auto memory = static_cast<std::ptrdiff_t>(std::min<std::size_t>(merits.size(), static_cast<std::size_t>(options.memory)));
  const double reference = *std::max_element(merits.end() - memory, merits.end());
  double best_alpha = 1, best = INFINITY, alpha = 1;
  for (int k = 0; k < max_it; ++k, alpha /= 2) {
    const double phi = system.contact_merit(line, alpha);
    if (std::isfinite(phi) && phi < best) {
      best = phi;
      best_alpha = alpha;
    }
    if (phi <= std::max(trace.settled_merit, (1 - 2 * options.decrease * alpha) * reference)) break;
  }
  *merit = best;
  return best_alpha;
}

PetscErrorCode apply(SNESLineSearch search_object) {
  PetscFunctionBeginUser;
  Vec x = nullptr, f = nullptr, y = nullptr, w = nullptr, g = nullptr;
  SNES snes = nullptr;
  ActiveSetTrace* trace = nullptr;
  PetscReal gnorm = 0;
  auto* options = static_cast<ActiveSetOptions*>(search_object->data);
  PetscCall(SNESLineSearchGetVecs(search_object, &x, &f, &y, &w, &g));
  PetscCall(SNESLineSearchGetSNES(search_object, &snes));
  PetscCall(SNESGetApplicationContext(snes, &trace));
  PetscCall(SNESLineSearchSetReason(search_object, SNES_LINESEARCH_SUCCEEDED));
  PetscReal ynorm = 0;
  PetscCall(VecNorm(y, NORM_2, &ynorm));
  if (PetscIsInfOrNanReal(ynorm)) {
    PetscCall(SNESLineSearchSetReason(search_object, SNES_LINESEARCH_FAILED_NANORINF));
    PetscFunctionReturn(0);
  }
  MechanicsSystem& system = *trace->system;
  double alpha = 1, merit = 0;
  PetscCallCXX(system.momentum_action(y, g));
  // A scene without fractures is linear: the full step is exact.
  if (system.fracture_faces() == 0) {
    PetscCall(VecAXPY(f, -alpha, g));
    PetscCall(VecAXPY(x, -alpha, y));
  } else {
    assembly::ContactLine line;
    PetscCallCXX(line = system.contact_line(x, y));
    PetscCallCXX(alpha = search(system, line, *trace, *options, static_cast<int>(search_object->max_its), &merit));
    PetscCall(VecAXPY(f, -alpha, g));
    PetscCall(VecAXPY(x, -alpha, y));
    PetscCallCXX(system.set_contact_rows(line, alpha, f));
  }
  if (!system.is_linear_off_contact()) PetscCall(SNESComputeFunction(snes, x, f));
  trace->step_length = alpha;
  PetscCallCXX(trace->advance(x, merit, static_cast<int>(options->revisits)));
  PetscCall(SNESLineSearchSetLambda(search_object, alpha));
  PetscCall(VecNorm(f, NORM_2, &gnorm));
  PetscReal xnorm = 0;
  PetscCall(VecNorm(x, NORM_2, &xnorm));
  PetscCall(SNESLineSearchSetNorms(search_object, xnorm, gnorm, alpha * ynorm));
  PetscFunctionReturn(0);
}

PetscErrorCode view(SNESLineSearch search_object, PetscViewer viewer) {
  PetscFunctionBeginUser;
  PetscBool ascii = PETSC_FALSE;
  const auto* options = static_cast<ActiveSetOptions*>(search_object->data);
  PetscCall(PetscObjectTypeCompare(reinterpret_cast<PetscObject>(viewer), PETSCVIEWERASCII, &ascii));
  if (ascii)
    PetscCall(PetscViewerASCIIPrintf(viewer, "  nonmonotone on contact rows: memory=%" PetscInt_FMT ", decrease=%g, revisits=%" PetscInt_FMT "\n",
                                     options->memory, static_cast<double>(options->decrease), options->revisits));
  PetscFunctionReturn(0);
}

PetscErrorCode set_from_options(SNESLineSearch search_object, PetscOptionItems* PetscOptionsObject) {
  PetscFunctionBeginUser;
  auto* options = static_cast<ActiveSetOptions*>(search_object->data);
  PetscOptionsHeadBegin(PetscOptionsObject, "Active-set line search options");
  PetscCall(PetscOptionsInt("-snes_linesearch_activeset_memory", "Residuals that a step may compare with", "SNESLineSearch", options->memory,
                            &options->memory, nullptr));
  PetscCall(PetscOptionsReal("-snes_linesearch_activeset_decrease", "Sufficient decrease", "SNESLineSearch", options->decrease,
                             &options->decrease, nullptr));
  PetscCall(PetscOptionsInt("-snes_linesearch_activeset_revisits", "Revisits of an active set that make a cycle (0: never)", "SNESLineSearch",
                            options->revisits, &options->revisits, nullptr));
  PetscOptionsHeadEnd();
  PetscFunctionReturn(0);
}

PetscErrorCode destroy(SNESLineSearch search_object) {
  PetscFunctionBeginUser;
  delete static_cast<ActiveSetOptions*>(search_object->data);
  search_object->data = nullptr;
  PetscFunctionReturn(0);
}

PetscErrorCode create(SNESLineSearch search_object) {
  PetscFunctionBeginUser;
  search_object->ops->apply = apply;
  search_object->ops->view = view;
  search_object->ops->setfromoptions = set_from_options;
  search_object->ops->destroy = destroy;
  search_object->data = new ActiveSetOptions;
  search_object->max_its = 12;
  PetscFunctionReturn(0);
}

}  // namespace

PetscErrorCode register_active_set_search() {
  PetscFunctionBeginUser;
  PetscCall(SNESLineSearchRegister(active_set_search, create));
  PetscFunctionReturn(0);
}

}  // namespace polyslip::solver
