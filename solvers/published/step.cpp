#include "solvers/published/step.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::solvers {

namespace {

constexpr double worst_condition = 1e9;
constexpr double worst_pivot_ratio = 1e12; // equal rows leave a pivot of the size of rounding, not zero
constexpr double tip_growth = 1.25;
constexpr int tip_growth_steps = 4;
constexpr int fewest_step_nodes = 6, most_step_nodes = 500;

int checked_count(int nodes, const Material& material, double rho) {
  material.check();
  if (nodes < fewest_step_nodes || nodes > most_step_nodes)
    throw InputError(
        fmt::format("published step: {} nodes; it takes {} to {}", nodes, fewest_step_nodes, most_step_nodes));
  if (!(rho > 0) || !std::isfinite(rho))
    throw InputError(fmt::format("published step: support radius of {} spacings; it must be positive", rho));
  return nodes;
}

bool is_inside(const NodeCloud& nodes, int node) {
  return nodes.kinds[node] == NodeKind::interior;
}

} // namespace

PublishedStep::PublishedStep(int nodes, const Material& material, double rho)
    : count_(checked_count(nodes, material, rho)), blocks_((nodes + SphereGrid::lanes - 1) / SphereGrid::lanes),
      material_(material), rho_(rho), spheres_(4 * static_cast<std::size_t>(blocks_)),
      ids_(static_cast<std::size_t>(blocks_) * SphereGrid::lanes, nodes - 1), system_(3 * (nodes - 1), 3) {
  for (int j = 0; j < count_; ++j)
    ids_[j] = j;
  const std::size_t room = ids_.size() + 2 * SphereGrid::lanes;
  support_memory_.resize(4 * room);
  support_ids_.resize(room);
  shape_.nodes.reserve(room);
  for (std::vector<double>* array : {&shape_.value, &shape_.dx, &shape_.dy, &shape_.dz, &shape_.dxx, &shape_.dyy,
                                     &shape_.dzz, &shape_.dxy, &shape_.dxz, &shape_.dyz})
    array->reserve(room);
}

bool PublishedStep::evaluate_node(const Vector3& x) noexcept {
  const shape_kernel::Kernel& kernel = shape_kernel::dispatched();
  const std::size_t room = support_ids_.size();
  double* memory = support_memory_.data();
  shape_kernel::Support support{0, support_ids_.data(), memory, memory + room, memory + 2 * room, memory + 3 * room};
  const SphereGrid::Cell cell{{ids_.data(), static_cast<std::size_t>(count_)},
                              spheres_[0].data(),
                              spheres_[blocks_].data(),
                              spheres_[2 * blocks_].data(),
                              spheres_[3 * blocks_].data(),
                              blocks_ * SphereGrid::lanes};
  double shrink = 1; // of the inverse square radii
  for (int step = 0;; ++step) {
    kernel.collect(cell, x.data(), support);
    if (shape_kernel::evaluate_support(kernel, support, Basis::linear, true, worst_condition, shape_))
      break;
    if (step == tip_growth_steps)
      return false;
    shrink /= tip_growth * tip_growth;
    for (int b = 3 * blocks_; b < 4 * blocks_; ++b)
      for (double& q : spheres_[b])
        q /= tip_growth * tip_growth;
  }
  if (shrink < 1)
    for (int b = 3 * blocks_; b < 4 * blocks_; ++b)
      for (double& q : spheres_[b])
        q /= shrink;
  return true;
}

Matrix3 PublishedStep::block(const NodeCloud& nodes, int node, int k) const noexcept {
  return is_inside(nodes, node) ? equilibrium_block(shape_, k, material_)
                                : traction_block(shape_, k, nodes.normals[node], material_);
}

// Three rows of the system for a node other than the tip, scaled as in published.cpp.
void PublishedStep::write_rows(const NodeCloud& nodes, int node, bool held, int tip) noexcept {
  const int first = 3 * (node < tip ? node : node - 1), right = 3 * (count_ - 1);
  const double h = nodes.spacings[node];
  const double scale = (is_inside(nodes, node) ? h * h : h) / material_.shear_modulus();
  double* rows[3] = {system_.row(first), system_.row(first + 1), system_.row(first + 2)};
  for (int k = 0; k < shape_.size(); ++k) {
    const int j = shape_.nodes[k];
    const bool at_tip = j == tip;
    const int column = at_tip ? right : 3 * (j < tip ? j : j - 1);
    const double sign = at_tip ? -1 : 1;
    if (held) {
      for (int a = 0; a < 3; ++a)
        rows[a][column + a] = sign * shape_.value[k];
      continue;
    }
    const Matrix3 coefficient = sign * scale * block(nodes, node, k);
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        rows[a][column + b] = coefficient(a, b);
  }
}

PublishedStepResult PublishedStep::step(const NodeCloud& nodes, std::span<const char> held, int tip,
                                        const Vector3& displacement) noexcept {
  PublishedStepResult result;
  const auto count = static_cast<std::size_t>(count_);
  if (nodes.positions.size() != count || nodes.spacings.size() != count || nodes.kinds.size() != count ||
      nodes.normals.size() != count || held.size() != count || tip < 0 || tip >= count_)
    return result;
  tip_ = tip;
  for (int j = 0; j < blocks_ * SphereGrid::lanes; ++j) {
    const int b = j / SphereGrid::lanes, l = j % SphereGrid::lanes, node = std::min(j, count_ - 1);
    for (int a = 0; a < 3; ++a)
      spheres_[a * blocks_ + b][l] = nodes.positions[node][a];
    const double radius = rho_ * nodes.spacings[node];
    spheres_[3 * blocks_ + b][l] = j < count_ ? 1 / (radius * radius) : std::numeric_limits<double>::infinity();
  }

  system_.clear();
  for (int i = 0; i <= count_; ++i) {
    // The tip comes last: its rows are what the solution is put into.
    const int node = i == count_ ? tip : i;
    if (i == tip)
      continue;
    if (!evaluate_node(nodes.positions[node])) {
      result.status = StepStatus::unsound_support;
      result.node = node;
      return result;
    }
    result.worst_moment_condition = std::max(result.worst_moment_condition, shape_.moment_condition);
    if (node != tip)
      write_rows(nodes, node, held[node] != 0, tip);
  }

  const EliminationResult elimination = system_.solve();
  result.pivot_ratio = elimination.pivot_ratio;
  Matrix3 rows = Matrix3::Zero(); // K_aa + K_ab X
  for (int k = 0; k < shape_.size(); ++k) {
    Matrix3 moved;
    for (int axis = 0; axis < 3; ++axis)
      moved.col(axis) = response(shape_.nodes[k], axis);
    rows += block(nodes, tip, k) * moved;
  }
  const double h = nodes.spacings[tip];
  result.stiffness = (is_inside(nodes, tip) ? -h * h * h : h * h) * rows;
  result.force = result.stiffness * displacement;
  const bool regular = elimination.regular && elimination.pivot_ratio < worst_pivot_ratio && result.force.allFinite();
  result.status = regular ? StepStatus::solved : StepStatus::singular;
  return result;
}

Vector3 PublishedStep::response(int node, int axis) const noexcept {
  if (node == tip_)
    return Vector3::Unit(axis);
  const int first = 3 * (node < tip_ ? node : node - 1);
  return {system_.solution(first, axis), system_.solution(first + 1, axis), system_.solution(first + 2, axis)};
}

} // namespace spherecut::solvers
