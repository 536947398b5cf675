// What holds a cut body: the penalties of held shares with what the cut appends, and the multipliers of shares that it
// parts.
#include "solvers/appended/cut_system.hpp"

#include "solvers/algebra/dense_cholesky.hpp"
#include "solvers/algebra/dense_products.hpp"
#include "solvers/galerkin/galerkin.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::solvers {

namespace {

Matrix3 held_components(const Prescribed& entry) {
  Vector3 held;
  for (int c = 0; c < 3; ++c)
    held[c] = entry.components[c] ? 1 : 0;
  return held.asDiagonal();
}

} // namespace

void CutSystem::add_held(int first_new, const CutSpace::Change& change) {
  const Problem& problem = uncut_.problem();
  held_.resize(uncut_.held().size());
  std::vector<char> carries(uncut_.size(), 0), news(uncut_.size(), 0); // some function; one that is new or has gone
  const auto mark = [](const std::vector<int>& nodes, std::vector<char>& at) {
    for (const int node : nodes)
      at[node] = 1;
  };
  std::vector<int> place_now(carriers_.size(), -1); // of functions before
  for (std::size_t k = 0; k < change.kept.size(); ++k)
    place_now[change.kept[k]] = static_cast<int>(k);
  for (std::size_t k = 0; k < carriers_.size(); ++k)
    if (place_now[k] < 0)
      mark(carriers_[k], news);
  carriers_.clear();
  for (int k = 0; k < functions(); ++k) {
    const CutFunction& function = space_->functions()[k];
    carriers_.push_back(function.is_front ? function.group.nodes : std::vector<int>{function.twin.node});
    mark(carriers_.back(), carries);
    if (k >= first_new)
      mark(carriers_.back(), news);
  }
  held_touched_.resize(held_.size(), 0);
  for (std::size_t p = 0; p < held_.size(); ++p) {
    const DisplacementMean& mean = uncut_.held()[p];
    const char touched =
        std::any_of(mean.nodes.begin(), mean.nodes.end(), [&](int node) { return carries[node] != 0; });
    const bool is_news = touched != held_touched_[p] ||
                         std::any_of(mean.nodes.begin(), mean.nodes.end(), [&](int node) { return news[node] != 0; });
    held_touched_[p] = touched;
    CutFunctional& held = held_[p];
    if (touched != 0 && !is_news) { // the same functions under new numbers
      for (auto& [function, matrix] : held.cut)
        function = place_now[function];
      continue;
    }
    if (held_touched_[p] == 0) {
      held.cut.clear();
      if (held.base.empty())
        for (std::size_t k = 0; k < mean.nodes.size(); ++k)
          held.base.emplace_back(mean.nodes[k], mean.weights[k]);
      continue;
    }
    held = mean_over(mean.share, Faint::kept);
    held.base.clear(); // as the uncut body has it, whose penalty is in K0
    for (std::size_t k = 0; k < mean.nodes.size(); ++k)
      held.base.emplace_back(mean.nodes[k], mean.weights[k]);
    const Prescribed& entry = problem.prescribed[p];
    const double stiffness = constraint_stiffness(problem, entry.node);
    const Matrix3 components = held_components(entry);
    for (const auto& [function, matrix] : held.cut) {
      if (function < first_new)
        continue;
      const Matrix3 pulled = stiffness * components * matrix;
      for (const auto& [node, weight] : held.base)
        data_[function].penalty.emplace_back(node, weight * pulled);
      for (const auto& [other, there] : held.cut) {
        if (other > function)
          continue;
        const Matrix3 block = there.transpose() * pulled;
        penalty_.block<3, 3>(3 * static_cast<Eigen::Index>(other), 3 * static_cast<Eigen::Index>(function)) += block;
        if (other != function)
          penalty_.block<3, 3>(3 * static_cast<Eigen::Index>(function), 3 * static_cast<Eigen::Index>(other)) +=
              block.transpose();
      }
    }
  }
}

// Shares of the held surface whose points the cut hides from one another.
void CutSystem::part_held_shares() {
  parted_.clear();
  const topology::Incision* incision = space_->incision();
  if (incision == nullptr)
    return;
  for (std::size_t p = 0; p < held_.size(); ++p) {
    if (held_touched_[p] == 0)
      continue;
    std::vector<std::vector<QuadraturePoint>> groups;
    std::vector<double> weights;
    for (const QuadraturePoint& point : uncut_.held()[p].share) {
      std::size_t g = 0;
      while (g < groups.size() && incision->blocks(groups[g].front().position, point.position))
        ++g;
      if (g == groups.size()) {
        groups.emplace_back();
        weights.push_back(0);
      }
      groups[g].push_back(point);
      weights[g] += point.weight;
    }
    double behind = 0;
    for (std::size_t g = groups.size(); g-- > 0;) {
      const double whole = weights[g];
      if (g + 1 < groups.size()) {
        PartedShare parted;
        parted.entry = static_cast<int>(p);
        const Prescribed& entry = uncut_.problem().prescribed[p];
        parted.stiffness = constraint_stiffness(uncut_.problem(), entry.node) * whole * behind / (whole + behind);
        for (QuadraturePoint point : groups[g]) {
          point.weight /= whole;
          parted.first.push_back(point);
        }
        for (std::size_t later = g + 1; later < groups.size(); ++later)
          for (QuadraturePoint point : groups[later]) {
            point.weight /= behind;
            parted.second.push_back(point);
          }
        std::vector<QuadraturePoint> both = parted.first;
        for (QuadraturePoint point : parted.second) {
          point.weight = -point.weight;
          both.push_back(point);
        }
        parted.difference = mean_over(both, Faint::kept);
        const Matrix3 components = held_components(entry);
        for (auto& [function, matrix] : parted.difference.cut)
          matrix = components * matrix;
        parted_.push_back(std::move(parted));
      }
      behind += whole;
    }
  }
}

void CutSystem::solve_multipliers() {
  const Eigen::Index count = 3 * std::ssize(parted_);
  parted_half_.resize(3 * uncut_.size(), count);
  parted_schur_.resize(schur_.rows(), count);
  parted_lower_.resize(count, count);
  if (count == 0)
    return;
  MatrixX base = MatrixX::Zero(3 * uncut_.size(), count), cut = MatrixX::Zero(schur_.rows(), count),
          left = MatrixX::Zero(count, count);
  for (Eigen::Index a = 0; a < std::ssize(parted_); ++a) {
    const PartedShare& parted = parted_[a];
    const Matrix3 components = held_components(uncut_.problem().prescribed[parted.entry]);
    for (const auto& [node, weight] : parted.difference.base)
      base.block<3, 3>(3 * static_cast<Eigen::Index>(uncut_.rank()[node]), 3 * a) += weight * components;
    for (const auto& [function, matrix] : parted.difference.cut)
      cut.block<3, 3>(3 * static_cast<Eigen::Index>(function), 3 * a) += matrix.transpose();
    left.diagonal().segment<3>(3 * a).setConstant(1 / parted.stiffness);
  }
  parted_half_ = uncut_.factor().forward_sparse(base);
  add_transposed_product(-1, half_.data(), static_cast<int>(half_.rows()), parted_half_, cut);
  triangular_solve(false, lower_.data(), static_cast<int>(lower_.rows()), cut);
  parted_schur_ = cut;
  left += gram(parted_half_) + gram(parted_schur_);
  if (factor_lower(left) >= 0)
    throw NumericalError(
        fmt::format("the parted shares of the held surface contradict one another ({} of them)", parted_.size()));
  parted_lower_ = std::move(left);
}

VectorX CutSystem::parted_values(const std::function<Vector3(const Vector3&)>& field) const {
  VectorX values = VectorX::Zero(3 * std::ssize(parted_));
  for (Eigen::Index k = 0; k < std::ssize(parted_); ++k) {
    Vector3 value = Vector3::Zero();
    for (const QuadraturePoint& point : parted_[k].first)
      value += point.weight * field(point.position);
    for (const QuadraturePoint& point : parted_[k].second)
      value -= point.weight * field(point.position);
    values.segment<3>(3 * k) = held_components(uncut_.problem().prescribed[parted_[k].entry]) * value;
  }
  return values;
}

void CutSystem::subtract_holding(const VectorX& base, const VectorX& cut, const VectorX& prescribed,
                                 const std::function<Vector3(const Vector3&)>& field, CutVectors& rows) const {
  const Problem& problem = uncut_.problem();
  for (std::size_t p = 0; p < held_.size(); ++p) {
    const Prescribed& entry = problem.prescribed[p];
    const Vector3 gap = prescribed.segment<3>(3 * static_cast<Eigen::Index>(p)) - value(held_[p], base, cut);
    add_force(held_[p], -constraint_stiffness(problem, entry.node) * (held_components(entry) * gap), 0, rows);
  }
  rows.cut.col(0) += springs_ * (springs_.transpose() * cut);
  const VectorX parted = field ? parted_values(field) : VectorX::Zero(3 * std::ssize(parted_));
  for (Eigen::Index k = 0; k < std::ssize(parted_); ++k) {
    const Matrix3 components = held_components(problem.prescribed[parted_[k].entry]);
    const Vector3 gap = parted.segment<3>(3 * k) - components * value(parted_[k].difference, base, cut);
    add_force(parted_[k].difference, -parted_[k].stiffness * gap, 0, rows);
  }
}

} // namespace spherecut::solvers
