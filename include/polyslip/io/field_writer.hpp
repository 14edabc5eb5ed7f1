// Fields over time for ParaView: matrix.xdmf + matrix.h5 (cells and node copies), fractures.xdmf + fractures.h5 (fracture faces).
//
// HDF5 layout, the same in both files (rows of all ranks in rank order):
//   /points         points x 3        matrix: node copies by global number; fractures: the corners of each face in turn, + side
//   /topology       stream x 1        XDMF "Mixed": cells or fracture faces by global number
//   /fields/<step>  attribute time    tables <name>, entities x components, step = 0, 1, ...
// A run continued on another number of ranks orders its rows in another way: /points_<step> and /topology_<step> hold from that step
// on.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
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
  int components = 1;  ///< 1; 3 for vectors (2D fields are padded by the caller with 0); 9 for tensors, row by row; 6 for symmetric
                       ///< tensors xx yy zz xy yz xz, written as 9 because programs disagree on the order of six.
  std::span<const double> values;
};

/// Writes the mesh once and a set of fields at each call, in parallel; after each call the files are complete, closed and readable.
/// The points of the matrix are the node copies, so that displacements show their jumps; ghosts are not written. A mesh without
/// fracture faces gets no fractures.* files. Collective; throws std::runtime_error when the disk refuses.
class FieldWriter {
 public:
  /// Makes the directory and replaces files of an earlier run; with `kept_until`, goes on behind its fields up to that time where there
  /// are such files in order. The mesh must outlive the writer.
  FieldWriter(const mesh::DistributedMesh& mesh, const std::filesystem::path& directory, std::optional<double> kept_until = {});
  ~FieldWriter();
  FieldWriter(const FieldWriter&) = delete;
  FieldWriter& operator=(const FieldWriter&) = delete;

  /// Time of the last fields in the files, kept or written; nothing when there are none.
  [[nodiscard]] std::optional<double> last_time() const;

  /// The same fields, by name and order, on every rank.
  void write(double time, const std::vector<Field>& fields);

 private:
  struct Files;
  std::unique_ptr<Files> files_;
};

}  // namespace polyslip::io
