// Problem:   scenarios/liver_flap.toml: a flap cut from the dome of a neo-Hookean liver is lifted by a grasper, folded
//            back, and tears on.
// Reference: none but the account of energies (the worst of five node sets); G is at most the toughness where the tear
//            has come to rest.
// Command:   spherecut experiment run flap --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/statistics.hpp"

#include "flap_scenario.hpp"
#include "src/output/cut_output.hpp"
#include "src/output/tear_output.hpp"

#include <cmath>
#include <fmt/format.h>
#include <fstream>

namespace spherecut::experiments {

namespace {

/// Share of what is spent that the account leaves open at the end.
double open_share(const app::EnergyLedger& ledger) {
  const double spent = ledger.surface + ledger.dissipation;
  return spent > 0 ? std::abs(ledger.imbalance()) / spent : 1;
}

/// The last step on the scenario's nodes; tables and pictures go to the folder.
app::StepResult lift(const app::Scenario& scenario, const ExperimentContext& context) {
  app::Session session(scenario, context.say);
  app::Table table({"time", "pull_N", "area_m2", "torn_m2", "increments", "work_J", "elastic_J", "surface_J",
                    "dissipation_J", "imbalance_J"});
  app::Figure figure{"Lifting a flap: pull", "way of the grasper / mm", "pull / N", false, false, {}};
  app::Series pull{"pull", {}, {}, app::SeriesStyle::lines_and_points};
  std::vector<double> times;
  std::vector<app::TearReport> reports;
  app::StepResult last;
  std::string increments = app::header_line(app::tear_columns());
  for (const app::StepSample& sample : session.steps()) {
    last = session.step(sample);
    const app::EnergyLedger& e = last.tear->ledger;
    table.add({fmt::format("{:.3f}", last.time), fmt::format("{:.5f}", last.force.norm()),
               fmt::format("{:.5g}", last.cut->area), fmt::format("{:.5g}", last.tear->area),
               fmt::format("{}", last.tear->increments.size() - 1), fmt::format("{:.5g}", e.tool + e.loads),
               fmt::format("{:.5g}", e.elastic), fmt::format("{:.5g}", e.surface), fmt::format("{:.5g}", e.dissipation),
               fmt::format("{:.3g}", e.imbalance())});
    pull.x.push_back(1e3 * (sample.tool->point - session.steps().front().tool->point).norm());
    pull.y.push_back(last.force.norm());
    times.push_back(last.time);
    reports.push_back(*last.tear);
    increments += app::tear_lines(*last.tear);
    context.say(fmt::format("t = {:.2f} s: {:.3g} N, {:.3g} cm2 torn in {} increments: {}", last.time,
                            last.force.norm(), 1e4 * last.tear->area, last.tear->increments.size() - 1,
                            last.tear->reason));
  }
  figure.series = {pull};
  table.write(context.out / "flap.csv");
  std::ofstream(context.out / "tears.csv") << increments;
  app::write_png(figure, context.out / "pull.png");
  for (const auto& [name, drawn] : app::tear_figures(times, reports))
    app::write_png(drawn, context.out / name);
  app::write_wound(context.out / "flap.vtp", session);
  app::write_incision(context.out / "incision.vtp", *session.model().incision);
  return last;
}

} // namespace

std::vector<Check> run_flap(const ExperimentContext& context) {
  app::Scenario scenario = app::read_scenario_text("liver_flap.toml", liver_flap);
  if (context.quick) {
    std::get<app::LiverOrgan>(scenario.organ.shape).triangles = 5000;
    scenario.nodes.fine_spacing = 0.007;
    scenario.nodes.coarse_spacing = 0.03;
    scenario.tool->step = 0.5;
    scenario.tearing.step = 1;
    scenario.tearing.most_increments = 4;
  }
  const app::StepResult last = lift(scenario, context);
  std::vector<double> open{open_share(last.tear->ledger)}, turned{last.rotation_degrees};
  for (int seed = 2; seed <= 5 && !context.quick; ++seed) { // what the account leaves open scatters with the nodes
    scenario.nodes.random_seed = static_cast<std::uint64_t>(seed);
    app::Session session(scenario, context.say);
    app::StepResult end;
    for (const app::StepSample& sample : session.steps())
      end = session.step(sample);
    open.push_back(open_share(end.tear->ledger));
    turned.push_back(end.rotation_degrees);
    context.say(fmt::format("node set {}: {:.3g} cm2 torn, the account is open by {:.1f} %, tissue turned by up to "
                            "{:.0f} degrees",
                            seed, 1e4 * end.tear->area, 100 * open.back(), turned.back()));
  }
  const app::EnergyLedger& ledger = last.tear->ledger;
  std::vector<Check> checks{
      {"flap_torn_cm2", 1e4 * last.tear->area, ">=", context.quick ? 0.5 : 2.0},
      {context.quick ? "flap_energy_balance_reported" : "flap_energy_balance", largest(open),
       context.quick ? ">=" : "<=", context.quick ? 0.0 : 0.05},
      {"flap_turned_degrees", median(turned), ">=", context.quick ? 45.0 : 85.0},
      {"flap_dissipation_share", ledger.dissipation / (ledger.surface + ledger.dissipation), ">=", 0},
      {"flap_pieces", static_cast<double>(last.cut->pieces), "<=", 1}};
  return checks;
}

} // namespace spherecut::experiments
