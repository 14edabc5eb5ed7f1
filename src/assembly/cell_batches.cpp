#include "polyslip/assembly/cell_batches.hpp"

namespace polyslip::assembly {

double bytes_of_geometry(const mesh::PolyMesh& mesh) {
  const auto bytes = [](const auto& values) { return static_cast<double>(values.size() * sizeof(values[0])); };
  double sum = bytes(mesh.nodes) + bytes(mesh.face_cells);
  for (const Csr* rows : {&mesh.face_nodes, &mesh.cell_faces, &mesh.cell_nodes}) sum += bytes(rows->offsets) + bytes(rows->values);
  return sum;
}

double bytes_of_entries(Mat matrix) {
  MatInfo info;
  POLYSLIP_PETSC(MatGetInfo(matrix, MAT_LOCAL, &info));
  return info.nz_used * sizeof(PetscScalar);
}

}  // namespace polyslip::assembly
