#include "src/tear_output.hpp"

#include <fmt/format.h>

namespace spherecut::app {

std::string_view tear_columns() {
  return "time_s,increment,front_x_m,front_y_m,front_z_m,most_x_m,most_y_m,most_z_m,K_I_Pa_m05,K_II_Pa_m05,K_III_Pa_"
         "m05,G_J_m2,toughness_J_m2,advance_m,triangles,area_m2,front_m,tool_J,loads_J,elastic_J,surface_J,dissipation_"
         "J,imbalance_J,force_N,nodes,kept_nodes,intensities_s,topology_s,level_sets_s,visibility_s,sprinkling_s,"
         "assembly_s,solve_s,update,update_reason,unstable,severed,reason\n";
}

std::string tear_rows(const TearReport& report) {
  std::string rows;
  for (std::size_t k = 0; k < report.increments.size(); ++k) {
    const TearIncrement& r = report.increments[k];
    const bool last = k + 1 == report.increments.size();
    const auto quoted = [](std::string text) {
      for (char& c : text)
        if (c == '"' || c == '\n')
          c = ' ';
      return '"' + text + '"';
    };
    const BodyUpdate& body = r.body;
    const RebuildSeconds& seconds = body.seconds;
    const auto vector = [](const Vector3& v) { return fmt::format("{:.9g},{:.9g},{:.9g}", v.x(), v.y(), v.z()); };
    const EnergyLedger& e = r.ledger;
    rows +=
        fmt::format("{:.9g},{},{},{},{},{:.9g},{:.9g},{:.9g},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},"
                    "{:.3g},{:.9g},{},{},{:.4g},{:.4g},{:.4g},{:.4g},{:.4g},{:.4g},{:.4g},{},{},{},{},{}\n",
                    r.time, r.number, vector(r.front), vector(r.most), vector(r.intensities), r.release, r.toughness,
                    r.advance, r.triangles, r.area, r.front_length, e.tool, e.loads, e.elastic, e.surface,
                    e.dissipation, e.imbalance(), r.force, body.nodes, body.kept_nodes, r.intensity_seconds,
                    seconds.topology, seconds.level_sets, seconds.visibility, seconds.sprinkling, seconds.assembly,
                    seconds.solve, to_string(body.update), quoted(body.update_reason), last && report.unstable ? 1 : 0,
                    last && report.severed ? 1 : 0, quoted(last ? report.reason : ""));
  }
  return rows;
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
