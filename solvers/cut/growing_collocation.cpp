// The balance of cells of a body whose cut grows: cells, supports and rows that the increment can reach are made again,
// the others stay, and of the system a dense window is factored again (lu_window.hpp).
//
// A row belongs to the window with all its columns, or it does not change: so a changed row is a row of the window's
// dense matrix as it is, and what was eliminated stays.
#include "solvers/cut/growing_collocation.hpp"

#include "solvers/body/cell_loads.hpp"
#include "solvers/shapes/cut_reach.hpp"
#include "solvers/shapes/cut_sight.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <span>

namespace spherecut::solvers {

namespace {

/// Part of the reach of a cell, in reaches, from which a change of the cut may give it other faces (update_cells).
constexpr double cells_see = 3;
constexpr double lifted = 0.15; // eyes are lifted off a sheet, in spacings

} // namespace

/// What an increment changes of spheres, faces and front, and who may see it.
class GrowingCollocation::SphereChange {
 public:
  SphereChange(const GrowingCollocation& body, const SprinkleIncrement& change, const Problem& grown,
               const Next& next) {
    const NodeCloud &nodes = grown.nodes, &old = body.problem_.nodes;
    const std::vector<double>&radii = next.spheres->radii(), &old_radii = body.spheres_.radii();
    // Spheres of both, those that have gone at the end; where one came, went or changed its size.
    std::vector<Vector3> centres = nodes.positions;
    std::vector<double> largest = radii;
    for (int i = 0; i < nodes.size(); ++i) {
      const double before = next.was[i] >= 0 ? old_radii[next.was[i]] : 0;
      largest[i] = std::max(largest[i], before);
      if (before != radii[i])
        balls_.emplace_back(nodes.positions[i], largest[i]);
    }
    for (const int node : change.removed) {
      centres.push_back(old.positions[node]);
      largest.push_back(old_radii[node]);
      balls_.emplace_back(old.positions[node], old_radii[node]);
    }
    slack_ = 0.25 * *std::min_element(nodes.spacings.begin(), nodes.spacings.end());
    const topology::Incision* const before = body.problem_.incision.get();
    changes_ = changes_between(before, SpacingAt(old, std::vector<char>(old.positions.size(), 0)), *grown.incision,
                               SpacingAt(nodes, std::vector<char>(nodes.positions.size(), 0)), 2 * slack_);
    std::vector<Vector3> all_front = changes_.front;
    add_front(before, 2 * slack_, all_front);
    add_front(grown.incision.get(), 2 * slack_, all_front);
    enriched_ = body.options_.method.sight == SightRule::enriched ? next.spheres->cut()->sight().reach / body.rho() : 0;
    reach_.emplace(changes_.faces, changes_.front, all_front, enriched_, centres, largest, slack_);
  }

  [[nodiscard]] const Changes& changes() const { return changes_; }
  [[nodiscard]] double slack() const { return slack_; }
  /// Whether something within `half` m of x changes.
  [[nodiscard]] bool is_seen(const Vector3& x, double half) const {
    return reach_->sees(x, half) || reach_->near_front(x, half, std::max(1.0, enriched_)) ||
           std::any_of(balls_.begin(), balls_.end(), [&](const auto& ball) {
             const double far = ball.second + half;
             return (ball.first - x).squaredNorm() < far * far;
           });
  }

 private:
  Changes changes_;
  std::vector<std::pair<Vector3, double>> balls_;
  double slack_ = 0, enriched_ = 0; // m; reach of the enrichment in sphere radii
  std::optional<Reach> reach_;
};

/// Rows that are made again, and the nodes whose supports are.
void GrowingCollocation::find_wanted_rows(const SphereChange& sphere_change, std::vector<char>& seen_anew,
                                          Next& next) const {
  // A support that was not sound reached beyond the spheres, and knows nodes that none of them tells of.
  const auto names_removed = [&](std::span<const int> named) {
    return std::any_of(named.begin(), named.end(), [&](int node) { return next.place[node] < 0; });
  };
  const auto names_removed_in_support = [&](int was) {
    return names_removed(
        std::span(supports_.nodes).subspan(supports_.start[was], supports_.start[was + 1] - supports_.start[was]));
  };
  const topology::CellComplex& cells = next.cells.cells;
  const std::vector<Vector3>& x = next.spheres->centres();
  const int count = static_cast<int>(x.size());
  seen_anew.assign(x.size(), 0);
  next.wanted = next.cells.made;
  for (int i = 0; i < count; ++i) {
    const double half = std::max(cells.reaches[i], next.was[i] >= 0 ? cells_.reaches[next.was[i]] : 0);
    if (next.was[i] < 0 || sphere_change.is_seen(x[i], 0) || names_removed_in_support(next.was[i]))
      seen_anew[i] = 1;
    if (seen_anew[i] != 0 || sphere_change.is_seen(x[i], half) || names_removed(rows_[next.was[i]].nodes))
      next.wanted[i] = 1;
  }
  for (const topology::CellFace& face : cells.faces) // whose rows ask for each other's supports
    if (seen_anew[face.first] != 0 || seen_anew[face.second] != 0)
      next.wanted[face.first] = next.wanted[face.second] = 1;
}

GrowingCollocation::Next GrowingCollocation::next_of(const SprinkleIncrement& change, std::vector<int> place,
                                                     const Problem& grown, GrowthReport& report) const {
  const Stopwatch sphere_watch;
  Next next;
  const NodeCloud& nodes = grown.nodes;
  const int count = nodes.size();
  next.place = std::move(place);
  next.was.assign(count, -1);
  for (int i = 0; i < problem_.nodes.size(); ++i)
    if (next.place[i] >= 0)
      next.was[next.place[i]] = i;
  next.spheres.emplace(nodes.positions, nodes.spacings, rho(), Basis::linear, worst_moment_condition,
                       sight_about_cut(grown, Method::collocation, options_.method.sight));
  report.spheres_seconds = sphere_watch.seconds();
  const SphereChange sphere_change(*this, change, grown, next);
  const Changes& changes = sphere_change.changes();

  const Stopwatch cell_watch;
  next.places = changes.faces;
  next.places.insert(next.places.end(), changes.front.begin(), changes.front.end());
  const Nearness to_places(next.places);
  std::vector<char> touched(static_cast<std::size_t>(count), 1);
  for (int i = 0; i < count; ++i)
    if (next.was[i] >= 0)
      touched[i] = to_places(nodes.positions[i]) <
                   cells_see * cells_.reaches[next.was[i]] + lifted * nodes.spacings[i] + sphere_change.slack();
  next.cells = topology::update_cells(cells_, next.was, nodes.positions, nodes.spacings, *grown.domain,
                                      grown.incision.get(), touched);

  std::vector<char> seen_anew;
  find_wanted_rows(sphere_change, seen_anew, next);
  std::vector<int> found, known = next.was;
  for (int i = 0; i < count; ++i)
    if (seen_anew[i] != 0) {
      found.push_back(i);
      known[i] = -1;
    }
  const topology::CellComplex& cells = next.cells.cells;
  next.supports = renewed_supports(supports_, nodal_supports(*next.spheres, found), known, next.place);
  assemble_rows(grown, cells, *next.spheres, next.supports, mixed_, next.wanted, next.rows);
  for (const Anchor& anchor : anchors_)
    if (const int node = next.place[anchor.node]; node >= 0 && next.wanted[node] != 0)
      next.rows[node].blocks.front().topLeftCorner<3, 3>() += anchor_stiffness(anchor);
  next.constrained.assign(nodes.positions.size(), {false, false, false});
  for (const Prescribed& entry : grown.prescribed)
    for (int c = 0; c < 3; ++c)
      next.constrained[entry.node][c] = next.constrained[entry.node][c] || entry.components[c];
  next.loads = cell_loads(cells, grown, stress_of(grown.loads.initial_strain));
  find_changed_rows(next);
  report.boxes = static_cast<int>(std::count(next.wanted.begin(), next.wanted.end(), 1));
  report.cells_seconds = cell_watch.seconds();
  return next;
}

/// Many rows come out as they were: what is near need not be in sight.
void GrowingCollocation::find_changed_rows(Next& next) const {
  const int count = static_cast<int>(next.was.size());
  next.changed.assign(static_cast<std::size_t>(count), 0);
  std::vector<int> at(static_cast<std::size_t>(count), -1); // of a node in the row before
  for (int i = 0; i < count; ++i) {
    const int was = next.was[i];
    if (was < 0 || next.constrained[i] != constrained_[was]) {
      next.changed[i] = 1;
      continue;
    }
    const bool support_same = [&] {
      const int begin = next.supports.start[i], size = next.supports.start[i + 1] - begin;
      const int old_begin = supports_.start[was];
      if (size != supports_.start[was + 1] - old_begin)
        return false;
      for (int k = 0; k < size; ++k)
        if (next.supports.nodes[begin + k] != next.place[supports_.nodes[old_begin + k]] ||
            next.supports.value[begin + k] != supports_.value[old_begin + k])
          return false;
      return true;
    }();
    const auto& held = next.constrained[i];
    if ((held[0] || held[1] || held[2]) && !support_same) {
      next.changed[i] = 1;
      continue;
    }
    if (next.wanted[i] == 0)
      continue;
    const BalanceRow &row = next.rows[i], &old = rows_[was];
    bool same = row.nodes.size() == old.nodes.size();
    for (std::size_t k = 0; k < old.nodes.size(); ++k)
      if (const int now = next.place[old.nodes[k]]; now >= 0)
        at[now] = static_cast<int>(k);
      else
        same = false;
    for (std::size_t k = 0; same && k < row.nodes.size(); ++k)
      same = at[row.nodes[k]] >= 0 && row.blocks[k] == old.blocks[at[row.nodes[k]]];
    for (const int node : old.nodes)
      if (next.place[node] >= 0)
        at[next.place[node]] = -1;
    next.changed[i] = same ? 0 : 1;
  }
}

const char* GrowingCollocation::hindrance(const Next& next, const std::vector<int>& slot) const {
  for (std::size_t i = 0; i < next.was.size(); ++i) {
    if (next.changed[i] == 0)
      continue;
    if (slot[i] < 0)
      return "the cut left the predicted way";
    if (next.was[i] >= 0)
      for (int c = 0; c < stride_; ++c)
        if (window_->leads_far(stride_ * slot[i] + c))
          return "the cut left the predicted way";
    const auto outside = [&](int node) { return slot[node] < 0; };
    const auto& held = next.constrained[i];
    if (!(held[0] && held[1] && held[2] && stride_ == 3)) {
      const std::vector<int>& nodes = next.wanted[i] != 0 ? next.rows[i].nodes : rows_[next.was[i]].nodes;
      for (const int node : nodes)
        if (outside(next.wanted[i] != 0 ? node : next.place[node]))
          return "the cut left the predicted way";
    }
    if (held[0] || held[1] || held[2])
      for (int k = next.supports.start[i]; k < next.supports.start[i + 1]; ++k)
        if (outside(next.supports.nodes[k]))
          return "the cut came to the held region";
  }
  return "";
}

void GrowingCollocation::put_in(Next next, Problem grown, const std::vector<int>& slot) {
  const int count = grown.nodes.size();
  std::vector<int> origin(static_cast<std::size_t>(count), -1);
  for (int i = 0; i < count; ++i) {
    const int was = next.was[i];
    if (was >= 0)
      origin[i] = origin_[was];
    else
      for (int c = 0; c < stride_; ++c)
        window_->activate(stride_ * slot[i] + c);
    if (next.wanted[i] != 0)
      continue;
    next.rows[i] = std::move(rows_[was]);
    for (int& node : next.rows[i].nodes)
      node = next.place[node];
  }
  for (int i = 0; i < std::ssize(next.place); ++i)
    if (next.place[i] < 0 && slot_[i] >= 0)
      for (int c = 0; c < stride_; ++c)
        window_->deactivate(stride_ * slot_[i] + c);
  for (Anchor& anchor : anchors_)
    anchor.node = next.place[anchor.node];
  slot_ = slot;
  origin_ = std::move(origin);
  problem_ = std::move(grown);
  spheres_ = std::move(*next.spheres);
  supports_ = std::move(next.supports);
  cells_ = std::move(next.cells.cells);
  rows_ = std::move(next.rows);
  constrained_ = std::move(next.constrained);
  dropped_.assign(static_cast<std::size_t>(count), 0);
  loads_ = std::move(next.loads);
  report_.nodes = count;
  report_.unknowns = stride_ * count;
  report_.grown_supports = spheres_.grown();
  report_.worst_moment_condition = supports_.worst_moment_condition;
  write_rows(next.changed);
}

void GrowingCollocation::take_over(GrowingCollocation& other) {
  std::swap(problem_, other.problem_);
  std::swap(report_, other.report_);
  std::swap(spheres_, other.spheres_);
  std::swap(supports_, other.supports_);
  std::swap(cells_, other.cells_);
  std::swap(constrained_, other.constrained_);
  std::swap(anchors_, other.anchors_);
  std::swap(dropped_, other.dropped_);
  std::swap(loads_, other.loads_);
  std::swap(rows_, other.rows_);
  std::swap(mixed_, other.mixed_);
  std::swap(stride_, other.stride_);
  std::swap(options_, other.options_);
  std::swap(window_, other.window_);
  std::swap(slot_, other.slot_);
  std::swap(origin_, other.origin_);
  std::swap(first_count_, other.first_count_);
  std::swap(next_room_, other.next_room_);
  std::swap(last_places_, other.last_places_);
}

struct GrowingCollocation::Growing {
  const std::function<topology::SurfaceMesh()>& way_ahead;
  bool only_update;
  std::vector<int> place; // of nodes before in those after; -1: gone
  BodyGrowth growth{};
};

/// The body of `problem` from nothing; `is_overwritten`: this one is not what it was before.
void GrowingCollocation::condense_anew(const char* reason, Problem problem, bool is_overwritten, Growing& growing) {
  GrowthReport& report = growing.growth.update;
  report.reason = reason;
  if (growing.only_update && !is_overwritten) {
    report.declined = true;
    growing.growth.uncovered = reason;
    return;
  }
  GrowthOptions options = options_;
  if (!is_overwritten) {
    std::erase_if(options.contact, [&](int& node) { return (node = growing.place[node]) < 0; });
    if (growing.way_ahead)
      if (topology::SurfaceMesh way = growing.way_ahead(); !way.triangles.empty())
        options.way = std::move(way);
  }
  GrowingCollocation fresh(std::move(problem), std::move(options));
  take_over(fresh);
  report.condensed_anew = true;
  report.window_nodes = window_->slots() / stride_ - options_.room;
}

/// Puts the increment into the window, or condenses anew where the window does not hold it.
void GrowingCollocation::update(const SprinkleIncrement& change, Problem grown, Growing& growing) {
  GrowthReport& report = growing.growth.update;
  if (!continues(problem_.incision.get(), *grown.incision))
    return condense_anew("the sheets do not continue those before", std::move(grown), false, growing);
  if (stride_ * (next_room_ + change.added.size()) > window_->slots())
    return condense_anew("no room for the added nodes", std::move(grown), false, growing);
  Next next = next_of(change, growing.place, grown, report);
  std::vector<int> slot(next.was.size());
  for (std::size_t i = 0, added = 0; i < slot.size(); ++i)
    slot[i] = next.was[i] >= 0 ? slot_[next.was[i]] : next_room_ + static_cast<int>(added++);
  for (const int node : change.removed)
    if (slot_[node] < 0)
      return condense_anew("a removed node lies outside the window", std::move(grown), false, growing);
  if (const char* const outside = hindrance(next, slot); outside[0] != '\0')
    return condense_anew(outside, std::move(grown), false, growing);

  const Stopwatch commit_watch;
  Problem before = problem_;
  std::vector<int> contact_before = options_.contact;
  std::erase_if(options_.contact, [&](int& node) { return (node = growing.place[node]) < 0; });
  next_room_ += change.added.size();
  const std::vector<Vector3> places = std::move(next.places);
  put_in(std::move(next), std::move(grown), slot);
  report.cells_seconds += commit_watch.seconds();
  const Stopwatch factor_watch;
  try {
    report.prepared = factor_window(places);
  } catch (const NumericalError&) {
    // The ordinary way says what is wrong; then the body before is made again, for this one has been overwritten.
    try {
      condense_anew("the window became singular", problem_, true, growing);
    } catch (...) {
      options_.contact = std::move(contact_before);
      condense_anew("as it was", std::move(before), true, growing);
      throw;
    }
  }
  report.factor_seconds = factor_watch.seconds();
  report.factored = window_->factored();
  report.window_nodes = (window_->factored() + window_->done_ahead()) / stride_;
}

BodyGrowth GrowingCollocation::grow(const SprinkleIncrement& change, Problem grown,
                                    const std::function<topology::SurfaceMesh()>& way_ahead, bool only_update) {
  const Stopwatch total;
  if (grown.incision == nullptr)
    throw InputError("a growing cut needs an incision");
  check_problem(grown);
  Growing growing{way_ahead, only_update, places_after(change, problem_.nodes.size(), grown.nodes.size())};
  BodyGrowth& growth = growing.growth;
  std::vector<Piece> pieces = pieces_by_sight(grown);
  if (unheld_count(pieces) > unheld_count(report_.pieces)) {
    growth.uncovered = "a piece came free";
    return growth;
  }
  for (const Anchor& anchor : anchors_)
    if (growing.place[anchor.node] < 0) {
      growth.uncovered = "a spring that holds a severed piece lost its node";
      return growth;
    }
  update(change, std::move(grown), growing);
  GrowthReport& report = growth.update;
  if (!report.condensed_anew && !report.declined) {
    report_.supports_seconds = report.spheres_seconds;
    report_.assembly_seconds = report.cells_seconds;
    report_.factor_seconds = report.factor_seconds;
    report_.pieces = std::move(pieces);
  }
  report.total_seconds = total.seconds();
  return growth;
}

std::unique_ptr<Discretisation> make_growable(Problem problem, GrowthOptions options) {
  require_one_material(problem, "a cut that grows");
  if (options.method.method == Method::collocation) {
    require_domain(problem);
    return std::make_unique<GrowingCollocation>(std::move(problem), std::move(options));
  }
  return std::make_unique<GrowingBody>(std::move(problem), std::move(options));
}

} // namespace spherecut::solvers
