// summary.json, as interface.md says, with the build, the bytes an unknown, the balance between ranks and the work of assembly.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace polyslip::io {

struct Summary {
  std::string scene, version, status = "finished", message;
  int ranks = 1;
  // clang-format off
  struct { std::string petsc, type; } build;
  struct { int dimension = 0; long long cells = 0, faces = 0, nodes = 0, fracture_faces = 0; double h_max = 0, h_min = 0; } mesh;
  struct { long long displacement_nodal = 0, displacement_bubble = 0, multiplier = 0, pressure = 0, total = 0, solved = 0; } dofs;
  struct { int accepted = 0, rejected = 0; } steps;
  struct { int total = 0, max_per_step = 0; } newton;
  struct { int total = 0, max_per_solve = 0; } krylov;
  struct { int preconditioner = 0, factorisation = 0; } setups;
  struct { long long open = 0, stick = 0, slip = 0, cycles_detected = 0; } active_set;
  struct { std::optional<double> mass_error_max, energy_violation_max; } balance;
  struct {
    std::optional<double> displacement_l2, gradient_l2, multiplier_normal_l2, multiplier_tangential_l2, jump_normal_l2,
        jump_tangential_l2, pressure_l2, flux_l2;
  } errors;
  struct { std::optional<double> max_slip, max_opening, min_pressure, max_pressure, mean_pressure; } extremes;
  struct { double total = 0, read = 0, partition = 0, assemble = 0, condense = 0, solve = 0, write = 0; } seconds;
  /// Largest over mean of the ranks, 1 where all have the same: owned cells, owned unknowns, and the processor's seconds in the kernels.
  struct { std::optional<double> cells, unknowns, assembly; } imbalance;
  // clang-format on
  /// A kernel of the assembly of a field: seconds of the processor on the slowest rank, operations and bytes of all ranks.
  struct Kernel {
    std::string field, name;
    double seconds = 0, flops = 0, bytes = 0;
  };
  std::vector<Kernel> kernels;
  std::vector<double> peak_memory_mb_per_rank;

  /// Peak memory of all ranks over all unknowns, eliminated ones too [bytes]; absent where memory or unknowns are not known.
  [[nodiscard]] std::optional<double> bytes_per_unknown() const;
};

/// Writes atomically (a temporary file renamed). What is absent is null. Call on rank 0.
void write_summary(const Summary& summary, const std::filesystem::path& file);

}  // namespace polyslip::io
