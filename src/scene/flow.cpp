#include "polyslip/scene/flow.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "polyslip/common/error.hpp"

namespace polyslip::scene {

namespace {

// Checks

void refuse_without_flow(const Cursor& key) {
  if (key)
    refuse(key, "this has a meaning with flow only, and there is no section flow", "Add the section (flow: {}), or remove the key");
}

void check_no_flow(const Cursor& root) {
  for (const Cursor& rule : root["materials"].entries())
    for (const char* key : hydraulic_keys) refuse_without_flow(rule[key]);
  refuse_without_flow(root["fluid"]);
  for (const char* key : {"pressure", "flux"}) refuse_without_flow(root["exact"][key]);
}

bool same(const Expression& a, const Expression& b) {
  return a.text() == b.text() || (a.is_constant() && b.is_constant() && a({}) == b({}));
}

void check_symmetric(const Cursor& matrix) {
  const std::vector<Cursor> rows = matrix.entries();
  for (std::size_t i = 0; i < rows.size(); ++i)
    for (std::size_t j = i + 1; j < rows.size(); ++j) {
      const Cursor upper = rows[i].entries()[j], lower = rows[j].entries()[i];
      if (!same(upper.expression(), lower.expression()))
        refuse(lower, fmt::format("\"{}\" differs from \"{}\" across the diagonal", lower.text(), upper.text()),
               "Give a symmetric matrix");
    }
}

void check_permeability(const Cursor& permeability) {
  if (!permeability.is_list() || !permeability.entries()[0].is_list()) return;  // Positive entries are enough.
  check_symmetric(permeability);
  const std::array<Expression, 6> k = permeability.tensor();
  if (!std::ranges::all_of(k, &Expression::is_constant)) return;
  std::array<double, 6> c{};
  std::ranges::transform(k, c.begin(), [](const Expression& entry) { return entry({}); });
  Eigen::Matrix3d matrix;
  matrix << c[0], c[3], c[5], c[3], c[1], c[4], c[5], c[4], c[2];
  if (permeability.entries().size() == 2) matrix(2, 2) = c[0];  // Not used in 2D.
  const double smallest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(matrix, Eigen::EigenvaluesOnly).eigenvalues()[0];
  if (smallest <= 0)
    refuse(permeability, fmt::format("the matrix has the eigenvalue {:.3g}", smallest), "Give a positive definite matrix");
}

void check_materials(const Cursor& root) {
  const std::vector<Cursor> rules = root["materials"].entries();
  for (const Cursor& rule : rules) {
    if (rule["biot_modulus"] && rule["storage"])
      refuse(rule["storage"], "both biot_modulus and storage are given", "Remove one: storage is 1/biot_modulus");
    if (rule["permeability"]) check_permeability(rule["permeability"]);
  }
  if (std::ranges::none_of(rules, [](const Cursor& rule) { return bool(rule["permeability"]); }))
    refuse(root["materials"], "no material gives the permeability, and there is a section flow", "Give permeability [m2]");
}

void check_boundary_rule(const Cursor& rule) {
  if (rule["pressure"] && rule["flux"]) refuse(rule["flux"], "both pressure and flux are given", "Remove one");
  if (!rule["pressure"] && !rule["flux"]) refuse(rule, "the rule gives neither pressure nor flux", "Give one");
}

void refuse_without_fluid_in_fractures(const Cursor& key, const Cursor& flow) {
  if (key && !flow["fractures"])
    refuse(key, "the fractures hold no fluid", "Add flow.fractures with contact_aperture, or remove the key");
}

void check_source(const Cursor& source, const Cursor& flow) {
  if (source["region"] && source["fracture"])
    refuse(source["fracture"], "both region and fracture are given", "Make it two sources");
  refuse_without_fluid_in_fractures(source["fracture"], flow);
  if (!source["fracture"] && source["rate"].expression().depends_on_fracture())
    refuse(source["rate"], "tip_distance and fracture_length have a meaning on fractures only", "Use position, or name a fracture");
}

void check_dilation(const Cursor& rule) {
  if (rule["dilation"] && rule["dilation_angle"])
    refuse(rule["dilation_angle"], "both dilation and dilation_angle are given",
           "Remove one: dilation is the tangent of the angle");
}

void check_fractures(const Cursor& root) {
  const Cursor fractures = root["flow"]["fractures"];
  if (!fractures) return;
  if (!may_have_fractures(root))
    refuse(fractures, "there is a section flow.fractures but no fracture", "Remove the section, or give fractures");
  const std::vector<Cursor> entries = fractures["fractures"].entries();
  check_unique(entries, "name");
  check_dilation(fractures);
  bool each_has_its_own = root["fractures"] ? cover_all_fractures(entries, root) : !entries.empty();  // Of a file: see the mesh.
  for (const Cursor& entry : entries) {
    check_dilation(entry);
    each_has_its_own = each_has_its_own && entry["contact_aperture"];
  }
  if (!fractures["contact_aperture"] && !each_has_its_own)
    refuse(fractures["contact_aperture"], fmt::format("the key \"{}\" is missing", fractures["contact_aperture"].path()),
           "Give the aperture of the closed fracture [m]");
  const Cursor given = root["contact"]["fracture_pressure"];
  if (given && !given.expression().is_zero())
    refuse(given, "the pressure in the fractures is computed, as there is flow.fractures", "Remove the key");
  for (const Cursor& entry : root["contact"]["fractures"].entries())
    if (const Cursor single = entry["fracture_pressure"]; single && !single.expression().is_zero())
      refuse(single, "the pressure in the fracture is computed, as there is flow.fractures", "Remove the key");
}

bool stores_fluid(const Cursor& root) {
  const bool in_fractures = root["flow"]["fractures"] && root["fluid"]["compressibility"].number() > 0;
  return in_fractures || std::ranges::any_of(root["materials"].entries(), [](const Cursor& rule) {
           const Cursor modulus = rule["biot_modulus"], storage = rule["storage"];
           return (modulus && !modulus.is_infinite()) || (storage && !storage.expression().is_zero());
         });
}

/// Without a given pressure, storage or a rock that yields, pressures are known only up to a constant.
void check_determined(const Cursor& root) {
  const Cursor flow = root["flow"];
  const std::vector<Cursor> boundary = flow["boundary"].entries();
  if (std::ranges::any_of(boundary, [](const Cursor& rule) { return bool(rule["pressure"]); })) return;
  if (flow["stationary"].is_true() || (!root["mechanics"] && !stores_fluid(root)))
    refuse(flow["boundary"], "the pressure is given on no side and nothing stores fluid: it is known up to a constant only",
           flow["stationary"].is_true() ? "Give the pressure on a side"
                                        : "Give the pressure on a side, or materials[].biot_modulus or storage");
}

}  // namespace

void check_flow(const Cursor& root) {
  const Cursor flow = root["flow"];
  if (!flow) return check_no_flow(root);
  if (flow["stationary"].is_true() && root["mechanics"])
    refuse(flow["stationary"], "flow beside mechanics is not stationary",
           "Write false and let the run come to rest, or compute flow alone");
  check_materials(root);
  for (const Cursor& rule : flow["boundary"].entries()) check_boundary_rule(rule);
  check_fractures(root);
  for (const Cursor& source : flow["sources"].entries()) check_source(source, flow);
  const std::vector<Cursor> wells = flow["wells"].entries();
  check_unique(wells, "name");
  for (const Cursor& well : wells) refuse_without_fluid_in_fractures(well["fracture"], flow);
  check_determined(root);
}

namespace {

void check_source_names(const physics::FlowSource& source, const MeshNames& mesh, const std::vector<std::string>& fractures) {
  using Kind = physics::FlowSource::Kind;
  if (source.kind == Kind::well) {
    check_inside("well", source.at, mesh, source.place);
    if (!source.on_fracture.empty()) check_fracture(source.on_fracture, fractures, source.place);
  } else if (!source.name.empty()) {
    if (source.kind == Kind::matrix)
      check_known("region", source.name, mesh.regions, source.place);
    else
      check_fracture(source.name, fractures, source.place);
  }
}

void check_fracture_rules(const Scene& scene, const std::vector<std::string>& fractures) {
  const auto& rules = scene.flow->fractures;
  if (rules.empty()) return;
  if (fractures.empty())
    throw InputError("there is a section flow.fractures but the mesh has no fracture", rules.front().place,
                     "Remove the section, or give fractures");
  for (const auto& rule : rules)
    if (!rule.fracture.empty()) check_fracture(rule.fracture, fractures, rule.place);
  for (const std::string& name : fractures)
    if (std::ranges::none_of(rules, [&](const auto& rule) { return rule.fracture.empty() || rule.fracture == name; }))
      throw InputError(fmt::format("the fracture \"{}\" has no aperture", name), rules.front().place,
                       "Give flow.fractures.contact_aperture for all fractures, or an entry for each");
}

}  // namespace

void check_flow_names(const Scene& scene, const MeshNames& mesh) {
  const std::vector<std::string> fractures = fracture_names(scene, mesh);
  for (const auto& rule : scene.flow->boundary)
    if (rule.tag != "all") check_known("side or group", rule.tag, mesh.tags, rule.place);
  for (const auto& rule : scene.flow->materials)
    if (!rule.region.empty()) check_known("region", rule.region, mesh.regions, rule.place);
  check_fracture_rules(scene, fractures);
  for (const auto& source : scene.flow->sources) check_source_names(source, mesh, fractures);
}

namespace {

// Reading

void read_material(const Cursor& entry, std::vector<physics::HydraulicRule>& rules) {
  if (std::ranges::none_of(hydraulic_keys, [&](const char* key) { return bool(entry[key]); })) return;
  physics::HydraulicRule rule{.region = entry["region"].text(),
                              .where = entry["where"].optional_expression(),
                              .permeability = {},
                              .biot = entry["biot"].optional_expression(),
                              .inverse_modulus = entry["storage"].optional_expression(),
                              .place = entry.where()};
  if (entry["permeability"]) rule.permeability = entry["permeability"].tensor();
  if (const Cursor modulus = entry["biot_modulus"])
    rule.inverse_modulus = modulus.is_infinite() ? Expression() : modulus.expression_within("1/(", ")");
  rules.push_back(std::move(rule));
}

/// One rule a tag.
void read_boundary_rule(const Cursor& entry, std::vector<physics::FlowBoundaryRule>& rules) {
  for (const Cursor& on : entry["on"].entries())
    rules.push_back({.tag = on.text(),
                     .name = entry["name"].text(),
                     .where = entry["where"].optional_expression(),
                     .pressure = entry["pressure"].optional_expression(),
                     .flux = entry["flux"].optional_expression(),
                     .place = on.where()});
}

physics::FlowSource read_source(const Cursor& entry) {
  using Kind = physics::FlowSource::Kind;
  const Cursor fracture = entry["fracture"];
  physics::FlowSource source{.kind = fracture ? Kind::fracture : Kind::matrix,
                             .name = fracture ? fracture.text() : entry["region"].text(),
                             .rate = entry["rate"].expression(),
                             .on_fracture = {},
                             .place = entry.where()};
  if (source.kind == Kind::fracture && source.name == "all") source.name.clear();
  return source;
}

physics::FlowSource read_well(const Cursor& entry) {
  return {.kind = physics::FlowSource::Kind::well,
          .name = entry["name"].text(),
          .rate = entry["rate"].expression(),
          .at = entry["at"].point(),
          .on_fracture = entry["fracture"].text(),
          .place = entry.where()};
}

/// Overwrites what the entry gives.
void read_fracture(const Cursor& entry, physics::FractureFlowRule& rule) {
  rule.place = entry.where();
  if (entry["contact_aperture"]) rule.contact_aperture = entry["contact_aperture"].expression();
  if (entry["permeability"]) rule.permeability = entry["permeability"].expression();
  if (entry["normal_permeability"]) rule.normal_permeability = entry["normal_permeability"].expression();
  if (entry["barrier"]) rule.barrier = entry["barrier"].is_true();
  if (entry["dilation"]) rule.dilation = entry["dilation"].expression();
  if (entry["dilation_angle"]) rule.dilation = entry["dilation_angle"].expression_within("tan(pi/180*(", "))");
}

/// The rule of all fractures, where it is complete, then one for each fracture that differs.
std::vector<physics::FractureFlowRule> read_fractures(const Cursor& fractures) {
  std::vector<physics::FractureFlowRule> rules;
  if (!fractures) return rules;
  physics::FractureFlowRule common;
  read_fracture(fractures, common);
  if (fractures["contact_aperture"]) rules.push_back(common);
  for (const Cursor& entry : fractures["fractures"].entries()) {
    physics::FractureFlowRule rule = common;
    rule.fracture = entry["name"].text();
    read_fracture(entry, rule);
    rules.push_back(std::move(rule));
  }
  return rules;
}

}  // namespace

std::optional<physics::FlowProblem> read_flow(const Cursor& root) {
  const Cursor flow = root["flow"], fluid = root["fluid"];
  if (!flow) return std::nullopt;
  physics::FlowProblem problem;
  problem.viscosity = fluid["viscosity"].number();
  problem.fluid_compressibility = fluid["compressibility"].number();
  problem.stationary = flow["stationary"].is_true();
  problem.conductivities =
      flow["conductivities"].text() == "current" ? physics::ConductivityTime::current : physics::ConductivityTime::previous;
  for (const Cursor& entry : root["materials"].entries()) read_material(entry, problem.materials);
  problem.fractures = read_fractures(flow["fractures"]);
  for (const Cursor& entry : flow["boundary"].entries()) read_boundary_rule(entry, problem.boundary);
  for (const Cursor& entry : flow["sources"].entries()) problem.sources.push_back(read_source(entry));
  for (const Cursor& entry : flow["wells"].entries()) problem.sources.push_back(read_well(entry));
  problem.initial_pressure = flow["initial_pressure"].expression();
  problem.reference_pressure = flow["reference_pressure"].optional_expression();
  return problem;
}

std::optional<physics::ExactFlow> read_exact_flow(const Cursor& exact) {
  if (!exact["pressure"] && !exact["flux"]) return std::nullopt;
  physics::ExactFlow solution;
  solution.pressure = exact["pressure"].optional_expression();
  if (exact["flux"]) solution.flux = exact["flux"].expressions();
  return solution;
}

}  // namespace polyslip::scene
