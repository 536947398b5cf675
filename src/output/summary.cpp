#include "src/output/summary.hpp"

#include "src/base/version.hpp"
#include "src/blade/account.hpp"
#include "src/scenario/law_reader.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace spherecut::app {
namespace {

using OrderedJson = nlohmann::ordered_json;

OrderedJson json(const Vector3& v) {
  return {v.x(), v.y(), v.z()};
}

OrderedJson walls(const OrganWalls& walls) {
  const auto at = [](const std::optional<WidthAt>& width) {
    return width ? OrderedJson{{"width_m", width->width}, {"at_m", json(width->place)}} : OrderedJson(nullptr);
  };
  return {{"median_thickness_m", walls.median},
          {"thinnest_wall", at(walls.thinnest)},
          {"narrowest_gap", at(walls.narrowest)}};
}

OrderedJson inputs(const Session& session) {
  const Scenario& scenario = session.scenario();
  const topology::Domain& domain = *session.organ().domain;
  OrderedJson out;
  out["scenario"] = scenario.file.string();
  out["scenario_text"] = scenario.text;
  out["method"] = solvers::to_string(scenario.method.method);
  out["law"] = name_of(scenario.law);
  out["young_modulus_Pa"] = scenario.material.young_modulus;
  out["poisson_ratio"] = scenario.material.poisson_ratio;
  out["density_kg_m3"] = scenario.material.density;
  if (!scenario.regions.empty())
    out["regions"] = OrderedJson::array();
  for (const RegionSettings& region : scenario.regions)
    out["regions"].push_back({{"name", region.name},
                              {"young_modulus_Pa", region.material.young_modulus},
                              {"poisson_ratio", region.material.poisson_ratio},
                              {"density_kg_m3", region.material.density}});
  out["gravity_m_s2"] = scenario.gravity ? json(*scenario.gravity) : OrderedJson(nullptr);
  out["organ"] = {{"triangles", domain.surface().triangles.size()}, {"volume_m3", topology::volume(domain.surface())},
                  {"area_m2", topology::area(domain.surface())},    {"lower_m", json(domain.bounds().lower)},
                  {"upper_m", json(domain.bounds().upper)},         {"walls", walls(session.walls())}};
  return out;
}

OrderedJson nodes(const Session& session) {
  const solvers::SprinkleReport& report = session.model().sprinkling.report;
  const FineZone& zone = session.zone();
  OrderedJson out = {{"total", session.model().sprinkling.nodes.size()},
                     {"surface", report.surface_nodes},
                     {"edge", report.edge_nodes},
                     {"interior", report.interior_nodes},
                     {"lip", report.lip_nodes},
                     {"fine_spacing_m", zone.spacing.fine},
                     {"coarse_spacing_m", zone.spacing.coarse},
                     {"fine_radius_m", zone.spacing.radius},
                     {"random_seed", session.scenario().nodes.random_seed}};
  out["zones"] = OrderedJson::array();
  for (const solvers::SprinkleZone& z : report.zones)
    out["zones"].push_back({{"spacing_from_m", z.spacing_from},
                            {"spacing_to_m", z.spacing_to},
                            {"nodes", z.nodes},
                            {"nearest_min", z.nearest_min},
                            {"nearest_median", z.nearest_median},
                            {"density", z.density}});
  return out;
}

OrderedJson peak(const StepResult& step) {
  return {{"newtons", step.force.norm()},
          {"vector_N", json(step.force)},
          {"normal_N", json(step.force - step.tangential)},
          {"tangential_N", json(step.tangential)},
          {"time_s", step.time},
          {"contact_m", json(step.contact.point)},
          {"depth_m", step.contact.depth},
          {"contact_radius_m", step.contact_radius},
          {"active_nodes", step.active_nodes}};
}

OrderedJson peak(const RunFindings::PeakTorque& peak) {
  return {{"newton_metres", peak.torque.norm()}, {"vector_Nm", json(peak.torque)}, {"time_s", peak.time}};
}

OrderedJson solver(const Session& session, const RunFindings& findings) {
  OrderedJson out = {{"largest_residual", findings.largest_residual},
                     {"largest_rotation_degrees", findings.largest_rotation_degrees},
                     {"largest_penetration_m", findings.largest_penetration},
                     {"self_penetration_m", findings.self_penetration}};
  if (session.model().body != nullptr) {
    const solvers::AssemblyReport& report = session.model().body->report();
    out["unknowns"] = report.unknowns;
    out["fixed_nodes"] = held_nodes(session.model().body->problem().prescribed);
    out["matrix_nonzeros"] = report.matrix_nonzeros;
    out["factor_nonzeros"] = report.factor_nonzeros;
    out["condition_estimate"] = report.condition_estimate;
    out["worst_moment_condition"] = report.worst_moment_condition;
    out["grown_supports"] = report.grown_supports;
  }
  if (is_nonlinear(session.scenario().law))
    out["finite_strain"] = {
        {"law", name_of(session.scenario().law)},
        {"median_iterations", median(findings.iterations)},
        {"most_iterations",
         findings.iterations.empty() ? 0 : *std::max_element(findings.iterations.begin(), findings.iterations.end())},
        {"least_jacobian", findings.least_jacobian}};
  out["resprinkles"] = OrderedJson::array();
  for (const auto& [time, jump] : findings.resprinkles)
    out["resprinkles"].push_back({{"time_s", time}, {"force_jump", jump}});
  return out;
}

OrderedJson piece_checks(const RunFindings& findings) {
  OrderedJson out = OrderedJson::array();
  for (const RunFindings::PieceCheck& check : findings.piece_checks)
    out.push_back(
        {{"time_s", check.time},
         {"pieces", check.pieces},
         {"components_agree", check.components_agree},
         {"voxel_size_m", check.voxel_size},
         {"voxel_volumes_m3", check.voxel_volumes},
         {"hausdorff_m", std::isfinite(check.hausdorff) ? OrderedJson(check.hausdorff) : OrderedJson(nullptr)}});
  return out;
}

OrderedJson cut(const Session& session, const RunFindings& findings) {
  const CutReport& last = findings.cut;
  OrderedJson out{{"increments", findings.increments},
                  {"refused", findings.refused_cuts},
                  {"area_m2", last.area},
                  {"front_m", last.front_length},
                  {"sheets", last.sheets},
                  {"pieces", last.pieces},
                  {"unheld_pieces", last.unheld},
                  {"volumes_m3", last.volumes},
                  {"piece_checks", piece_checks(findings)},
                  {"opening_m", last.opening},
                  {"largest_opening_m", findings.largest_opening},
                  {"opening_volume_m3", last.opening_volume},
                  {"lip_pairs", last.lip_pairs},
                  {"closed_pairs", last.closed_pairs},
                  {"lips", solvers::to_string(session.scenario().cut.lips)},
                  {"surface_hash", hash_text(last.surface_hash)}};
  if (session.blade() != nullptr) {
    for (const AccountEntry& entry : account_of(last.blade.ledger))
      out["blade"][entry.key] = entry.joules;
    out["blade"]["peak_torque"] = peak(findings.peak_blade_torque);
  }
  return out;
}

OrderedJson tear(const RunFindings& findings) {
  const EnergyLedger& ledger = findings.tear.ledger;
  const std::optional<double> open = ledger.open_share();
  OrderedJson systems = OrderedJson::object();
  for (const SystemUpdate update : {SystemUpdate::updated, SystemUpdate::rebuilt}) {
    const auto known = findings.tear_updates.find(update);
    systems[std::string(to_string(update))] = known == findings.tear_updates.end() ? 0 : known->second;
  }
  return {{"increments", findings.tear_increments},
          {"systems", systems},
          {"seeds", findings.seeds},
          {"area_m2", findings.tear.area},
          {"unstable", findings.torn_unstably},
          {"severed", findings.severed_by_tear},
          {"tool_J", ledger.tool},
          {"loads_J", ledger.loads},
          {"elastic_J", ledger.elastic},
          {"surface_J", ledger.surface},
          {"dissipation_J", ledger.dissipation},
          {"imbalance_J", ledger.imbalance()},
          {"energy_balance", open ? OrderedJson(*open) : OrderedJson(nullptr)},
          {"last_reason", findings.tear.reason}};
}

OrderedJson timings(const SessionProfile& profile) {
  return {{"organ", profile.organ},       {"topology", profile.topology},     {"level_sets", profile.level_sets},
          {"sprinkle", profile.sprinkle}, {"discretise", profile.discretise}, {"condense", profile.condense},
          {"press", profile.press},       {"evaluate", profile.evaluate},     {"intensities", profile.intensities}};
}

} // namespace

std::string summary_json(const Session& session, const RunOutput& output, RunStatus status,
                         const std::string& message) {
  const RunFindings& findings = output.findings();
  OrderedJson summary;
  summary["spherecut"] = version();
  summary["title"] = session.scenario().title;
  summary["status"] = status == RunStatus::complete      ? "complete"
                      : status == RunStatus::interrupted ? "interrupted"
                                                         : "failed";
  summary["interrupted"] = status == RunStatus::interrupted;
  if (!message.empty())
    summary["message"] = message;
  summary["touched"] = findings.touched;
  summary["steps"] = {{"done", findings.steps}, {"planned", findings.planned}};
  summary["peak_force"] = findings.touched ? peak(findings.peak) : OrderedJson(nullptr);
  summary["peak_torque"] = findings.touched ? peak(findings.peak_torque) : OrderedJson(nullptr);
  summary["cut"] = has_cuts(session.scenario()) ? cut(session, findings) : OrderedJson(nullptr);
  summary["tear"] = session.scenario().tearing.enabled ? tear(findings) : OrderedJson(nullptr);
  summary["nodes"] = nodes(session);
  summary["solver"] = solver(session, findings);
  summary["timings_s"] = timings(session.profile());
  std::vector<std::string> warnings = session.warnings();
  warnings.insert(warnings.end(), output.remarks().begin(), output.remarks().end());
  summary["warnings"] = warnings;
  summary["files"] = output.files();
  summary["inputs"] = inputs(session);
  return summary.dump(2, ' ', false, OrderedJson::error_handler_t::replace) + "\n";
}

} // namespace spherecut::app
