// Fields over time for ParaView: matrix.xdmf + matrix.h5 (cells and node copies) and fractures.xdmf + fractures.h5 (fracture
// faces).
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "polyslip/mesh/distributed_mesh.hpp"

namespace polyslip::io {

enum class Location { cell, copy, fracture_face };

/// Values of the owned entities at least, entity by entity: values[components * i + c].
struct Field {
  std::string name;
  Location on = Location::cell;
  int components = 1;  ///< 1, or 3 for vectors (2D fields are padded by the caller with 0).
  std::span<const double> values;
};

/// Writes the mesh once and a set of fields at each call, in parallel; after each call the files are complete and readable.
/// The points of the matrix are the node copies, so that displacements show their jumps; ghosts are not written.
class FieldWriter {
 public:
  FieldWriter(const mesh::DistributedMesh& mesh, const std::filesystem::path& directory);
  ~FieldWriter();
  FieldWriter(const FieldWriter&) = delete;
  FieldWriter& operator=(const FieldWriter&) = delete;

  void write(double time, const std::vector<Field>& fields);

 private:
  struct Files;
  std::unique_ptr<Files> files_;
};

}  // namespace polyslip::io
