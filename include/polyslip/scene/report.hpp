// What a run tells of itself: its size at the start, errors and counters at the end, in the log and in summary.json.
#pragma once

#include "polyslip/io/summary.hpp"
#include "polyslip/scene/log.hpp"
#include "polyslip/scene/tables.hpp"

namespace polyslip::scene {

/// Mesh, unknowns and solvers, into the log and the summary.
void report_start(const Log& log, io::Summary& summary, const Scene& scene, const Model& model);

/// The figures of the last step, and the largest errors of the books so far.
void add_figures(io::Summary& summary, const Model& model, const StepFigures& figures);

/// One line a step.
void report_step(const Log& log, const Model& model, const solver::StepRecord& record, const StepFigures& figures);

void report_newton(const Log& log, const Model& model, const solver::NewtonRecord& record);

/// Errors against the scene's exact solution at the accepted state, into the log and the summary. Collective.
void report_errors(const Log& log, io::Summary& summary, const Scene& scene, const Model& model, double time);

/// What the solvers have done in this process, beside what the summary has of earlier ones.
void add_solver_counters(io::Summary& summary, const Model& model);

/// Counters and times of a run that has ended. Collective.
void add_counters(io::Summary& summary, const Model& model, const solver::StepperResult& result, const solver::StepperState& steps);

/// "3 min 20 s", for waiting times.
std::string duration(double seconds);

/// How the run ended and what it took, in a line.
std::string closing_line(const io::Summary& summary);

}  // namespace polyslip::scene
