// What a scene says of flow: the sections fluid and flow, hydraulic keys of materials, exact pressure and flux.
#pragma once

#include <optional>

#include "polyslip/scene/checks.hpp"
#include "polyslip/scene/document.hpp"

namespace polyslip::scene {

/// Throws InputError where keys of flow contradict each other, lack the section flow, or leave the pressure undetermined.
void check_flow(const Cursor& root);

/// Throws InputError for a tag, region or fracture that the mesh does not have, and for fractures without an aperture.
void check_flow_names(const Scene& scene, const MeshNames& mesh);

/// Nothing without the section flow.
std::optional<physics::FlowProblem> read_flow(const Cursor& root);

std::optional<physics::ExactFlow> read_exact_flow(const Cursor& exact);

}  // namespace polyslip::scene
