// The scene: everything about the physics of a run, read from one YAML file and checked before anything is computed.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "polyslip/assembly/fracture_window.hpp"
#include "polyslip/mesh/fractures.hpp"
#include "polyslip/mesh/generators.hpp"
#include "polyslip/physics/flow_problem.hpp"
#include "polyslip/physics/problem.hpp"

namespace polyslip::scene {

/// Where the mesh comes from: exactly one of `box` and `file`.
struct MeshSource {
  std::optional<mesh::BoxSpec> box;
  std::filesystem::path file;  ///< Absolute; empty for a box.
  std::filesystem::path
      write;          ///< The mesh is also written here in the native format; relative to the output folder; empty for none.
  std::string place;  ///< For messages: "scene.yaml:7 (mesh.file)".
};

/// A named point at which history.csv records displacement and pressure.
struct Probe {
  std::string name;
  Vec3 at = Vec3::Zero();  ///< [m]
  std::string place;
};

/// A named part of the fractures of which history.csv records means.
struct Window {
  std::string name;
  assembly::WindowRule rule;
  std::string place;
};

/// A named line along which displacement and pressure are written beside the fields.
struct Line {
  std::string name;
  Vec3 from = Vec3::Zero(), to = Vec3::Zero();  ///< Its ends, both among the points [m].
  int points = 2;                               ///< Equally spaced.
  std::string place;
};

struct Output {
  int every = 1;  ///< Fields are written after every so many accepted steps, and always after the last.
  int checkpoint_every = 0;  ///< A checkpoint is written after every so many accepted steps; 0: at the end and when stopped.
  std::vector<Probe> probes;
  std::vector<Window> windows;
  std::vector<Line> lines;
};

struct Scene {
  std::string name;
  std::string description;
  std::filesystem::path path;           ///< The scene file as given.
  std::map<std::string, double> study;  ///< Named numbers after overrides.
  int dim = 0;                          ///< 2 or 3; 0 when the mesh is a file and no vector of the scene tells.
  std::string dim_place;                ///< The place that told.
  MeshSource mesh;
  std::vector<mesh::FractureGeometry> fractures;
  bool has_mechanics = true;  ///< False: flow in a rigid rock; `mechanics` is empty then.
  physics::MechanicsProblem mechanics;
  std::optional<physics::FlowProblem> flow;
  physics::InitialState initial;
  physics::TimeSpan time;
  Output output;
  std::optional<physics::ExactSolution> exact;
  std::optional<physics::ExactFlow> exact_flow;
  std::vector<std::string> warnings;  ///< Of what is possible and unusual.
  std::string resolved;               ///< See resolved_yaml.
};

/// Reads, completes and checks a scene; `overrides` are "KEY=VALUE" as given to -set, applied in order before any check.
/// Throws InputError naming file:line and key (or the -set argument), the value met and the remedy.
Scene load_scene(const std::filesystem::path& file, const std::vector<std::string>& overrides = {});

/// The text of a scene file. Throws InputError when it is missing, empty or a folder.
std::string read_scene_text(const std::filesystem::path& file);

/// The same as load_scene from text already read (the ranks of a parallel run parse what rank 0 has read); `file` places messages
/// and relative paths. Whether mesh.file exists is left to its reader.
Scene parse_scene(const std::string& text, const std::filesystem::path& file, const std::vector<std::string>& overrides = {});

/// Checks what only the mesh can tell: dimension, tags, groups, regions, fractures, probes. Call on the serial mesh, on one rank,
/// before or after mark_fractures. Throws InputError with the place in the scene and the nearest name that the mesh has.
void check_against_mesh(const Scene& scene, const mesh::PolyMesh& mesh);

/// The complete scene with overrides and defaults, itself a scene: loading it gives the same Scene. File names are absolute in it.
std::string resolved_yaml(const Scene& scene);

/// All keys by group with type, unit, default and one sentence, for -help.
std::string help_text();

}  // namespace polyslip::scene
