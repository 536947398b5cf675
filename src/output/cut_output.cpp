#include "src/output/cut_output.hpp"

#include "src/output/vtp.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

std::vector<double> doubles(std::size_t count, const std::function<double(std::size_t)>& value) {
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i)
    values[i] = value(i);
  return values;
}

} // namespace

std::string hash_text(std::uint64_t hash) {
  return fmt::format("{:016x}", hash);
}

std::span<const Column<CutRow>> cut_columns() {
  static constexpr Column<CutRow> columns[] = {
      {"time_s", "{:.9g}", [](const CutRow& r) -> Cell { return r.time; }},
      {"triangles", "", [](const CutRow& r) -> Cell { return count(r.report.triangles); }},
      {"refused", "", [](const CutRow& r) -> Cell { return r.report.refused; }},
      {"sheets", "", [](const CutRow& r) -> Cell { return count(r.report.sheets); }},
      {"area_m2", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.area; }},
      {"front_m", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.front_length; }},
      {"pieces", "", [](const CutRow& r) -> Cell { return count(r.report.pieces); }},
      {"unheld", "", [](const CutRow& r) -> Cell { return count(r.report.unheld); }},
      {"volumes_m3", "{:.12g}", [](const CutRow& r) -> Cell { return r.report.volumes; }},
      {"opening_m", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.opening; }},
      {"opening_volume_m3", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.opening_volume; }},
      {"lip_pairs", "", [](const CutRow& r) -> Cell { return count(r.report.lip_pairs); }},
      {"closed_pairs", "", [](const CutRow& r) -> Cell { return count(r.report.closed_pairs); }},
      {"lips_converged", "", [](const CutRow& r) -> Cell { return r.report.lips_converged; }},
      {"nodes", "", [](const CutRow& r) -> Cell { return count(r.report.nodes); }},
      {"kept_nodes", "", [](const CutRow& r) -> Cell { return count(r.report.kept_nodes); }},
      {"surface_hash", "", [](const CutRow& r) -> Cell { return hash_text(r.report.surface_hash); }},
      {"topology_s", "{:.4g}", [](const CutRow& r) -> Cell { return r.report.seconds.topology; }},
      {"level_sets_s", "{:.4g}", [](const CutRow& r) -> Cell { return r.report.seconds.level_sets; }},
      {"visibility_s", "{:.4g}", [](const CutRow& r) -> Cell { return r.report.seconds.visibility; }},
      {"sprinkling_s", "{:.4g}", [](const CutRow& r) -> Cell { return r.report.seconds.sprinkling; }},
      {"assembly_s", "{:.4g}", [](const CutRow& r) -> Cell { return r.report.seconds.assembly; }},
      {"solve_s", "{:.4g}", [](const CutRow& r) -> Cell { return r.report.seconds.solve; }},
      {"update", "", [](const CutRow& r) -> Cell { return std::string(to_string(r.report.update)); }},
      {"update_reason", "quoted", [](const CutRow& r) -> Cell { return r.report.update_reason; }},
      {"blade_force_*_N", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.blade.force; }},
      {"edge_force_N", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.blade.edge_force; }},
      {"advance_m", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.blade.advance; }},
      {"release_J_m2", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.blade.release; }},
      {"work_J", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.blade.ledger.work; }},
      {"surface_J", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.blade.ledger.surface; }},
      {"crushing_J", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.blade.ledger.crushing; }},
      {"friction_J", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.blade.ledger.friction; }},
      {"excess_J", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.blade.ledger.excess; }},
      {"stored_J", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.blade.ledger.stored; }},
      {"reason", "quoted", [](const CutRow& r) -> Cell { return r.report.reason; }},
      {"blade_torque_*_Nm", "{:.9g}", [](const CutRow& r) -> Cell { return r.report.blade.torque; }},
  };
  return columns;
}

void write_wound(const std::filesystem::path& file, const Session& session) {
  const topology::Wound& wound = *session.wound();
  PolyData data;
  data.triangles = wound.surface.triangles;
  std::vector<Vector3> displacement;
  std::vector<double> stress;
  for (std::size_t v = 0; v < wound.surface.vertices.size(); ++v) {
    const solvers::PointState state = session.model().at(wound.evaluation[v]);
    displacement.push_back(state.displacement);
    stress.push_back(von_mises(state.stress));
    data.points.emplace_back(wound.surface.vertices[v] + state.displacement);
  }
  data.point_data = {vector_data("displacement [m]", displacement),
                     scalar_data("von Mises stress [Pa]", std::move(stress))};
  const std::size_t count = wound.surface.triangles.size();
  data.cell_data = {
      scalar_data("part", doubles(count, [&](std::size_t t) { return static_cast<double>(wound.part[t]); })),
      scalar_data("piece", doubles(count, [&](std::size_t t) { return wound.piece_of(static_cast<int>(t)); })),
      scalar_data("sheet", doubles(count, [&](std::size_t t) { return wound.sheet[t]; }))};
  write_vtp(file, data);
}

void write_incision(const std::filesystem::path& file, const topology::Incision& incision) {
  PolyData data;
  std::vector<double> sheets;
  for (const topology::FrontSegment& segment : incision.front()) {
    const int first = static_cast<int>(data.points.size());
    data.points.insert(data.points.end(), {segment.from, segment.to});
    data.lines.push_back({first, first + 1});
    sheets.push_back(segment.sheet);
  }
  for (std::size_t s = 0; s < incision.sheets().size(); ++s) {
    const int first = static_cast<int>(data.points.size());
    const topology::SurfaceMesh& sheet = incision.sheets()[s];
    data.points.insert(data.points.end(), sheet.vertices.begin(), sheet.vertices.end());
    for (const Triangle& t : sheet.triangles) {
      data.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
      sheets.push_back(static_cast<double>(s));
    }
  }
  data.cell_data = {scalar_data("sheet", std::move(sheets))};
  write_vtp(file, data);
}

std::vector<std::pair<std::string, Figure>> cut_figures(const std::vector<double>& times,
                                                        const std::vector<CutReport>& reports) {
  const auto over_time = [&](const std::string& label, const std::function<double(std::size_t)>& value) {
    return Series{label, times, doubles(times.size(), value), SeriesStyle::lines_and_points};
  };
  Figure opening;
  opening.title = "Opening of the cut";
  opening.x_label = "time [s]";
  opening.y_label = "largest opening [mm]";
  opening.series = {over_time("largest opening", [&](std::size_t i) { return 1e3 * reports[i].opening; })};
  Figure area;
  area.title = "Size of the cut";
  area.x_label = "time [s]";
  area.y_label = "area [cm2], length [cm]";
  area.series = {over_time("area of the cut [cm2]", [&](std::size_t i) { return 1e4 * reports[i].area; }),
                 over_time("length of its front [cm]", [&](std::size_t i) { return 1e2 * reports[i].front_length; })};
  std::vector<std::pair<std::string, Figure>> figures{{"opening.png", opening}, {"cut.png", area}};
  if (std::any_of(reports.begin(), reports.end(),
                  [](const CutReport& report) { return report.blade.edge_force > 0; })) {
    Figure force;
    force.title = "Force on the blade";
    force.x_label = "time [s]";
    force.y_label = "force [N]";
    force.series = {over_time("force on the blade [N]", [&](std::size_t i) { return reports[i].blade.force.norm(); })};
    figures.emplace_back("blade_force.png", force);
  }
  return figures;
}

double von_mises(const Matrix3& stress) {
  const Matrix3 deviator = stress - stress.trace() / 3 * Matrix3::Identity();
  return std::sqrt(1.5) * deviator.norm();
}

} // namespace spherecut::app
