// The window of a body of method `collocation` that follows its cut: what it holds, factoring it, solving with it.
#include "solvers/cut/growing_collocation.hpp"
#include "solvers/shapes/cut_reach.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

constexpr double rounding = 1e-12;            // of the right-hand side: a smaller residual is not corrected
constexpr double increments_before_new = 2.2; // as advance_before_new, in increments where those are long

} // namespace

GrowingCollocation::GrowingCollocation(Problem problem, GrowthOptions options)
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

/// Nodes whose rows the cut may change on its way, or that such rows may come to see; and those of the contact.
std::vector<char> GrowingCollocation::predicted_window() const {
  const int count = problem_.nodes.size();
  const std::vector<Vector3>& x = problem_.nodes.positions;
  const bool enriched = options_.method.sight == SightRule::enriched;
  const Sight sight = sight_about_cut(problem_, Method::collocation, options_.method.sight);
  const double front_reach = enriched ? sight.reach : 0; // in spacings
  const ReachAlong in_reach(options_.way, problem_.incision.get(), problem_.nodes, std::vector<char>(count, 0),
                            spheres_.radii(), front_reach / rho(), sight.radius_factor, true);
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
      radii[j] *= sight.radius_factor;
      resized.push_back(j);
    }
  const auto sees_change = [&](int i, double half) {
    return in_reach(x[i], half) || std::any_of(resized.begin(), resized.end(), [&](int j) {
             return (x[j] - x[i]).squaredNorm() < (radii[j] + half) * (radii[j] + half);
           });
  };
  std::vector<char> may_change(static_cast<std::size_t>(count), 0);
  for (int i = 0; i < count; ++i)
    if (sees_change(i, cells_.reaches[i]))
      may_change[i] = 1;
  for (const topology::CellFace& face : cells_.faces) // whose rows ask for each other's supports
    if (sees_change(face.first, 0) || sees_change(face.second, 0))
      may_change[face.first] = may_change[face.second] = 1;
  std::vector<char> in_window(static_cast<std::size_t>(count), 0);
  const auto add_support = [&](int i) {
    for (int k = supports_.start[i]; k < supports_.start[i + 1]; ++k)
      in_window[supports_.nodes[k]] = 1;
  };
  for (int i = 0; i < count; ++i) {
    if (may_change[i] == 0)
      continue;
    // With the nodes that its faces and its support may come to see.
    in_window[i] = 1;
    for (const int j : rows_[i].nodes)
      in_window[j] = 1;
    add_support(i);
    for (int j = 0; j < count; ++j)
      if ((x[j] - x[i]).squaredNorm() < std::pow(cells_.reaches[i] + radii[j], 2))
        in_window[j] = 1;
  }
  for (const int node : options_.contact)
    add_support(node);
  return in_window;
}

void GrowingCollocation::make_window() {
  const Stopwatch watch;
  const int count = problem_.nodes.size();
  const std::vector<char> in_window = predicted_window();
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
  window_ = std::make_unique<LuWindow>(system, std::move(unknowns), stride_ * options_.room, elimination_order());
  graph_ = {};
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

bool GrowingCollocation::in_window(const std::vector<int>& nodes) const {
  return std::all_of(nodes.begin(), nodes.end(), [&](int node) {
    for (int k = supports_.start[node]; k < supports_.start[node + 1]; ++k)
      if (slot_[supports_.nodes[k]] < 0)
        return false;
    return slot_[node] >= 0;
  });
}

bool GrowingCollocation::loads_in_window(const std::vector<int>& nodes) const {
  for (const std::vector<CellShare>& cells : loaded_cells(nodes))
    for (const CellShare& share : cells)
      if (slot_[share.cell] < 0)
        return false;
  return true;
}

MatrixX GrowingCollocation::unit_forces(const std::vector<int>& nodes) const {
  MatrixX right = MatrixX::Zero(window_->slots(), 3 * std::ssize(nodes));
  const auto cells = loaded_cells(nodes);
  for (Eigen::Index c = 0; c < std::ssize(nodes); ++c)
    for (const CellShare& share : cells[c])
      for (int axis = 0; axis < 3; ++axis)
        if (!constrained_[share.cell][axis])
          right(stride_ * slot_[share.cell] + axis, 3 * c + axis) += share.part;
  return right;
}

MatrixX GrowingCollocation::contact_compliance(const std::vector<int>& candidates) const {
  if (!in_window(candidates) || !loads_in_window(candidates))
    return ElasticBody::contact_compliance(candidates);
  const auto count = std::ssize(candidates);
  MatrixX functionals = MatrixX::Zero(window_->slots(), 3 * count);
  for (Eigen::Index c = 0; c < count; ++c)
    for (int k = supports_.start[candidates[c]]; k < supports_.start[candidates[c] + 1]; ++k)
      for (int axis = 0; axis < 3; ++axis)
        functionals(stride_ * slot_[supports_.nodes[k]] + axis, 3 * c + axis) += supports_.value[k];
  return window_->condense(functionals, unit_forces(candidates));
}

MatrixX GrowingCollocation::compliance_between(const std::vector<int>& at, const std::vector<int>& forced) const {
  if (!in_window(at) || !in_window(forced) || !loads_in_window(forced))
    return ElasticBody::compliance_between(at, forced);
  const MatrixX solved = window_->solve(unit_forces(forced));
  MatrixX compliance = MatrixX::Zero(3 * std::ssize(at), solved.cols());
  for (Eigen::Index c = 0; c < std::ssize(at); ++c)
    for (int k = supports_.start[at[c]]; k < supports_.start[at[c] + 1]; ++k)
      compliance.middleRows<3>(3 * c) +=
          supports_.value[k] * solved.middleRows<3>(Eigen::Index{stride_} * slot_[supports_.nodes[k]]);
  return compliance;
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

} // namespace spherecut::solvers
