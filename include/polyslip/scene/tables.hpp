// history.csv and newton.csv, and the numbers of a step that they share with log and summary.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "polyslip/assembly/flow_fields.hpp"
#include "polyslip/assembly/fracture_window.hpp"
#include "polyslip/assembly/mechanics_fields.hpp"
#include "polyslip/io/csv.hpp"
#include "polyslip/scene/model.hpp"

namespace polyslip::scene {

/// Of one step, between its solution and its acceptance; of an accepted state without books.
struct StepFigures {
  std::vector<assembly::FractureFaceValues> fractures;  ///< Of the owned fracture faces; empty without contact.
  assembly::StateCounts counts;
  assembly::FractureExtremes extremes;
  std::optional<assembly::PressureExtremes> pressure;
  std::optional<Books> books;
};
/// All but the books.
StepFigures figures_of(const Model& model);

/// Columns of history.csv: step, time, sizes, iterations, contact; displacements at the probes; books, pressures, outflow and
/// pressure of named parts of the boundary, pressures at the probes; windows. Those of mechanics, or of flow, are there where the
/// scene has it.
class Tables {
 public:
  /// Replaces files of an earlier run; with `kept_steps`, goes on behind their rows up to that step.
  Tables(const mesh::DistributedMesh& mesh, const Scene& scene, const std::filesystem::path& directory,
         std::optional<double> kept_steps);

  void step(const Model& model, const solver::StepRecord& record, const StepFigures& figures);
  void newton(int step, const solver::NewtonRecord& record);

 private:
  void add_windows(const Model& model, const StepFigures& figures, std::vector<double>& row) const;

  std::optional<assembly::DisplacementProbes> displacement_probes_;
  std::optional<assembly::PressureProbes> pressure_probes_;
  std::vector<assembly::FractureWindow> windows_;
  io::CsvTable history_, newton_;  ///< Of rank 0; those of other ranks write nothing.
};

}  // namespace polyslip::scene
