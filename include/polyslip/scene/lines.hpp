// Profiles along the lines of a scene: line_NAME.csv, a row a point and time.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "polyslip/assembly/flow_fields.hpp"
#include "polyslip/assembly/mechanics_fields.hpp"
#include "polyslip/io/csv.hpp"
#include "polyslip/scene/model.hpp"

namespace polyslip::scene {

/// Columns: time, distance from the first point, x, y, z; ux, uy, uz where there is mechanics; pressure where there is flow.
class LineTables {
 public:
  /// Replaces files of an earlier run; with `kept_time`, goes on behind their rows up to that time. Collective.
  LineTables(const mesh::DistributedMesh& mesh, const Scene& scene, const std::filesystem::path& directory,
             std::optional<double> kept_time);

  void write(const Model& model, double time);

 private:
  struct Profile {
    std::vector<Vec3> points;
    std::optional<assembly::DisplacementProbes> displacements;
    std::optional<assembly::PressureProbes> pressures;
    io::CsvTable table;  ///< Of rank 0; those of other ranks write nothing.
  };
  std::vector<Profile> profiles_;
};

}  // namespace polyslip::scene
