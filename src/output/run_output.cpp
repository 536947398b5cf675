#include "src/output/run_output.hpp"

#include "src/output/summary.hpp"
#include "src/output/tear_output.hpp"
#include "src/scenario/law_reader.hpp"
#include "topology/base/errors.hpp"
#include "topology/tool/tool_outline.hpp"
#include "topology/wound/piece_audit.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

using ForceColumn = Column<StepResult>;
constexpr ForceColumn force_table[] = {
    {"time_s", "{:.9g}", [](const StepResult& s) -> Cell { return s.time; }},
    {"tool_*_m", "{:.9g}", [](const StepResult& s) -> Cell { return s.pose.point; }},
    {"axis_*", "{:.9g}", [](const StepResult& s) -> Cell { return s.pose.axis; }},
    {"force_*_N", "{:.9g}", [](const StepResult& s) -> Cell { return s.force; }},
    {"force_N", "{:.9g}", [](const StepResult& s) -> Cell { return s.force.norm(); }},
    {"contact_*_m", "{:.9g}", [](const StepResult& s) -> Cell { return s.contact.point; }},
    {"depth_m", "{:.9g}", [](const StepResult& s) -> Cell { return s.contact.depth; }},
    {"contact_radius_m", "{:.9g}", [](const StepResult& s) -> Cell { return s.contact_radius; }},
    {"active_nodes", "", [](const StepResult& s) -> Cell { return count(s.active_nodes); }},
    {"candidate_nodes", "", [](const StepResult& s) -> Cell { return count(s.candidates); }},
    {"nodes", "", [](const StepResult& s) -> Cell { return count(s.nodes); }},
    {"iterations", "", [](const StepResult& s) -> Cell { return count(s.iterations); }},
    {"converged", "", [](const StepResult& s) -> Cell { return s.converged; }},
    {"residual", "{:.3e}", [](const StepResult& s) -> Cell { return s.residual; }},
    {"penetration_m", "{:.3e}", [](const StepResult& s) -> Cell { return s.largest_penetration; }},
    {"rotation_deg", "{:.4g}", [](const StepResult& s) -> Cell { return s.rotation_degrees; }},
    {"resprinkled", "", [](const StepResult& s) -> Cell { return s.resprinkled; }},
    {"force_jump", "{:.4g}", [](const StepResult& s) -> Cell { return s.force_jump; }},
    {"seconds", "{:.4g}", [](const StepResult& s) -> Cell { return s.seconds; }},
    {"normal_*_N", "{:.9g}", [](const StepResult& s) -> Cell { return Vector3(s.force - s.tangential); }},
    {"normal_N", "{:.9g}", [](const StepResult& s) -> Cell { return (s.force - s.tangential).norm(); }},
    {"tangential_*_N", "{:.9g}", [](const StepResult& s) -> Cell { return s.tangential; }},
    {"tangential_N", "{:.9g}", [](const StepResult& s) -> Cell { return s.tangential.norm(); }},
    {"torque_*_Nm", "{:.9g}", [](const StepResult& s) -> Cell { return s.torque; }},
    {"torque_Nm", "{:.9g}", [](const StepResult& s) -> Cell { return s.torque.norm(); }},
    // Of a law that is not linear.
    {"least_jacobian", "{:.6g}", [](const StepResult& s) -> Cell { return s.least_jacobian; }},
};

struct SampledField {
  std::vector<Vector3> displacement; // m
  std::vector<double> von_mises;     // Pa
};

SampledField sample(const std::vector<solvers::PointState>& states) {
  SampledField sampled;
  for (const solvers::PointState& state : states) {
    sampled.displacement.push_back(state.displacement);
    sampled.von_mises.push_back(von_mises(state.stress));
  }
  return sampled;
}

std::vector<Vector3> moved(const std::vector<Vector3>& points, const std::vector<Vector3>& displacement) {
  std::vector<Vector3> out;
  out.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    out.push_back(points[i] + displacement[i]);
  return out;
}

void write_organ(const std::filesystem::path& file, const Session& session) {
  const topology::SurfaceMesh& surface = session.organ().domain->surface();
  std::vector<solvers::PointState> states;
  states.reserve(surface.vertices.size());
  for (const Vector3& x : surface.vertices)
    states.push_back(session.model().at(x));
  const SampledField skin = sample(states);
  write_vtp(file, moved(surface.vertices, skin.displacement), surface.triangles,
            {vector_data("displacement [m]", skin.displacement), scalar_data("von Mises stress [Pa]", skin.von_mises)});
}

Figure force_figure(const Session& session, const std::vector<StepResult>& history) {
  Figure force;
  force.title = session.scenario().title.empty() ? "Force on the tool" : session.scenario().title;
  force.x_label = "time [s]";
  force.y_label = "force on the tool [N]";
  force.series = {{"|F|", {}, {}, SeriesStyle::lines_and_points},
                  {"x", {}, {}, SeriesStyle::lines},
                  {"y", {}, {}, SeriesStyle::lines},
                  {"z", {}, {}, SeriesStyle::lines}};
  for (const StepResult& step : history)
    for (std::size_t k = 0; k < 4; ++k) {
      force.series[k].x.push_back(step.time);
      force.series[k].y.push_back(k == 0 ? step.force.norm() : step.force[static_cast<Eigen::Index>(k) - 1]);
    }
  return force;
}

constexpr double open_account = 0.25; // of what a run's tears have spent; a fifth is seen in sound runs

} // namespace

std::span<const Column<StepResult>> force_columns(bool is_nonlinear) {
  const std::span<const ForceColumn> all(force_table);
  return is_nonlinear ? all : all.first(all.size() - 1);
}

int median(std::vector<int> values) {
  if (values.empty())
    return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

RunOutput::RunOutput(std::filesystem::path folder, const Session& session) : folder_(std::move(folder)) {
  findings_.planned = session.steps().size();
  const auto open = [this](std::optional<OutputFile>& file, const std::string& name, std::string_view columns) {
    file.emplace(folder_ / name);
    file->write(columns);
    files_.push_back(name);
    rows_[name] = 0;
  };
  if (session.scenario().tool)
    open(forces_, "forces.csv", header_line(force_columns(is_nonlinear(session.scenario().law))));
  if (has_cuts(session.scenario()))
    open(cuts_, "cuts.csv", header_line(cut_columns()));
  if (session.scenario().tearing.enabled)
    open(tears_, "tears.csv", header_line(tear_columns()));
}

void RunOutput::withdraw() {
  for (std::optional<OutputFile>* file : {&forces_, &cuts_, &tears_})
    file->reset();
  std::error_code ignored;
  for (const std::string& name : files_)
    std::filesystem::remove(folder_ / name, ignored);
  files_.clear();
}

void RunOutput::add_row(OutputFile& file, const std::string& name, const std::string& row) {
  file.write(row);
  ++rows_[name];
}

void RunOutput::add(const Session& session, const StepResult& step) {
  if (forces_)
    add_row(*forces_, "forces.csv", csv_line(force_columns(is_nonlinear(session.scenario().law)), step));
  if (step.cut) {
    add_row(*cuts_, "cuts.csv", csv_line(cut_columns(), CutRow{step.time, *step.cut}));
    const int before = findings_.steps == 0 ? 1 : findings_.cut.pieces;
    if (step.cut->pieces != before)
      check_pieces(session, step.time);
    findings_.cut = *step.cut;
    findings_.peak_blade_torque.take(step.cut->blade.torque, step.time);
    findings_.largest_opening = std::max(findings_.largest_opening, step.cut->opening);
    findings_.increments += step.cut->update != SystemUpdate::none ? 1 : 0; // the blade's; a tear has its own
    findings_.refused_cuts += step.cut->refused ? 1 : 0;
  }
  if (step.tear) {
    add_row(*tears_, "tears.csv", tear_lines(*step.tear));
    findings_.tear = *step.tear;
    findings_.tear_increments += static_cast<int>(step.tear->increments.size()) - 1;
    for (const TearIncrement& increment : step.tear->increments)
      if (increment.number > 0)
        ++findings_.tear_updates[increment.body.update];
    findings_.torn_unstably = findings_.torn_unstably || step.tear->unstable;
    findings_.severed_by_tear = findings_.severed_by_tear || step.tear->severed;
    findings_.seeds += step.tear->seeded ? 1 : 0;
  }
  if (const int every = session.scenario().output.vtp_every;
      every > 0 && (findings_.steps % static_cast<std::size_t>(every) == 0 || findings_.steps + 1 == findings_.planned))
    add_frame(session, step);
  ++findings_.steps;
  findings_.largest_penetration = std::max(findings_.largest_penetration, step.largest_penetration);
  findings_.self_penetration = std::max(findings_.self_penetration, step.self_penetration);
  findings_.largest_residual = std::max(findings_.largest_residual, step.residual);
  findings_.largest_rotation_degrees = std::max(findings_.largest_rotation_degrees, step.rotation_degrees);
  if (step.iterations > 0)
    findings_.iterations.push_back(step.iterations);
  findings_.least_jacobian = std::min(findings_.least_jacobian, step.least_jacobian);
  if (step.resprinkled)
    findings_.resprinkles.emplace_back(step.time, step.force_jump);
  findings_.peak_torque.take(step.torque, step.time);
  if (step.force.norm() > 0)
    findings_.touched = true;
  if (step.force.norm() > findings_.peak.force.norm()) {
    findings_.peak = step;
    keep_profile(session, step);
  }
  history_.push_back(step);
}

// A frame that cannot be written in full leaves nothing: the series has whole frames alone, and the disk its room back.
void RunOutput::add_frame(const Session& session, const StepResult& step) {
  if (series_.empty())
    make_folder(folder_ / "frames");
  const std::size_t known = series_.size();
  try {
    write_frame(session, step);
    write_pvd(folder_ / "series.pvd", series_);
  } catch (const OutputError&) {
    std::error_code ignored;
    for (std::size_t i = known; i < series_.size(); ++i)
      std::filesystem::remove(folder_ / series_[i].file, ignored);
    series_.resize(known);
    if (known == 0)
      std::filesystem::remove(folder_ / "frames", ignored);
    throw;
  }
  if (frames_++ == 0)
    files_.insert(files_.end(), {"series.pvd", "frames"});
}

void RunOutput::write_frame(const Session& session, const StepResult& step) {
  const auto next = [&](int part, std::string_view what) {
    series_.push_back({step.time, part, fmt::format("frames/{}_{:05}.vtp", what, findings_.steps)});
    return folder_ / series_.back().file;
  };
  if (has_cuts(session.scenario()))
    write_wound(next(0, "surface"), session);
  else
    write_organ(next(0, "surface"), session);

  const solvers::NodeCloud& nodes = session.model().sprinkling.nodes;
  if (nodes.size() > 0) {
    std::vector<solvers::PointState> node_states = session.node_states();
    node_states.resize(nodes.positions.size()); // at rest before the first contact
    const SampledField inside = sample(node_states);
    write_vtp(next(1, "nodes"), moved(nodes.positions, inside.displacement), {},
              {vector_data("displacement [m]", inside.displacement),
               scalar_data("von Mises stress [Pa]", inside.von_mises), scalar_data("spacing [m]", nodes.spacings),
               vector_data("normal", nodes.normals)});
  }

  if (session.scenario().tool) {
    const topology::ToolShape& tool = session.scenario().tool->shape;
    const topology::SurfaceMesh mesh = topology::tool_mesh(tool, step.pose, topology::tip_radius(tool) / 6);
    write_vtp(next(2, "tool"), mesh.vertices, mesh.triangles, {});
  }
  if (session.model().incision != nullptr)
    write_incision(next(3, "incision"), *session.model().incision);
}

// The surface at rest, deformed, and the tool in the plane through the contact that holds its normal and the axis
// nearest to x.
void RunOutput::keep_profile(const Session& session, const StepResult& step) {
  const Vector3 up = step.contact.normal;
  Vector3 along = Vector3::UnitX() - up.x() * up;
  if (along.norm() < 0.1)
    along = Vector3::UnitY() - up.y() * up;
  along.normalize();
  const Vector3 origin = step.contact.point;
  const double reach = 4 * std::max(session.zone().spacing.radius, step.contact_radius);
  Series rest{"surface at rest", {}, {}, SeriesStyle::lines};
  Series deformed{"deformed surface", {}, {}, SeriesStyle::lines};
  Series tool{"tool", {}, {}, SeriesStyle::lines};
  constexpr int samples = 200;
  for (int i = -samples; i <= samples; ++i) {
    const double s = reach * i / samples;
    const Vector3 x = session.organ().domain->closest_surface_point(origin + s * along);
    const Vector3 y = x + session.model().at(x).displacement;
    rest.x.push_back(1e3 * along.dot(x - origin));
    rest.y.push_back(1e3 * up.dot(x - origin));
    deformed.x.push_back(1e3 * along.dot(y - origin));
    deformed.y.push_back(1e3 * up.dot(y - origin));
  }
  for (const auto& [x, y] :
       topology::tool_outline(session.scenario().tool->shape, step.pose, origin, along, up, reach)) {
    tool.x.push_back(1e3 * x);
    tool.y.push_back(1e3 * y);
  }
  profile_ = Figure{};
  profile_.title = fmt::format("Profile through the contact at t = {:.4g} s", step.time);
  profile_.x_label = "distance from the contact [mm]";
  profile_.y_label = "height over the contact [mm]";
  profile_.series = {std::move(rest), std::move(deformed), std::move(tool)};
}

void RunOutput::check_pieces(const Session& session, double time) {
  if (session.model().incision == nullptr || pieces_checked(time))
    return;
  if (level_set_ == nullptr)
    level_set_ = std::make_unique<topology::LevelSet>(session.organ().domain->surface());
  const topology::Wound& wound = *session.wound();
  const double voxel = level_set_->voxel_size();
  const topology::VoxelPieces voxels = topology::count_pieces(*level_set_, *session.model().incision, 27, true);
  const auto difference = topology::component_difference(wound);
  const auto pieces = static_cast<int>(wound.pieces.size());
  findings_.piece_checks.push_back({time, pieces, voxels.volumes, voxel,
                                    topology::hausdorff_distance(wound, voxels, voxel), !difference.has_value()});
  if (difference)
    remarks_.push_back(fmt::format("t = {:.4g} s: {}", time, *difference));
  if (const auto counted = static_cast<int>(voxels.volumes.size()); counted != pieces)
    remarks_.push_back(
        fmt::format("t = {:.4g} s: the wound has {} pieces, voxels of {:.2g} m tell {}", time, pieces, voxel, counted));
}

bool RunOutput::pieces_checked(double time) const {
  return !findings_.piece_checks.empty() && findings_.piece_checks.back().time == time;
}

void RunOutput::draw_figures(const Session& session) {
  if (!session.scenario().output.figures || history_.empty())
    return;
  try {
    if (session.scenario().tool)
      draw(force_figure(session, history_), "force.png");
    if (!profile_.series.empty())
      draw(profile_, "profile.png");
    if (has_cuts(session.scenario())) {
      std::vector<double> times;
      std::vector<CutReport> reports;
      for (const StepResult& step : history_) {
        times.push_back(step.time);
        reports.push_back(*step.cut);
      }
      for (const auto& [name, figure] : cut_figures(times, reports))
        draw(figure, name);
    }
    if (session.scenario().tearing.enabled) {
      std::vector<double> times;
      std::vector<TearReport> reports;
      for (const StepResult& step : history_)
        if (step.tear) {
          times.push_back(step.time);
          reports.push_back(*step.tear);
        }
      for (const auto& [name, figure] : tear_figures(times, reports))
        draw(figure, name);
    }
  } catch (const InputError& error) {
    remarks_.push_back(fmt::format("figures: {}", error.what()));
  }
}

void RunOutput::draw(const Figure& figure, const std::string& name) {
  write_png(figure, folder_ / name);
  files_.push_back(name);
}

void RunOutput::write_summary(const Session& session, RunStatus status, const std::string& message) {
  if (const auto open = findings_.tear.ledger.open_share(); findings_.tear_increments > 0 && open > open_account)
    remarks_.push_back(
        fmt::format("the account of the tears leaves {:.0f} % of what they spent open: their areas and energies are no "
                    "better than that; finer nodes or a smaller tearing.step may close it",
                    100 * *open));
  files_.emplace_back("summary.json");
  try {
    replace_file(folder_ / "summary.json", summary_json(session, *this, status, message));
  } catch (const OutputError&) {
    files_.pop_back();
    throw;
  }
}

std::string RunOutput::kept() const {
  std::string text;
  for (const std::string& file : files_) {
    if (file == "frames")
      continue;
    text += text.empty() ? "" : ", ";
    text += file;
    if (file.ends_with(".csv"))
      text += fmt::format(" with {} step{}", rows_.at(file), rows_.at(file) == 1 ? "" : "s");
    else if (file == "series.pvd")
      text += fmt::format(" with {} frame{}", frames_, frames_ == 1 ? "" : "s");
  }
  return text;
}

} // namespace spherecut::app
