// The body of a session follows an increment of its cut, a blade's or a tear's: nodes beside what is new are exchanged
// and the system is updated where it is touched; where that cannot be, or does not pay, it is built anew.
#include "solvers/nodes/sheets.hpp"
#include "solvers/shapes/cut_sight.hpp"
#include "src/base/stage_timer.hpp"
#include "src/scenario/law_reader.hpp"
#include "src/session/session.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <stdexcept>
#include <utility>

namespace spherecut::app {
namespace {

// In fine spacings:
constexpr double zone_ahead = 1;  // so far ahead of a front that may tear nodes are fine beforehand
constexpr double zone_left = 0.5; // a front this far off the middle of the fine zone has left it
constexpr double moved_near = 1;  // a front this near to what is new of the cut is expected to go on
// Of the nodes in a window that follows a tear. Processor time of an increment, updated against rebuilt, and what
// making the window takes in place of the latter: 0.46, 0.95 and 1.7 s where it holds a quarter (1600 nodes), 0.35,
// 0.34 and 0.55 s at 0.54 (590 nodes), 1.25, 1.4 and 2.9 s at two thirds (1380 nodes). A window serves
// as many updates as fit into its zone: one of a spacing, three of a half, six of a quarter.
constexpr double largest_tear_share = 0.5;

} // namespace

// The way of the blade and the front of the cut.
std::vector<std::array<Vector3, 2>> Session::fine_segments(const topology::Incision& incision) const {
  std::vector<std::array<Vector3, 2>> segments = tracks_;
  const auto fronts = solvers::front_segments(incision, zone_.spacing.fine);
  segments.insert(segments.end(), fronts.begin(), fronts.end());
  return segments;
}

// Nodes are fine about a front that tears, as far as its intensities ask for it. Where updates pay, its way ahead is in
// the fine zone too, so that the zone lasts for some increments; elsewhere the zone goes along at every increment.
void Session::lead_zone(const topology::Incision& incision, CutGrowth& growth) {
  const double fine = zone_.spacing.fine;
  if (incision.front().empty()) {
    growth.renewed = "no front is left";
    return;
  }
  const auto why_not = [&, way = growth.way_ahead()]() -> std::string {
    if (std::string hindrance =
            hindrance_to_growth(scenario_, model_, !unheld_pieces(incisions_->wound(), scenario_.fixed).empty());
        !hindrance.empty())
      return hindrance;
    if (cut_appends(scenario_))
      return "";
    if (way.triangles.empty())
      return "no front that has moved goes on";
    if (solvers::window_share(model_.body->problem(), scenario_.method, way) > largest_tear_share)
      return too_much_of_body;
    return can_follow(scenario_, model_, way) ? "" : "too many nodes for a window by this method";
  };
  if (growth.renewed = why_not(); !growth.renewed.empty()) {
    growth.window_pays = false;
    zone_.spacing.segments = fine_segments(incision);
    return;
  }
  const bool leads = !led_segments_.empty() && zone_.spacing.segments == led_segments_;
  const bool holds =
      leads && std::all_of(incision.front().begin(), incision.front().end(), [&](const topology::FrontSegment& front) {
        return solvers::distance_to_segments(front.to, zone_.spacing.segments) <= zone_left * fine;
      });
  if (holds)
    return;
  zone_.spacing.segments = fine_segments(incision);
  for (std::array<Vector3, 2> ends : solvers::front_segments(incision, fine)) {
    for (Vector3& x : ends)
      if (const auto front = incision.front_frame(x, fine))
        x += zone_ahead * fine * front->ahead;
    zone_.spacing.segments.push_back(ends);
  }
  led_segments_ = zone_.spacing.segments;
  growth.renewed = leads ? "the front has left the fine zone" : "the fine zone had nothing of the way ahead";
}

// Where the fronts that have just moved will come to while the fine zone lasts, if they go straight on.
topology::SurfaceMesh Session::way_of_front(const topology::Incision* before, const topology::Incision& now) const {
  const double fine = zone_.spacing.fine;
  std::vector<Vector3> moved;
  for (std::size_t s = 0; s < now.sheets().size(); ++s) {
    const topology::SurfaceMesh& sheet = now.sheets()[s];
    const std::size_t known =
        before != nullptr && s < before->sheets().size() ? before->sheets()[s].vertices.size() : 0;
    moved.insert(moved.end(), sheet.vertices.begin() + static_cast<std::ptrdiff_t>(known), sheet.vertices.end());
  }
  const topology::FrontGrowth ahead = topology::grow_front(
      now,
      [&](const topology::FrontFrame& frame) -> Vector3 {
        const bool moves = std::any_of(moved.begin(), moved.end(), [&](const Vector3& x) {
          return (x - frame.point).squaredNorm() < moved_near * moved_near * fine * fine;
        });
        return moves ? Vector3((zone_ahead + zone_left) * fine * frame.ahead) : Vector3::Zero();
      },
      fine);
  topology::SurfaceMesh way;
  for (std::size_t s = 0; s < ahead.sheets.size(); ++s) {
    const topology::SurfaceMesh& sheet = ahead.sheets[s];
    for (std::size_t t = now.sheets()[s].triangles.size(); t < sheet.triangles.size(); ++t) {
      const int first = static_cast<int>(way.vertices.size());
      for (const int vertex : sheet.triangles[t])
        way.vertices.push_back(sheet.vertices[static_cast<std::size_t>(vertex)]);
      way.triangles.push_back({first, first + 1, first + 2});
    }
  }
  return way;
}

// Nodes and system of the body with the new cut: of what was there, what the cut did not touch stays.
void Session::build_cut(const CutGrowth& growth, BodyModel& next, BodyUpdate& report) {
  if (is_nonlinear(scenario_.law)) {
    build_finite_cut(next, report);
    return;
  }
  const std::string unfollowed =
      growth.beside
          ? "the blade is resisted"
          : hindrance_to_growth(scenario_, model_, !unheld_pieces(incisions_->wound(), scenario_.fixed).empty());
  const bool follows = updating_ && unfollowed.empty() && growth.window_pays;
  followed_.reset();
  report.update = SystemUpdate::rebuilt;
  report.update_reason = !unfollowed.empty()                ? unfollowed
                         : model_.coarseness != coarseness_ ? "the spacing has changed"
                                                            : growth.renewed;
  if (report.update_reason.empty()) {
    const StageTimer timer(report.seconds.sprinkling);
    const StageTimer sprinkle_timer(profile_.sprinkle);
    try {
      followed_ = exchange_nodes(*organ_.domain, sprinkle_options(next), model_, next.sprinkling);
      next.coarseness = coarseness_;
    } catch (const NumericalError& error) {
      report.update_reason = error.what();
    }
  }
  std::vector<int> near;
  const auto build = [&] {
    near = tool_in_reach() ? candidates(next) : std::vector<int>{};
    const StageTimer timer(report.seconds.assembly);
    if (followed_ && follows) {
      const StageTimer growth_timer(profile_.discretise);
      const solvers::BodyGrowth grown = follow_cut(growth.way_ahead, next, report);
      report.update_reason = next.body == nullptr ? grown.uncovered : grown.update.reason;
    }
    if (next.body == nullptr) {
      next.uncut = model_.uncut;
      assemble(next, follows ? growth.way_ahead() : topology::SurfaceMesh{}, near);
    }
  };
  const double seen = solvers::sight_seconds();
  if (followed_) {
    try {
      build();
    } catch (const std::runtime_error& error) { // no sound support, or no node left where the body is held: with all
      report.update_reason = error.what();      // nodes made anew there may be
      followed_.reset();
    }
  }
  if (next.body == nullptr) {
    {
      const StageTimer timer(report.seconds.sprinkling);
      sprinkle(&model_.sprinkling.nodes, next);
    }
    build();
  }
  report_body(next, solvers::sight_seconds() - seen, report);
  const StageTimer timer(report.seconds.solve);
  condense(near, next, true);
}

// After a cut that was refused: incision, wound and body as they were. `body`: that of the model before. True: it is
// another, of the same nodes, that has to be solved.
bool Session::take_back_cut(const solvers::Discretisation* body) {
  incisions_->take_back();
  if (model_.body.get() == body)
    return false;
  try {
    if (model_.body == nullptr) { // it had followed the cut before that was refused; else another had taken over
      drop_recondensing();
      app::assemble(scenario_, organ_.domain, model_);
    }
    condense_again();
  } catch (const std::runtime_error& error) {
    model_.body.reset(); // the next step builds it
    model_.state.reset();
    throw NumericalError(
        fmt::format("the body cannot be had again as it was before a cut that was refused: {}", error.what()));
  }
  return true;
}

// Another body has taken over on the same nodes: contact goes on from where it is.
void Session::condense_again() {
  std::optional<solvers::CutContactState> state = std::move(model_.state);
  condense(std::vector<int>(model_.patch.nodes), model_, true);
  model_.state = std::move(state);
  model_.front_rules = {};
}

} // namespace spherecut::app
