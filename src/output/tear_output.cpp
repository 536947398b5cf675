#include "src/output/tear_output.hpp"

#include <fmt/format.h>

namespace spherecut::app {

std::span<const Column<TearRow>> tear_columns() {
  static constexpr Column<TearRow> columns[] = {
      {"time_s", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.time; }},
      {"increment", "", [](const TearRow& r) -> Cell { return count(r.increment.number); }},
      {"front_*_m", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.front; }},
      {"most_*_m", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.most; }},
      {"K_I_Pa_m05", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.intensities[0]; }},
      {"K_II_Pa_m05", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.intensities[1]; }},
      {"K_III_Pa_m05", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.intensities[2]; }},
      {"G_J_m2", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.release; }},
      {"toughness_J_m2", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.toughness; }},
      {"advance_m", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.advance; }},
      {"triangles", "", [](const TearRow& r) -> Cell { return count(r.increment.triangles); }},
      {"area_m2", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.area; }},
      {"front_m", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.front_length; }},
      {"tool_J", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.ledger.tool; }},
      {"loads_J", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.ledger.loads; }},
      {"elastic_J", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.ledger.elastic; }},
      {"surface_J", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.ledger.surface; }},
      {"dissipation_J", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.ledger.dissipation; }},
      {"imbalance_J", "{:.3g}", [](const TearRow& r) -> Cell { return r.increment.ledger.imbalance(); }},
      {"force_N", "{:.9g}", [](const TearRow& r) -> Cell { return r.increment.force; }},
      {"nodes", "", [](const TearRow& r) -> Cell { return count(r.increment.body.nodes); }},
      {"kept_nodes", "", [](const TearRow& r) -> Cell { return count(r.increment.body.kept_nodes); }},
      {"intensities_s", "{:.4g}", [](const TearRow& r) -> Cell { return r.increment.intensity_seconds; }},
      {"topology_s", "{:.4g}", [](const TearRow& r) -> Cell { return r.increment.body.seconds.topology; }},
      {"level_sets_s", "{:.4g}", [](const TearRow& r) -> Cell { return r.increment.body.seconds.level_sets; }},
      {"visibility_s", "{:.4g}", [](const TearRow& r) -> Cell { return r.increment.body.seconds.visibility; }},
      {"sprinkling_s", "{:.4g}", [](const TearRow& r) -> Cell { return r.increment.body.seconds.sprinkling; }},
      {"assembly_s", "{:.4g}", [](const TearRow& r) -> Cell { return r.increment.body.seconds.assembly; }},
      {"solve_s", "{:.4g}", [](const TearRow& r) -> Cell { return r.increment.body.seconds.solve; }},
      {"update", "", [](const TearRow& r) -> Cell { return std::string(to_string(r.increment.body.update)); }},
      {"update_reason", "quoted", [](const TearRow& r) -> Cell { return r.increment.body.update_reason; }},
      {"unstable", "", [](const TearRow& r) -> Cell { return r.last && r.report.unstable; }},
      {"severed", "", [](const TearRow& r) -> Cell { return r.last && r.report.severed; }},
      {"reason", "quoted", [](const TearRow& r) -> Cell { return r.last ? r.report.reason : std::string(); }},
  };
  return columns;
}

std::vector<TearRow> tear_rows(const TearReport& report) {
  std::vector<TearRow> rows;
  for (const TearIncrement& increment : report.increments)
    rows.push_back({report, increment, &increment == &report.increments.back()});
  return rows;
}

std::string tear_lines(const TearReport& report) {
  std::string lines;
  for (const TearRow& row : tear_rows(report))
    lines += csv_line(tear_columns(), row);
  return lines;
}

std::vector<std::pair<std::string, Figure>> tear_figures(const std::vector<double>& times,
                                                         const std::vector<TearReport>& reports) {
  const auto over_time = [&](const std::string& label, const std::function<double(const TearReport&)>& value) {
    Series series{label, times, {}, SeriesStyle::lines_and_points};
    for (const TearReport& report : reports)
      series.y.push_back(value(report));
    return series;
  };
  Figure energy;
  energy.title = "Where the work has gone";
  energy.x_label = "time [s]";
  energy.y_label = "energy [mJ]";
  energy.series = {
      over_time("work of tool and loads", [](const TearReport& r) { return 1e3 * (r.ledger.tool + r.ledger.loads); }),
      over_time("elastic", [](const TearReport& r) { return 1e3 * r.ledger.elastic; }),
      over_time("new surface", [](const TearReport& r) { return 1e3 * r.ledger.surface; }),
      over_time("dissipated", [](const TearReport& r) { return 1e3 * r.ledger.dissipation; })};
  Figure torn;
  torn.title = "Torn area";
  torn.x_label = "time [s]";
  torn.y_label = "torn [cm2]";
  torn.series = {over_time("torn area", [](const TearReport& r) { return 1e4 * r.area; })};
  return {{"energy.png", energy}, {"torn.png", torn}};
}

} // namespace spherecut::app
