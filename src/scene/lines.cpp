#include "polyslip/scene/lines.hpp"

#include "polyslip/common/mpi.hpp"

namespace polyslip::scene {

namespace {

std::vector<Vec3> points_of(const Line& line) {
  std::vector<Vec3> points;
  for (int k = 0; k < line.points; ++k) {
    const double s = static_cast<double>(k) / (line.points - 1);
    points.emplace_back((1 - s) * line.from + s * line.to);
  }
  return points;
}

std::vector<std::string> columns_of(const Scene& scene) {
  std::vector<std::string> columns{"time", "distance", "x", "y", "z"};
  if (scene.has_mechanics) columns.insert(columns.end(), {"ux", "uy", "uz"});
  if (scene.flow) columns.emplace_back("pressure");
  return columns;
}

}  // namespace

LineTables::LineTables(const mesh::DistributedMesh& mesh, const Scene& scene, const std::filesystem::path& directory,
                       std::optional<double> kept_time) {
  for (const Line& line : scene.output.lines) {
    Profile& profile = profiles_.emplace_back();
    profile.points = points_of(line);
    if (scene.has_mechanics) profile.displacements.emplace(mesh, profile.points);
    if (scene.flow) profile.pressures.emplace(mesh, profile.points);
    mpi::on_root(mesh.comm, [&] {
      profile.table = io::CsvTable(directory / ("line_" + line.name + ".csv"), columns_of(scene), kept_time);
    });
  }
}

void LineTables::write(const Model& model, double time) {
  for (Profile& profile : profiles_) {
    std::vector<double> u, p;
    if (profile.displacements) u = profile.displacements->displacements(*model.mechanics(), model.displacement().trial);
    if (profile.pressures) p = profile.pressures->pressures(*model.flow(), model.pressure().trial);
    for (std::size_t k = 0; k < profile.points.size(); ++k) {
      const Vec3& x = profile.points[k];
      std::vector<double> row{time, (x - profile.points[0]).norm(), x[0], x[1], x[2]};
      if (!u.empty()) row.insert(row.end(), &u[3 * k], &u[3 * k] + 3);
      if (!p.empty()) row.push_back(p[k]);
      profile.table.row(row);
    }
  }
}

}  // namespace polyslip::scene
