#include "src/run/run.hpp"

#include "src/base/interrupt.hpp"
#include "src/base/output_file.hpp"
#include "src/base/printable.hpp"
#include "src/base/progress.hpp"
#include "src/blade/account.hpp"
#include "src/model/finite_model.hpp"
#include "src/output/run_output.hpp"
#include "src/run/estimate.hpp"
#include "src/scenario/law_reader.hpp"
#include "src/scenario/region_reader.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr double closed_opening = 1e-9; // m, as finely as the contact of the lips is solved
constexpr double farthest = 10;         // of the organ's largest extent; beyond it no motion is one of tissue

std::string short_text(const Session& session) {
  const topology::Domain& domain = *session.organ().domain;
  const Vector3 extent = 1e3 * domain.bounds().extent();
  return fmt::format("organ: {} triangles, {:.0f} x {:.0f} x {:.0f} mm, {:.4g} litres",
                     domain.surface().triangles.size(), extent.x(), extent.y(), extent.z(),
                     1e3 * topology::volume(domain.surface()));
}

std::string findings_text(const Session& session, const RunOutput& output, const std::filesystem::path& out) {
  const RunFindings& found = output.findings();
  std::string text;
  if (found.touched) {
    const StepResult& peak = found.peak;
    text += fmt::format("peak force {:.4g} N at t = {:.3g} s, tool {:.3g} mm below the surface at rest\n",
                        peak.force.norm(), peak.time, 1e3 * peak.contact.depth);
    if (const double along = peak.tangential.norm(); along > 0)
      text += fmt::format("  {:.4g} N of it press, {:.4g} N act along the surface\n",
                          (peak.force - peak.tangential).norm(), along);
    text += fmt::format("  on the tool [{:.4g}, {:.4g}, {:.4g}] N; contact radius {:.3g} mm, {} nodes in contact\n",
                        peak.force.x(), peak.force.y(), peak.force.z(), 1e3 * peak.contact_radius, peak.active_nodes);
    if (const auto& turning = found.peak_torque; turning.torque.norm() > 0)
      text += fmt::format("  largest torque about its point {:.4g} mN m at t = {:.3g} s\n", 1e3 * turning.torque.norm(),
                          turning.time);
    text += session.model().body == nullptr
                ? fmt::format("  {} nodes, law {}, {} iterations a step, largest residual {:.1e}\n", peak.nodes,
                              name_of(session.scenario().law), median(found.iterations), found.largest_residual)
                : fmt::format("  {} nodes, {}, condition estimate {:.1e}, largest residual {:.1e}\n", peak.nodes,
                              solvers::to_string(session.scenario().method.method),
                              session.model().body->report().condition_estimate, found.largest_residual);
  } else if (session.scenario().tool) {
    text += fmt::format("no contact: the force is zero in all {} steps\n", found.steps);
  }
  if (!session.scenario().tool && !has_cuts(session.scenario())) {
    double largest = 0;
    Vector3 place = Vector3::Zero();
    for (std::size_t i = 0; i < session.node_states().size(); ++i)
      if (const double motion = session.node_states()[i].displacement.norm(); motion > largest) {
        largest = motion;
        place = session.model().sprinkling.nodes.positions[i];
      }
    text += fmt::format("under its loads it moves by up to {:.4g} mm, at [{:.4g}, {:.4g}, {:.4g}] m\n", 1e3 * largest,
                        place.x(), place.y(), place.z());
    text += fmt::format("  {} nodes, {}, largest residual {:.1e}\n", session.model().sprinkling.nodes.size(),
                        solvers::to_string(session.scenario().method.method), found.largest_residual);
  }
  if (has_cuts(session.scenario())) {
    const CutReport& cut = found.cut;
    if (session.scenario().blade && found.increments == 0)
      text += fmt::format("the blade has cut nothing in all {} steps\n", found.steps);
    const std::string increments =
        session.scenario().blade ? fmt::format(" in {} increment{}", found.increments, found.increments == 1 ? "" : "s")
                                 : "";
    text += fmt::format(
        "cut of {:.4g} cm2 with a front of {:.3g} cm{}; {}\n", 1e4 * cut.area, 1e2 * cut.front_length, increments,
        found.largest_opening <= closed_opening ? "it stays closed"
                                                : fmt::format("opens by up to {:.3g} mm, {:.3g} ml between its faces",
                                                              1e3 * found.largest_opening, 1e6 * cut.opening_volume));
    text += fmt::format("  {} piece{}:", cut.pieces, cut.pieces == 1 ? "" : "s");
    for (const double volume : cut.volumes)
      text += fmt::format(" {:.4g} ml", 1e6 * volume);
    text += fmt::format("; {} pairs of lip nodes, {} closed; {} nodes\n", cut.lip_pairs, cut.closed_pairs, cut.nodes);
    if (session.blade() != nullptr)
      text +=
          fmt::format("  blade, at {:.4g} J/m2: {}\n", session.scenario().toughness, account_text(cut.blade.ledger));
    if (found.refused_cuts > 0)
      text += fmt::format("  {} increments refused, see cuts.csv\n", found.refused_cuts);
  }
  if (is_nonlinear(session.scenario().law))
    text += fmt::format("  least volume ratio {:.3g} (1 at rest; sound from {:g} on)\n", found.least_jacobian,
                        least_sound_jacobian);
  if (session.scenario().tearing.enabled) {
    const EnergyLedger& ledger = found.tear.ledger;
    text += fmt::format("torn {:.4g} cm2 in {} increments{}{}; work {:.3g} mJ: elastic {:.3g}, new surface {:.3g}, "
                        "dissipated {:.3g}, left open {:.2g}\n",
                        1e4 * found.tear.area, found.tear_increments, found.torn_unstably ? ", unstable" : "",
                        found.severed_by_tear ? ", parted the organ" : "", 1e3 * (ledger.tool + ledger.loads),
                        1e3 * ledger.elastic, 1e3 * ledger.surface, 1e3 * ledger.dissipation, 1e3 * ledger.imbalance());
  }
  for (const std::string& remark : output.remarks())
    text += fmt::format("warning: {}\n", remark);
  text += fmt::format("results in {}:", out.string());
  for (const std::string& file : output.files())
    text += " " + file;
  return text;
}

std::string step_text(const StepResult& step) {
  std::string text = fmt::format("t = {:.3g} s", step.time);
  if (step.candidates > 0 || !step.cut)
    text += fmt::format(", force {:.4g} N", step.force.norm());
  if (step.cut)
    text += fmt::format(", cut {:.3g} cm2, {}", 1e4 * step.cut->area,
                        step.cut->opening <= closed_opening ? "closed"
                                                            : fmt::format("open {:.2g} mm", 1e3 * step.cut->opening));
  if (step.cut && step.cut->blade.edge_force > 0)
    text += fmt::format(", blade {:.2g} N", step.cut->blade.force.norm());
  return text;
}

// A folder made for a run that never began is not left behind.
class FolderClaim {
 public:
  explicit FolderClaim(const std::filesystem::path& folder)
      : folder_(folder), existed_(std::filesystem::exists(folder)), claim_(claim_results_folder(folder)) {}
  ~FolderClaim() {
    claim_ = {};
    std::error_code ignored;
    if (!existed_ && !begun_)
      std::filesystem::remove(folder_, ignored); // refuses a folder that is not empty
  }
  FolderClaim(const FolderClaim&) = delete;
  FolderClaim& operator=(const FolderClaim&) = delete;
  void begin() { begun_ = true; }
  void give_up() { begun_ = false; }

 private:
  std::filesystem::path folder_;
  bool existed_;
  ResultsClaim claim_;
  bool begun_ = false;
};

} // namespace

void require_tissue(const Session& session, const StepResult& step) {
  const double limit = farthest * session.organ().domain->bounds().extent().maxCoeff();
  const auto refuse = [&](const std::string& what) {
    throw NumericalError(fmt::format("t = {:g} s: {}; allowed: up to {:.3g} m, {:g} times the organ's largest extent. "
                                     "Nodes too coarse for the cut do "
                                     "that (finer: nodes.fine_spacing, cut.front_spacing, nodes.count), or loads too "
                                     "large for linear elasticity. The "
                                     "rows up to then are kept",
                                     step.time, what, limit, farthest));
  };
  const std::vector<Vector3>& positions = session.model().sprinkling.nodes.positions;
  const std::vector<solvers::PointState>& states = session.node_states();
  for (std::size_t i = 0; i < states.size(); ++i)
    if (const double motion = states[i].displacement.norm(); !(motion <= limit))
      refuse(fmt::format("the node at [{:.4g}, {:.4g}, {:.4g}] m has moved by {:.3g} m", positions[i].x(),
                         positions[i].y(), positions[i].z(), motion));
  if (!step.cut)
    return;
  if (!(step.cut->opening <= limit))
    refuse(fmt::format("the faces of the cut are {:.3g} m apart", step.cut->opening));
  if (!std::isfinite(step.cut->opening_volume))
    refuse(fmt::format("the cut encloses {:.3g} m3", step.cut->opening_volume));
}

RunEnd run_scenario(const std::filesystem::path& file, const std::filesystem::path& out, std::FILE* screen) {
  const InterruptWatch watch(
      printable(fmt::format("interrupted; {} has the steps that were finished, without summary.json", out.string())),
      status_of_interrupted);
  Progress progress(screen);
  const auto say = [&](const std::string& line) { progress.say(line); };
  Scenario scenario = read_scenario(file);
  require_run(scenario);
  FolderClaim claim(out);
  Session session(std::move(scenario), say);
  say(short_text(session));
  claim.begin();
  RunOutput output(out, session);
  RunEnd end = RunEnd::complete;
  try {
    try {
      for (const StepSample& sample : session.steps()) {
        interruption_point();
        const StepResult result = session.step(sample);
        require_tissue(session, result);
        output.add(session, result);
        progress.step(output.findings().steps, session.steps().size(), step_text(result));
      }
      if (output.findings().steps > 0)
        output.check_pieces(session, session.steps()[output.findings().steps - 1].time);
    } catch (const Interrupted&) { // the step at hand is given up, what the ones before it gave is kept
      end = RunEnd::interrupted;
    }
    const WindingUp winding_up(end == RunEnd::interrupted);
    watch.wind_up();
    output.draw_figures(session);
    output.write_summary(session, end == RunEnd::complete ? RunStatus::complete : RunStatus::interrupted, "");
  } catch (const std::exception& error) {
    const bool is_output = dynamic_cast<const OutputError*>(&error) != nullptr;
    if (output.findings().steps == 0 && !is_output && dynamic_cast<const InputError*>(&error) != nullptr) {
      output.withdraw(); // what is refused before its first step is done leaves nothing
      claim.give_up();
      throw;
    }
    try {
      output.write_summary(session, RunStatus::failed, error.what());
    } catch (const OutputError&) { // the first error says why nothing can be written
      say("summary.json could not be written either");
    }
    if (is_output)
      throw OutputError(fmt::format("{}\nthe run has ended there; kept in {}: {}. Make room, or write less "
                                    "(output.vtp_every, output.figures), and run again into another folder",
                                    error.what(), out.string(), output.kept()));
    throw;
  }
  say((end == RunEnd::interrupted ? "interrupted; " : "") + findings_text(session, output, out));
  return end;
}

void check_scenario(const std::filesystem::path& file, const std::filesystem::path& mended, std::FILE* screen) {
  const InterruptWatch watch("interrupted: nothing is known about the scenario", status_of_interrupted);
  Progress progress(screen);
  const auto say = [&](const std::string& line) { progress.say(line); };
  Scenario scenario = read_scenario(file);
  if (!mended.empty()) {
    write_organ_surface(scenario.organ, mended);
    say(fmt::format("the organ's surface is in {}", mended.string()));
  }
  const Session session(std::move(scenario), say);
  say(short_text(session));
  say(walls_text(session.walls()));
  say(law_text(session.scenario().law));
  if (!session.scenario().regions.empty())
    say(regions_text(session.scenario().regions));
  require_run(session.scenario()); // after what is known of it all the same
  if (session.computes()) {
    say(fmt::format("nodes: {}; spacing {:.3g} to {:.3g} mm", session.model().sprinkling.nodes.size(),
                    1e3 * session.zone().spacing.fine, 1e3 * session.zone().spacing.coarse));
    say(estimate_text(session));
  }
  say(fmt::format("{}: good, {} step{}", file.string(), session.steps().size(),
                  session.steps().size() == 1 ? "" : "s"));
}

} // namespace spherecut::app
