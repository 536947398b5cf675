// The balance of cells of a body whose cut grows: cells, supports and rows that the increment can reach are made again,
// the others stay, and of the system a dense window is factored again (lu_window.hpp).
//
// A row belongs to the window with all its columns, or it does not change: so a changed row is a row of the window's
// dense matrix as it is, and what was eliminated stays.
#include "solvers/cell_loads.hpp"
#include "solvers/collocation_body.hpp"
#include "solvers/cut_reach.hpp"
#include "solvers/cut_sight.hpp"
#include "solvers/growing_body.hpp"
#include "solvers/lu_window.hpp"
#include "topology/errors.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

/// Part of the reach of a cell, in reaches, from which a change of the cut may give it other faces (update_cells).
constexpr double cells_see = 3;
constexpr double rounding = 1e-12;            // of the right-hand side: a smaller residual is not corrected
constexpr double increments_before_new = 2.2; // as advance_before_new, in increments where those are long
constexpr double lifted = 0.15;               // eyes are lifted off a sheet, in spacings

class GrowingCollocation final : public Collocation, public Growable {
 public:
  GrowingCollocation(Problem problem, GrowthOptions options)
      : Collocation(std::move(problem), options.method, Assembled{}), options_(std::move(options)) {
    if (options_.way.triangles.empty())
      throw InputError("the predicted way of the cut is empty");
    for (const int node : options_.contact)
      if (node < 0 || node >= problem_.nodes.size())
        throw InputError(
            fmt::format("contact candidate {} does not exist; there are {} nodes", node, problem_.nodes.size()));
    if (std::find(dropped_.begin(), dropped_.end(), 1) != dropped_.end())
      throw InputError("a severed piece that leaves the computation cannot be followed by an update");
    make_window();
  }

  BodyGrowth grow(const SprinkleIncrement& change, Problem grown,
                  const std::function<topology::SurfaceMesh()>& way_ahead, bool only_update) override;
  Field force_response(const std::vector<int>& nodes, const std::vector<Vector3>& forces) const override;
  MatrixX contact_compliance(const std::vector<int>& candidates) const override;

 private:
  /// What an increment makes, before it is known whether the window covers it.
  struct Next {
    std::vector<int> place, was; // of nodes before in those after, and back; -1: gone, new
    topology::CellUpdate cells;
    std::optional<Spheres> spheres;
    NodalSupports supports;
    std::vector<char> wanted; // rows made again
    std::vector<BalanceRow> rows;
    std::vector<char> changed; // rows of the system that differ
    std::vector<std::array<bool, 3>> constrained;
    std::vector<Vector3> places; // where the cut is new
  };

  [[nodiscard]] MatrixX solution(const MatrixX& right) const override;
  [[nodiscard]] MatrixX window_solution(const MatrixX& right) const;
  [[nodiscard]] double rho() const { return collocation_support_radius(options_.method); }
  void make_window();
  [[nodiscard]] Next next_of(const SprinkleIncrement& change, const Problem& grown, GrowthReport& report) const;
  [[nodiscard]] NodalSupports next_supports(const Next& next, const std::vector<char>& seen_anew) const;
  void find_changed_rows(Next& next) const;
  /// Why the window does not cover it; empty: it does.
  [[nodiscard]] const char* hindrance(const Next& next, const std::vector<int>& slot) const;
  void put_in(Next next, Problem grown, const std::vector<int>& slot);
  void write_rows(const std::vector<char>& changed);
  /// Factors the window. What the next increments are not going to touch is eliminated on the way and stands until one
  /// does. Whether it stood.
  bool factor_window(const std::vector<Vector3>& places);
  void take_over(GrowingCollocation& other);

  GrowthOptions options_;
  std::unique_ptr<LuWindow> window_;
  std::vector<int> slot_;   // block of stride_ slots of every node in the window, -1 outside
  std::vector<int> origin_; // node at condensation, -1: added since
  int first_count_ = 0;     // nodes at condensation
  int next_room_ = 0;
  std::vector<Vector3> last_places_; // where the cut was new at the last increment
};

void GrowingCollocation::make_window() {
  const Stopwatch watch;
  const int count = problem_.nodes.size();
  const std::vector<Vector3>& x = problem_.nodes.positions;
  const bool enriched = options_.method.sight == SightRule::enriched;
  const double growth = enriched ? front_radius_factor : 1;
  const double front_reach = enriched ? sight_about_cut(problem_, options_.method.sight).reach : 0; // in spacings
  const ReachAlong in_reach(options_.way, problem_.incision.get(), problem_.nodes, std::vector<char>(count, 0),
                            spheres_.radii(), front_reach / rho(), growth, true);
  // Spheres that the front comes to, or leaves, change their size.
  const double finest = *std::min_element(problem_.nodes.spacings.begin(), problem_.nodes.spacings.end());
  std::vector<Vector3> fronts = sample_points(options_.way, 0, 0.5 * finest), left;
  const Nearness to_way(fronts);
  add_front(problem_.incision.get(), 0.5 * finest, left);
  for (const Vector3& place : left)
    if (to_way(place) < exchange_reach * finest)
      fronts.push_back(place);
  const Nearness to_fronts(fronts);
  std::vector<double> radii = spheres_.radii();
  std::vector<int> resized;
  for (int j = 0; enriched && j < count; ++j)
    if (to_fronts(x[j]) < front_reach * problem_.nodes.spacings[j] + finest) {
      radii[j] *= growth;
      resized.push_back(j);
    }
  const auto sees_change = [&](int i, double half) {
    return in_reach(x[i], half) || std::any_of(resized.begin(), resized.end(), [&](int j) {
             return (x[j] - x[i]).squaredNorm() < (radii[j] + half) * (radii[j] + half);
           });
  };
  std::vector<char> in_window(static_cast<std::size_t>(count), 0);
  const auto add_row = [&](int i) { // with the nodes that its faces and its support may come to see
    in_window[i] = 1;
    for (const int j : rows_[i].nodes)
      in_window[j] = 1;
    for (int k = supports_.start[i]; k < supports_.start[i + 1]; ++k)
      in_window[supports_.nodes[k]] = 1;
    for (int j = 0; j < count; ++j)
      if ((x[j] - x[i]).squaredNorm() < std::pow(cells_.reaches[i] + radii[j], 2))
        in_window[j] = 1;
  };
  std::vector<char> may_change(static_cast<std::size_t>(count), 0);
  for (int i = 0; i < count; ++i)
    if (sees_change(i, cells_.reaches[i]))
      may_change[i] = 1;
  for (const topology::CellFace& face : cells_.faces) // whose rows ask for each other's supports
    if (sees_change(face.first, 0) || sees_change(face.second, 0))
      may_change[face.first] = may_change[face.second] = 1;
  for (int i = 0; i < count; ++i)
    if (may_change[i] != 0)
      add_row(i);
  for (const int node : options_.contact)
    for (int k = supports_.start[node]; k < supports_.start[node + 1]; ++k)
      in_window[supports_.nodes[k]] = 1;
  slot_.assign(count, -1);
  origin_.resize(static_cast<std::size_t>(count));
  next_room_ = 0;
  std::vector<int> unknowns;
  for (int i = 0; i < count; ++i) {
    origin_[i] = i;
    if (in_window[i] == 0)
      continue;
    slot_[i] = next_room_++;
    for (int c = 0; c < stride_; ++c)
      unknowns.push_back(stride_ * i + c);
  }
  first_count_ = count;
  const SparseMatrix system = constrained_system();
  report_.matrix_nonzeros = system.nonZeros();
  report_.assembly_seconds += watch.seconds();
  const Stopwatch factor;
  window_ = std::make_unique<LuWindow>(system, std::move(unknowns), stride_ * options_.room);
  window_->factor();
  report_.factor_nonzeros = window_->factor_nonzeros();
  report_.factor_seconds = factor.seconds();
  if (options_.method.estimate_condition) {
    report_.condition_estimate = window_->condition_estimate();
    require_regular(report_);
  }
}

MatrixX GrowingCollocation::window_solution(const MatrixX& right) const {
  const Eigen::Index count = problem_.nodes.size();
  MatrixX far = MatrixX::Zero(stride_ * Eigen::Index{first_count_}, right.cols());
  MatrixX in_window = MatrixX::Zero(window_->slots(), right.cols());
  for (Eigen::Index i = 0; i < count; ++i)
    if (slot_[i] < 0)
      far.middleRows(stride_ * Eigen::Index{origin_[i]}, stride_) = right.middleRows(stride_ * i, stride_);
  if (!far.isZero(0))
    in_window = window_->reduce(far);
  for (Eigen::Index i = 0; i < count; ++i)
    if (slot_[i] >= 0)
      in_window.middleRows(stride_ * Eigen::Index{slot_[i]}, stride_) += right.middleRows(stride_ * i, stride_);
  in_window = window_->solve(in_window);
  far = window_->recover(in_window, far);
  MatrixX solution(stride_ * count, right.cols());
  for (Eigen::Index i = 0; i < count; ++i)
    solution.middleRows(stride_ * i, stride_) = slot_[i] >= 0
                                                    ? in_window.middleRows(stride_ * Eigen::Index{slot_[i]}, stride_)
                                                    : far.middleRows(stride_ * Eigen::Index{origin_[i]}, stride_);
  return solution;
}

/// With one correction from the rows as they are, not as the window has them, unless there are many right-hand sides.
MatrixX GrowingCollocation::solution(const MatrixX& right) const {
  constexpr Eigen::Index many = 8;
  if (right.isZero(0))
    return right;
  MatrixX found = window_solution(right);
  if (right.cols() >= many)
    return found;
  MatrixX missing = right;
  for (int i = 0; i < problem_.nodes.size(); ++i)
    visit_rows(i, [&](int c, int column, double value) { missing.row(stride_ * i + c) -= value * found.row(column); });
  if (missing.norm() > rounding * right.norm())
    found += window_solution(missing);
  return found;
}

Field GrowingCollocation::force_response(const std::vector<int>& nodes, const std::vector<Vector3>& forces) const {
  MatrixX right = MatrixX::Zero(report_.unknowns, 1);
  for (std::size_t k = 0; k < nodes.size(); ++k)
    for (int c = 0; c < 3; ++c)
      if (!constrained_[nodes[k]][c])
        right(stride_ * nodes[k] + c, 0) += forces[k][c];
  return responses_to(right).front();
}

MatrixX GrowingCollocation::contact_compliance(const std::vector<int>& candidates) const {
  const auto in_window = [&](int node) {
    for (int k = supports_.start[node]; k < supports_.start[node + 1]; ++k)
      if (slot_[supports_.nodes[k]] < 0)
        return false;
    return slot_[node] >= 0;
  };
  if (!std::all_of(candidates.begin(), candidates.end(), in_window))
    return ElasticBody::contact_compliance(candidates);
  const auto count = std::ssize(candidates);
  MatrixX right = MatrixX::Zero(window_->slots(), 3 * count);
  for (Eigen::Index c = 0; c < count; ++c)
    for (int axis = 0; axis < 3; ++axis)
      if (!constrained_[candidates[c]][axis])
        right(stride_ * slot_[candidates[c]] + axis, 3 * c + axis) = 1;
  MatrixX functionals = MatrixX::Zero(window_->slots(), 3 * count);
  for (Eigen::Index c = 0; c < count; ++c)
    for (int k = supports_.start[candidates[c]]; k < supports_.start[candidates[c] + 1]; ++k)
      for (int axis = 0; axis < 3; ++axis)
        functionals(stride_ * slot_[supports_.nodes[k]] + axis, 3 * c + axis) += supports_.value[k];
  return window_->condense(functionals, right);
}

/// Supports of the nodes marked are found again, the others get the new numbers.
NodalSupports GrowingCollocation::next_supports(const Next& next, const std::vector<char>& seen_anew) const {
  std::vector<int> found;
  for (int i = 0; i < std::ssize(seen_anew); ++i)
    if (seen_anew[i] != 0)
      found.push_back(i);
  const NodalSupports fresh = nodal_supports(*next.spheres, found);
  NodalSupports supports;
  supports.start.assign(1, 0);
  supports.worst_moment_condition = std::max(fresh.worst_moment_condition, supports_.worst_moment_condition);
  const auto append = [&](const NodalSupports& from, int row, const std::vector<int>* place) {
    for (int k = from.start[row]; k < from.start[row + 1]; ++k) {
      supports.nodes.push_back(place != nullptr ? (*place)[from.nodes[k]] : from.nodes[k]);
      supports.value.push_back(from.value[k]);
      supports.gradient.push_back(from.gradient[k]);
    }
    supports.start.push_back(static_cast<int>(supports.nodes.size()));
  };
  int next_fresh = 0;
  for (std::size_t i = 0; i < seen_anew.size(); ++i)
    if (seen_anew[i] != 0)
      append(fresh, next_fresh++, nullptr);
    else
      append(supports_, next.was[i], &next.place);
  return supports;
}

GrowingCollocation::Next GrowingCollocation::next_of(const SprinkleIncrement& change, const Problem& grown,
                                                     GrowthReport& report) const {
  const Stopwatch sphere_watch;
  Next next;
  const NodeCloud &nodes = grown.nodes, &old = problem_.nodes;
  const int count = nodes.size();
  next.place = places_after(change, old.size(), count);
  next.was.assign(count, -1);
  for (int i = 0; i < old.size(); ++i)
    if (next.place[i] >= 0)
      next.was[next.place[i]] = i;
  const double growth = options_.method.sight == SightRule::enriched ? front_radius_factor : 1;
  next.spheres.emplace(nodes.positions, nodes.spacings, rho(), Basis::linear, worst_moment_condition,
                       sight_about_cut(grown, options_.method.sight, growth));
  const std::vector<double>&radii = next.spheres->radii(), &old_radii = spheres_.radii();
  report.spheres_seconds = sphere_watch.seconds();

  // Spheres of both, those that have gone at the end; where one came, went or changed its size.
  std::vector<Vector3> centres = nodes.positions;
  std::vector<double> largest = radii;
  std::vector<std::pair<Vector3, double>> balls;
  for (int i = 0; i < count; ++i) {
    const double before = next.was[i] >= 0 ? old_radii[next.was[i]] : 0;
    largest[i] = std::max(largest[i], before);
    if (before != radii[i])
      balls.emplace_back(nodes.positions[i], largest[i]);
  }
  for (const int node : change.removed) {
    centres.push_back(old.positions[node]);
    largest.push_back(old_radii[node]);
    balls.emplace_back(old.positions[node], old_radii[node]);
  }
  const double slack = 0.25 * *std::min_element(nodes.spacings.begin(), nodes.spacings.end());
  const topology::Incision* const before = problem_.incision.get();
  const Changes changes =
      changes_between(before, SpacingAt(old, std::vector<char>(old.positions.size(), 0)), *grown.incision,
                      SpacingAt(nodes, std::vector<char>(nodes.positions.size(), 0)), 2 * slack);
  std::vector<Vector3> all_front = changes.front;
  add_front(before, 2 * slack, all_front);
  add_front(grown.incision.get(), 2 * slack, all_front);
  const double enriched = options_.method.sight == SightRule::enriched ? next.spheres->cut()->sight().reach / rho() : 0;
  const Reach reach(changes.faces, changes.front, all_front, enriched, centres, largest, slack);
  const auto sees_change = [&](const Vector3& x, double half) {
    return reach.sees(x, half) || reach.near_front(x, half, std::max(1.0, enriched)) ||
           std::any_of(balls.begin(), balls.end(), [&](const auto& ball) {
             const double far = ball.second + half;
             return (ball.first - x).squaredNorm() < far * far;
           });
  };

  const Stopwatch cell_watch;
  next.places = changes.faces;
  next.places.insert(next.places.end(), changes.front.begin(), changes.front.end());
  const Nearness to_places(next.places);
  std::vector<char> touched(static_cast<std::size_t>(count), 1);
  for (int i = 0; i < count; ++i)
    if (next.was[i] >= 0)
      touched[i] =
          to_places(nodes.positions[i]) < cells_see * cells_.reaches[next.was[i]] + lifted * nodes.spacings[i] + slack;
  next.cells = topology::update_cells(cells_, next.was, nodes.positions, nodes.spacings, *grown.domain,
                                      grown.incision.get(), touched);

  const topology::CellComplex& cells = next.cells.cells;
  std::vector<char> seen_anew(static_cast<std::size_t>(count), 0);
  next.wanted = next.cells.made;
  for (int i = 0; i < count; ++i) {
    const double half = std::max(cells.reaches[i], next.was[i] >= 0 ? cells_.reaches[next.was[i]] : 0);
    if (next.was[i] < 0 || sees_change(nodes.positions[i], 0))
      seen_anew[i] = 1;
    if (seen_anew[i] != 0 || sees_change(nodes.positions[i], half))
      next.wanted[i] = 1;
  }
  for (const topology::CellFace& face : cells.faces) // whose rows ask for each other's supports
    if (seen_anew[face.first] != 0 || seen_anew[face.second] != 0)
      next.wanted[face.first] = next.wanted[face.second] = 1;
  next.supports = next_supports(next, seen_anew);
  assemble_rows(grown, cells, *next.spheres, next.supports, mixed_, next.wanted, next.rows);
  for (const Anchor& anchor : anchors_)
    if (const int node = next.place[anchor.node]; node >= 0 && next.wanted[node] != 0)
      next.rows[node].blocks.front().topLeftCorner<3, 3>() += anchor_stiffness(anchor);
  next.constrained.assign(nodes.positions.size(), {false, false, false});
  for (const Prescribed& entry : grown.prescribed)
    for (int c = 0; c < 3; ++c)
      next.constrained[entry.node][c] = next.constrained[entry.node][c] || entry.components[c];
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

void GrowingCollocation::write_rows(const std::vector<char>& changed) {
  for (int i = 0; i < problem_.nodes.size(); ++i) {
    if (changed[i] == 0)
      continue;
    for (int c = 0; c < stride_; ++c)
      window_->clear_row(stride_ * slot_[i] + c);
    visit_rows(i, [&](int c, int column, double value) {
      window_->add(stride_ * slot_[i] + c, stride_ * slot_[column / stride_] + column % stride_, value);
    });
  }
}

bool GrowingCollocation::factor_window(const std::vector<Vector3>& places) {
  // How far this increment went from the last one: the next are expected to be no longer.
  double step = 0;
  if (!last_places_.empty()) {
    const Nearness to_last(last_places_);
    for (const Vector3& place : places)
      step = std::max(step, to_last(place));
  }
  last_places_ = places;
  if (window_->is_prepared()) {
    window_->factor();
    return true;
  }
  const Nearness to_places(places);
  std::vector<double> distance(problem_.nodes.positions.size());
  double reach = 0;
  for (std::size_t i = 0; i < distance.size(); ++i) {
    distance[i] = to_places(problem_.nodes.positions[i]);
    if (slot_[i] >= 0 && window_->changed(stride_ * slot_[i]))
      reach = std::max(reach, distance[i]);
  }
  const double finest = *std::min_element(problem_.nodes.spacings.begin(), problem_.nodes.spacings.end());
  const double ahead = std::max(advance_before_new * finest, increments_before_new * step);
  std::vector<char> kept(static_cast<std::size_t>(window_->slots()), 0);
  for (std::size_t i = 0; i < distance.size(); ++i)
    if (slot_[i] >= 0 && distance[i] <= reach + ahead)
      std::fill_n(kept.begin() + static_cast<std::ptrdiff_t>(stride_) * slot_[i], stride_, 1);
  window_->prepare(kept);
  return false;
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
  loads_ = cell_loads(cells_, problem_, stress_of(problem_.loads.initial_strain));
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

BodyGrowth GrowingCollocation::grow(const SprinkleIncrement& change, Problem grown,
                                    const std::function<topology::SurfaceMesh()>& way_ahead, bool only_update) {
  const Stopwatch total;
  if (grown.incision == nullptr)
    throw InputError("a growing cut needs an incision");
  check_problem(grown);
  BodyGrowth growth;
  GrowthReport& report = growth.update;
  const std::vector<int> place = places_after(change, problem_.nodes.size(), grown.nodes.size());
  std::vector<Piece> pieces = pieces_by_sight(grown);
  if (unheld_count(pieces) > unheld_count(report_.pieces)) {
    growth.uncovered = "a piece came free";
    return growth;
  }
  for (const Anchor& anchor : anchors_)
    if (place[anchor.node] < 0) {
      growth.uncovered = "a spring that holds a severed piece lost its node";
      return growth;
    }
  const auto anew = [&](const char* reason, Problem problem, bool is_overwritten) {
    report.reason = reason;
    if (only_update && !is_overwritten) {
      report.declined = true;
      growth.uncovered = reason;
      return;
    }
    GrowthOptions options = options_;
    if (!is_overwritten) {
      std::erase_if(options.contact, [&](int& node) { return (node = place[node]) < 0; });
      if (way_ahead)
        if (topology::SurfaceMesh way = way_ahead(); !way.triangles.empty())
          options.way = std::move(way);
    }
    GrowingCollocation fresh(std::move(problem), std::move(options));
    take_over(fresh);
    report.condensed_anew = true;
    report.window_nodes = window_->slots() / stride_ - options_.room;
  };
  const auto finish = [&] {
    if (!report.condensed_anew && !report.declined) {
      report_.supports_seconds = report.spheres_seconds;
      report_.assembly_seconds = report.cells_seconds;
      report_.factor_seconds = report.factor_seconds;
      report_.pieces = std::move(pieces);
    }
    report.total_seconds = total.seconds();
    return growth;
  };
  if (!continues(problem_.incision.get(), *grown.incision)) {
    anew("the sheets do not continue those before", std::move(grown), false);
    return finish();
  }
  if (stride_ * (next_room_ + change.added.size()) > window_->slots()) {
    anew("no room for the added nodes", std::move(grown), false);
    return finish();
  }
  Next next = next_of(change, grown, report);
  std::vector<int> slot(next.was.size());
  for (std::size_t i = 0, added = 0; i < slot.size(); ++i)
    slot[i] = next.was[i] >= 0 ? slot_[next.was[i]] : next_room_ + static_cast<int>(added++);
  const char* const outside = [&] {
    for (const int node : change.removed)
      if (slot_[node] < 0)
        return "a removed node lies outside the window";
    return hindrance(next, slot);
  }();
  if (outside[0] != '\0') {
    anew(outside, std::move(grown), false);
    return finish();
  }
  const Stopwatch commit_watch;
  Problem before = problem_;
  std::erase_if(options_.contact, [&](int& node) { return (node = place[node]) < 0; });
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
      anew("the window became singular", problem_, true);
    } catch (...) {
      options_.contact.clear();
      anew("as it was", std::move(before), true);
      throw;
    }
  }
  report.factor_seconds = factor_watch.seconds();
  report.factored = window_->factored();
  report.window_nodes = (window_->factored() + window_->done_ahead()) / stride_;
  return finish();
}

} // namespace

std::unique_ptr<Discretisation> make_growable(Problem problem, GrowthOptions options) {
  if (options.method.method == Method::collocation) {
    require_domain(problem);
    return std::make_unique<GrowingCollocation>(std::move(problem), std::move(options));
  }
  return std::make_unique<GrowingBody>(std::move(problem), std::move(options));
}

} // namespace spherecut::solvers
