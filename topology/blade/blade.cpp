#include "topology/blade/blade.hpp"

#include "topology/base/errors.hpp"
#include "topology/blade/edge_sweep.hpp"
#include "topology/incision/sheet_front.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <unordered_map>
#include <utility>

namespace spherecut::topology {

namespace {

std::vector<Vector3> resampled(const std::vector<Vector3>& edge, double longest) {
  std::vector<Vector3> points{edge.front()};
  for (std::size_t i = 1; i < edge.size(); ++i) {
    const int pieces = std::max(1, static_cast<int>(std::ceil((edge[i] - edge[i - 1]).norm() / longest - 1e-6)));
    for (int k = 1; k <= pieces; ++k)
      points.push_back(edge[i - 1] + double(k) / pieces * (edge[i] - edge[i - 1]));
  }
  return points;
}

/// The triangles of a sheet from `first` on, with their own vertices alone.
SurfaceMesh tail(const SurfaceMesh& sheet, int first) {
  SurfaceMesh patch;
  std::unordered_map<int, int> index;
  for (int t = first; t < std::ssize(sheet.triangles); ++t) {
    Triangle corners{};
    for (int c = 0; c < 3; ++c) {
      const int v = sheet.triangles[t][c];
      const auto [found, is_new] = index.emplace(v, static_cast<int>(patch.vertices.size()));
      if (is_new)
        patch.vertices.push_back(sheet.vertices[v]);
      corners[c] = found->second;
    }
    patch.triangles.push_back(corners);
  }
  return patch;
}

void check(const SweepOptions& options) {
  const auto require = [](bool good, const char* name, double value, const char* limit) {
    if (!good)
      throw InputError(fmt::format("blade sweep: {} = {}, must be {}", name, value, limit));
  };
  require(std::isfinite(options.edge) && options.edge > 0, "edge", options.edge, "a positive number of metres");
  require(options.minimum_step >= 0.001 && options.minimum_step <= 1, "minimum_step", options.minimum_step,
          "from 0.001 to 1");
  require(options.sharp_turn > 0 && options.sharp_turn <= 90, "sharp_turn", options.sharp_turn, "in (0, 90] degrees");
  require(options.most_triangles > 0, "most_triangles", options.most_triangles, "positive");
}

} // namespace

void check(const Blade& blade) {
  if (blade.edge.size() < 2)
    throw InputError(fmt::format("blade: its edge has {} points, at least 2 are needed", blade.edge.size()));
  for (std::size_t i = 0; i < blade.edge.size(); ++i) {
    const Vector3& x = blade.edge[i];
    if (!x.allFinite())
      throw InputError(fmt::format("blade: point {} of its edge ({}, {}, {}) is not finite", i, x.x(), x.y(), x.z()));
    if (i > 0 && (x - blade.edge[i - 1]).norm() < 1e-9)
      throw InputError(fmt::format("blade: points {} and {} of its edge coincide", i - 1, i));
  }
  if (!(std::isfinite(blade.edge_radius) && blade.edge_radius > 0))
    throw InputError(fmt::format("blade: edge radius = {} m, must be a positive number", blade.edge_radius));
}

struct BladeSweep::State {
  State(Blade blade_in, std::shared_ptr<const Domain> domain_in, const SweepOptions& options_in)
      : blade(std::move(blade_in)), domain(std::move(domain_in)), options(options_in), swept(domain, options),
        edge(resampled(blade.edge, options.edge)) {}

  [[nodiscard]] std::vector<Vector3> row_at(const Vector3& position, const Eigen::Quaterniond& orientation,
                                            const RestMap& to_rest) const {
    std::vector<Vector3> points;
    points.reserve(edge.size());
    for (const Vector3& x : edge) {
      const Vector3 now = orientation * x + position;
      points.push_back(to_rest ? to_rest(now) : now);
      if (!points.back().allFinite())
        throw NumericalError(
            fmt::format("the map to the rest frame is not finite at ({}, {}, {})", now.x(), now.y(), now.z()));
    }
    return points;
  }

  /// Rows between the present one and the one at `pose`, no more than an edge apart; the last is that at `pose`.
  [[nodiscard]] std::vector<std::vector<Vector3>> rows_to(const BladePose& pose, const RestMap& to_rest) const {
    const std::vector<Vector3>& row = swept.row();
    const std::vector<Vector3> last = row_at(pose.position, pose.orientation, to_rest);
    double farthest = 0;
    for (std::size_t i = 0; i < last.size(); ++i)
      farthest = std::max(farthest, (last[i] - row[i]).norm());
    if (farthest < options.minimum_step * options.edge)
      return {};
    const double turn = row_pose.orientation.angularDistance(pose.orientation);
    constexpr double widest_turn = 0.35; // rad a row
    const double steps = std::ceil(std::max(farthest / options.edge - 1e-6, turn / widest_turn));
    const double triangles =
        swept.sheets().triangles() - had_triangles + 2 * steps * static_cast<double>(row.size() - 1);
    if (!(triangles <= options.most_triangles))
      throw InputError(fmt::format("blade sweep: a motion of {} m could bring the cut to {:.0f} triangles, at most {} "
                                   "are allowed",
                                   farthest, triangles, options.most_triangles));
    // What the tissue moved since the present row was cut fades out on the way.
    std::vector<Vector3> lag = row_at(row_pose.position, row_pose.orientation, to_rest);
    for (std::size_t i = 0; i < lag.size(); ++i)
      lag[i] = row[i] - lag[i];
    std::vector<std::vector<Vector3>> rows;
    const int count = std::max(1, static_cast<int>(steps));
    for (int k = 1; k < count; ++k) {
      const double s = double(k) / count;
      rows.push_back(row_at((1 - s) * row_pose.position + s * pose.position,
                            row_pose.orientation.slerp(s, pose.orientation), to_rest));
      for (std::size_t i = 0; i < lag.size(); ++i)
        rows.back()[i] += (1 - s) * lag[i];
    }
    rows.push_back(last);
    return rows;
  }

  SweepResult move(const BladePose& pose, const RestMap& to_rest) {
    SweepResult result;
    if (swept.row().empty()) {
      swept.place(row_at(pose.position, pose.orientation, to_rest));
      row_pose = pose;
      time = pose.time;
      result.refused = "the blade was only placed";
      return result;
    }
    const auto rows = rows_to(pose, to_rest);
    time = pose.time;
    if (rows.empty()) {
      result.refused = "the blade did not move";
      return result;
    }
    std::vector<int> had;
    for (const SurfaceMesh& sheet : swept.sheets().sheets())
      had.push_back(static_cast<int>(sheet.triangles.size()));
    EdgeSweep::Tally tally;
    for (const std::vector<Vector3>& next : rows)
      swept.advance(next, tally);
    row_pose = pose;
    had.resize(swept.sheets().sheets().size(), 0);
    given.resize(had.size(), -1);
    for (int s = 0; s < std::ssize(had); ++s) {
      const SurfaceMesh& sheet = swept.sheets().sheets()[s];
      const int count = static_cast<int>(sheet.triangles.size());
      if (count == had[s])
        continue;
      const SurfaceMesh patch = tail(sheet, had[s]);
      if (given[s] < 0 && !reaches_inside(patch, *domain))
        continue;
      const int first = given[s] < 0 ? 0 : had[s];
      if (given[s] < 0) {
        given[s] = static_cast<int>(order.size());
        order.push_back(s);
      }
      result.area += area_inside(patch, *domain);
      result.triangles += count - first;
      result.added.push_back({given[s], first, count - first});
    }
    if (result.triangles > 0)
      ++revision;
    else if (!tally.swept)
      result.refused = "the blade moved along its edge";
    else if (!tally.near_body)
      result.refused = "the blade moved outside the body";
    else
      result.refused = "the blade moved outside the body or where it had cut before";
    return result;
  }

  [[nodiscard]] std::vector<SurfaceMesh> given_sheets() const {
    std::vector<SurfaceMesh> result;
    for (const int s : order)
      result.push_back(swept.sheets().sheets()[s]);
    return result;
  }

  Blade blade;
  std::shared_ptr<const Domain> domain;
  SweepOptions options;
  EdgeSweep swept;
  std::vector<Vector3> edge; // resampled, blade's frame
  BladePose row_pose;
  std::optional<double> time;    // s, of the last pose
  std::vector<int> given, order; // place of each sheet among those given, -1 outside the body; and back
  int revision = 0;
  int had_triangles = 0; // of sheets that were there, which the blade's own limit does not count
  mutable std::shared_ptr<const Incision> incision;
};

BladeSweep::BladeSweep(Blade blade, std::shared_ptr<const Domain> domain, const SweepOptions& options) {
  topology::check(blade);
  check(options);
  if (!domain)
    throw InputError("blade sweep: there is no body to cut");
  state_ = std::make_unique<State>(std::move(blade), std::move(domain), options);
}
BladeSweep::~BladeSweep() = default;
BladeSweep::BladeSweep(const BladeSweep& other) : state_(std::make_unique<State>(*other.state_)) {}
BladeSweep& BladeSweep::operator=(const BladeSweep& other) {
  state_ = std::make_unique<State>(*other.state_);
  return *this;
}
BladeSweep::BladeSweep(BladeSweep&&) noexcept = default;
BladeSweep& BladeSweep::operator=(BladeSweep&&) noexcept = default;

SweepResult BladeSweep::move_to(const BladePose& pose, const RestMap& to_rest) {
  if (!pose.position.allFinite() || !pose.orientation.coeffs().allFinite() || !std::isfinite(pose.time))
    throw InputError(fmt::format("blade pose at time {} s: position ({}, {}, {}) or orientation is not finite",
                                 pose.time, pose.position.x(), pose.position.y(), pose.position.z()));
  if (!(pose.orientation.norm() > 1e-9))
    throw InputError(fmt::format("blade pose at time {} s: its orientation is zero", pose.time));
  if (state_->time && pose.time <= *state_->time)
    throw InputError(
        fmt::format("blade pose at time {} s does not come after the one at {} s", pose.time, *state_->time));
  BladePose unit = pose;
  unit.orientation.normalize();
  return state_->move(unit, to_rest);
}

void BladeSweep::lift() {
  state_->swept.place({});
}

void BladeSweep::add(const SurfaceMesh& sheet) {
  check_sheet(sheet, "the sheet");
  State& state = *state_;
  const int own = state.swept.add(sheet);
  state.had_triangles += static_cast<int>(sheet.triangles.size());
  state.given.resize(static_cast<std::size_t>(own) + 1, -1);
  state.given.back() = static_cast<int>(state.order.size());
  state.order.push_back(own);
  ++state.revision;
}

void BladeSweep::extend(int sheet, const SurfaceMesh& grown) {
  State& state = *state_;
  if (sheet < 0 || sheet >= std::ssize(state.order))
    throw InputError(fmt::format("blade sweep: sheet {} does not exist; there are {}", sheet, state.order.size()));
  const int own = state.order[static_cast<std::size_t>(sheet)];
  const SurfaceMesh& now = state.swept.sheets().sheets()[static_cast<std::size_t>(own)];
  if (grown.vertices.size() < now.vertices.size() || grown.triangles.size() < now.triangles.size())
    throw InputError(fmt::format("blade sweep: sheet {} of {} triangles cannot become one of {}", sheet,
                                 now.triangles.size(), grown.triangles.size()));
  state.swept.extend(own, grown);
  ++state.revision;
}

std::vector<SurfaceMesh> BladeSweep::sheets() const {
  return state_->given_sheets();
}
int BladeSweep::revision() const {
  return state_->revision;
}
std::shared_ptr<const Incision> BladeSweep::incision() const {
  if (!state_->incision || state_->incision->revision() != state_->revision)
    state_->incision = std::make_shared<const Incision>(state_->given_sheets(), state_->domain, state_->revision);
  return state_->incision;
}
const Blade& BladeSweep::blade() const {
  return state_->blade;
}
const std::vector<Vector3>& BladeSweep::edge_at_rest() const {
  return state_->swept.row();
}

} // namespace spherecut::topology
