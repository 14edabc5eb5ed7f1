// The entities of a whole mesh that carry flow unknowns beside cells and fracture faces (scheme.md section 4), and who owns them.
#pragma once

#include <vector>

#include "polyslip/mesh/cut.hpp"
#include "polyslip/mesh/distributed_mesh.hpp"

namespace polyslip::mesh {

/// Faces on Gamma with a cell on both sides, ascending: the fracture faces of a whole mesh.
std::vector<Index> inner_fracture_faces(const PolyMesh& whole);

/// Traces and ridges of a whole mesh, all owned by one rank. Traces are numbered by face, the + side first; ridges by the first
/// fracture face that has them and their place in it. Linear in the faces but for a sorted map of the ridges.
FlowEntities flow_entities(const PolyMesh& whole);

/// Those of each trace. part[c] is the rank of cell c.
Sharers trace_sharers(const PolyMesh& whole, const FlowEntities& flow, const std::vector<Index>& part);
/// Owner of each ridge: the lowest rank that owns a fracture face (its + cell) which has it.
std::vector<Index> ridge_owner(const PolyMesh& whole, const FlowEntities& flow, const std::vector<Index>& part);

}  // namespace polyslip::mesh
