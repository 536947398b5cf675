#include "src/cut_output.hpp"

#include "src/vtp.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

std::string csv_quoted(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  std::string out = "\"";
  for (const char c : text)
    out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

std::vector<double> doubles(std::size_t count, const std::function<double(std::size_t)>& value) {
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i)
    values[i] = value(i);
  return values;
}

} // namespace

std::string_view cut_columns() {
  return "time_s,triangles,refused,sheets,area_m2,front_m,pieces,unheld,volumes_m3,opening_m,opening_volume_m3,lip_"
         "pairs,"
         "closed_pairs,lips_converged,nodes,kept_nodes,surface_hash,topology_s,level_sets_s,visibility_s,sprinkling_s,"
         "assembly_s,solve_s,update,update_reason,blade_force_x_N,blade_force_y_N,"
         "blade_force_z_N,edge_force_N,advance_m,release_J_m2,work_J,surface_J,crushing_J,friction_J,excess_J,stored_J,"
         "reason,blade_torque_x_Nm,blade_torque_y_Nm,blade_torque_z_Nm\n";
}

std::string hash_text(std::uint64_t hash) {
  return fmt::format("{:016x}", hash);
}

std::string cut_row(double time, const CutReport& r) {
  std::string volumes;
  for (const double volume : r.volumes)
    volumes += fmt::format("{}{:.12g}", volumes.empty() ? "" : ";", volume);
  return fmt::format(
      "{:.9g},{},{},{},{:.9g},{:.9g},{},{},{},{:.9g},{:.9g},{},{},{},{},{},{},{:.4g},{:.4g},{:.4g},{:.4g},{:.4g},"
      "{:.4g},{},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{},{:.9g},{:."
      "9g},{:.9g}\n",
      time, r.triangles, r.refused ? 1 : 0, r.sheets, r.area, r.front_length, r.pieces, r.unheld, volumes, r.opening,
      r.opening_volume, r.lip_pairs, r.closed_pairs, r.lips_converged ? 1 : 0, r.nodes, r.kept_nodes,
      hash_text(r.surface_hash), r.seconds.topology, r.seconds.level_sets, r.seconds.visibility, r.seconds.sprinkling,
      r.seconds.assembly, r.seconds.solve, to_string(r.update), csv_quoted(r.update_reason), r.blade.force.x(),
      r.blade.force.y(), r.blade.force.z(), r.blade.edge_force, r.blade.advance, r.blade.release, r.blade.ledger.work,
      r.blade.ledger.surface, r.blade.ledger.crushing, r.blade.ledger.friction, r.blade.ledger.excess,
      r.blade.ledger.stored, csv_quoted(r.reason), r.blade.torque.x(), r.blade.torque.y(), r.blade.torque.z());
}

void write_wound(const std::filesystem::path& file, const Session& session) {
  const topology::Wound& wound = *session.wound();
  PolyData data;
  data.triangles = wound.surface.triangles;
  std::vector<Vector3> displacement;
  std::vector<double> stress;
  for (std::size_t v = 0; v < wound.surface.vertices.size(); ++v) {
    const solvers::PointState state = session.at(wound.evaluation[v]);
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
