#include "polyslip/mesh/flow_entities.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <map>

#include "polyslip/mesh/cut.hpp"

namespace polyslip::mesh {

namespace {

void number_traces(const PolyMesh& whole, FlowEntities& flow) {
  flow.face_traces.reserve(whole.n_faces());
  flow.trace_face.reserve(whole.n_faces());
  for (Index face = 0; face < whole.n_faces(); ++face) {
    const auto trace = static_cast<Index>(flow.trace_face.size());
    flow.trace_face.push_back(face);
    if (whole.on_boundary(face)) {
      flow.face_traces.push_back({trace, -1});
    } else if (whole.on_fracture(face)) {
      flow.face_traces.push_back({trace, trace + 1});
      flow.trace_face.push_back(face);
    } else {
      flow.face_traces.push_back({trace, trace});
    }
  }
  flow.traces = all_owned(static_cast<Index>(flow.trace_face.size()));
  flow.trace_input = counted(flow.traces);
}

/// Nodes of the ridge at place i of a face, the lower number first.
std::array<Index, 2> nodes_of_ridge(const PolyMesh& whole, Index face, std::size_t i) {
  const auto nodes = whole.face_nodes[face];
  if (whole.dim == 2) return {nodes[i], -1};
  const auto [low, high] = std::minmax(nodes[i], nodes[(i + 1) % nodes.size()]);
  return {low, high};
}

void number_ridges(const PolyMesh& whole, FlowEntities& flow) {
  std::map<std::array<Index, 2>, Index> number;
  for (const Index face : inner_fracture_faces(whole)) {
    std::vector<Index> ridges;
    for (std::size_t i = 0; i < whole.face_nodes[face].size(); ++i) {
      const auto nodes = nodes_of_ridge(whole, face, i);
      const auto [found, is_new] = number.try_emplace(nodes, static_cast<Index>(flow.ridge_nodes.size()));
      if (is_new) flow.ridge_nodes.push_back(nodes);
      ridges.push_back(found->second);
    }
    flow.fracture_ridges.push_row(ridges);
  }
  flow.ridges = all_owned(static_cast<Index>(flow.ridge_nodes.size()));
  flow.ridge_input = counted(flow.ridges);
}

/// Boundary faces at each node of a ridge (other nodes: none), ascending.
std::map<Index, std::vector<Index>> boundary_faces_at_ridges(const PolyMesh& whole, const FlowEntities& flow) {
  std::vector<char> at_ridge(whole.n_nodes(), 0);
  for (const auto& nodes : flow.ridge_nodes) {
    for (const Index node : nodes) {
      if (node >= 0) at_ridge[node] = 1;
    }
  }
  std::map<Index, std::vector<Index>> faces;
  for (Index face = 0; face < whole.n_faces(); ++face) {
    if (!whole.on_boundary(face)) continue;
    for (const Index node : whole.face_nodes[face]) {
      if (at_ridge[node] != 0) faces[node].push_back(face);
    }
  }
  return faces;
}

void find_boundary_faces(const PolyMesh& whole, FlowEntities& flow) {
  auto at_node = boundary_faces_at_ridges(whole, flow);
  for (const auto& [first, second] : flow.ridge_nodes) {
    std::vector<Index> faces = at_node[first];
    if (second >= 0) {
      const std::vector<Index>& others = at_node[second];
      std::erase_if(faces, [&](Index face) { return !std::binary_search(others.begin(), others.end(), face); });
    }
    flow.ridge_boundary_faces.push_row(faces);
  }
}

}  // namespace

std::vector<Index> inner_fracture_faces(const PolyMesh& whole) {
  std::vector<Index> faces;
  for (Index face = 0; face < whole.n_faces(); ++face) {
    if (whole.on_fracture(face) && !whole.on_boundary(face)) faces.push_back(face);
  }
  return faces;
}

FlowEntities flow_entities(const PolyMesh& whole) {
  FlowEntities flow;
  number_traces(whole, flow);
  number_ridges(whole, flow);
  find_boundary_faces(whole, flow);
  return flow;
}

Sharers trace_sharers(const PolyMesh& whole, const FlowEntities& flow, const std::vector<Index>& part) {
  Sharers sharers(static_cast<Index>(flow.trace_face.size()));
  for (std::size_t face = 0; face < flow.face_traces.size(); ++face) {
    for (int side = 0; side < 2; ++side) {
      const Index trace = flow.face_traces[face][side];
      if (trace >= 0) sharers.add(trace, part[whole.face_cells[face][side]]);
    }
  }
  return sharers;
}

std::vector<Index> ridge_owner(const PolyMesh& whole, const FlowEntities& flow, const std::vector<Index>& part) {
  std::vector<Index> owner(flow.ridge_nodes.size(), std::numeric_limits<Index>::max());
  if (flow.empty()) return owner;
  const std::vector<Index> faces = inner_fracture_faces(whole);
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const Index rank = part[whole.face_cells[faces[i]][0]];
    for (const Index ridge : flow.fracture_ridges[static_cast<Index>(i)]) owner[ridge] = std::min(owner[ridge], rank);
  }
  return owner;
}

}  // namespace polyslip::mesh
