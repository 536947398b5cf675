#include "experiments/remeshing_ledger/sub_structure.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::experiments::ledger {

namespace {

/// A dense block of b unknowns takes b^3 / 3 multiplications, the whole body of n about 16 n^2 (measured on quadratic
/// tetrahedra of 10 000 to 25 000 unknowns): beyond a quarter of that the block costs more than it saves.
bool is_worth_a_block(double between, double free) {
  return between * between * between / 3 < 0.25 * 16 * free * free;
}

/// By node: whether an element that is near, or one that is far, has it.
struct Sides {
  std::vector<char> by_near, by_far;
};
Sides sides_of(const FemNodes& nodes, const std::vector<char>& near) {
  Sides sides{std::vector<char>(nodes.positions.size(), 0), std::vector<char>(nodes.positions.size(), 0)};
  for (std::size_t e = 0; e < nodes.elements.size(); ++e)
    for (int k = 0; k < nodes.per_element(); ++k)
      (near[e] != 0 ? sides.by_near : sides.by_far)[nodes.elements[e][k]] = 1;
  return sides;
}

/// Adds the loads of the nodes whose place is below `count`.
void add_loads(const VectorX& loads, const std::vector<int>& place, int count, VectorX& right) {
  for (std::size_t i = 0; i < place.size(); ++i)
    if (place[i] >= 0 && place[i] < count)
      right.segment<3>(3 * static_cast<Eigen::Index>(place[i])) += loads.segment<3>(3 * static_cast<Eigen::Index>(i));
}

} // namespace

std::vector<NodeKey> node_keys(const CutMesh& mesh, const FemNodes& nodes) {
  constexpr std::uint64_t none = 0xffffffffU;
  std::uint64_t whole = 0; // vertices of the mesh before it was parted
  for (std::size_t i = 0; i < mesh.original.size() && mesh.original[i] == static_cast<int>(i); ++i)
    ++whole;
  std::vector<NodeKey> keys;
  keys.reserve(nodes.positions.size());
  for (std::size_t i = 0; i < mesh.original.size(); ++i)
    keys.push_back(2 * static_cast<std::uint64_t>(mesh.original[i]) + (i < whole ? 0 : 1));
  for (const FemNodes::EdgeNode& edge : nodes.edges)
    keys.push_back((std::min(keys[edge.from], keys[edge.to]) << 32) | std::max(keys[edge.from], keys[edge.to]));
  for (std::size_t i = 0; i < mesh.original.size(); ++i)
    keys[i] = (keys[i] << 32) | none;
  return keys;
}

void SubStructure::condense(const FemNodes& nodes, const Scenario& scenario, std::vector<char> near,
                            StageTimes& times) {
  {
    const StageClock clock(times, Stage::factorisation); // the order of elimination
    near_ = std::move(near);
    Sides sides = sides_of(nodes, near_);
    std::ptrdiff_t free = 0, between = 0, beyond = 0;
    for (std::size_t i = 0; i < sides.by_near.size(); ++i)
      if (nodes.held[i] == 0 && (sides.by_near[i] != 0 || sides.by_far[i] != 0)) {
        ++free;
        between += sides.by_near[i] != 0 && sides.by_far[i] != 0 ? 1 : 0;
        beyond += sides.by_near[i] == 0 ? 1 : 0;
      }
    if (!is_worth_a_block(3.0 * static_cast<double>(between), 3.0 * static_cast<double>(free)) || beyond < between) {
      near_.assign(near_.size(), 1);
      sides = sides_of(nodes, near_);
    }
    far_place_ = elimination_places(nodes, far_count_, sides.by_near);
    near_place_ = elimination_places(nodes, near_count_, sides.by_far);
    between_count_ = 0;
    for (std::size_t i = 0; i < near_place_.size(); ++i)
      if (sides.by_near[i] != 0 && sides.by_far[i] != 0 && nodes.held[i] == 0) {
        far_place_[i] = far_count_ + between_count_;
        near_place_[i] = near_count_ + between_count_;
        ++between_count_;
      }
  }
  far_.reset();
  far_key_.clear();
  if (far_count_ + between_count_ == 0)
    return;
  FemSystem system;
  {
    const StageClock clock(times, Stage::assembly);
    std::vector<char> is_far(near_.size());
    for (std::size_t e = 0; e < near_.size(); ++e)
      is_far[e] = near_[e] == 0 ? 1 : 0;
    system = assemble(nodes, scenario.material, far_place_, far_count_ + between_count_, is_far);
    add_loads(face_loads(nodes, scenario), far_place_, far_count_, system.right);
  }
  const StageClock clock(times, Stage::factorisation);
  far_ = solvers::factor_ordered(system.lower);
  const Eigen::Index between = 3 * static_cast<Eigen::Index>(between_count_);
  root_ = far_->trailing(static_cast<int>(between));
  schur_.noalias() = root_.triangularView<Eigen::Lower>() * root_.transpose();
  halfway_ = far_->forward(system.right);
  reduced_ = root_.triangularView<Eigen::Lower>() * halfway_.bottomRows(between);
}

void SubStructure::remember(const std::vector<NodeKey>& keys) {
  far_key_.clear();
  for (std::size_t i = 0; i < far_place_.size(); ++i)
    if (far_place_[i] >= 0)
      far_key_.emplace(keys[i], far_place_[i]);
}

void SubStructure::renew(const FemNodes& nodes, const std::vector<NodeKey>& keys, std::vector<char> near,
                         StageTimes& times) {
  const StageClock clock(times, Stage::factorisation);
  near_ = std::move(near);
  if (far_ == nullptr)
    near_.assign(near_.size(), 1);
  const Sides sides = sides_of(nodes, near_);
  near_place_ = elimination_places(nodes, near_count_, sides.by_far);
  far_place_.assign(nodes.positions.size(), -1);
  int found = 0;
  for (std::size_t i = 0; i < far_place_.size(); ++i) {
    if (sides.by_far[i] == 0 || nodes.held[i] != 0)
      continue;
    const auto entry = far_key_.find(keys[i]);
    if (entry == far_key_.end() || (entry->second >= far_count_) != (sides.by_near[i] != 0))
      throw NumericalError(fmt::format("node {} of the far part is not one of those that were condensed", i));
    far_place_[i] = entry->second;
    if (entry->second >= far_count_)
      near_place_[i] = near_count_ + entry->second - far_count_;
    ++found;
  }
  if (found != far_count_ + between_count_)
    throw NumericalError(
        fmt::format("{} nodes of the far part where {} were condensed", found, far_count_ + between_count_));
}

const VectorX& SubStructure::solve(const FemNodes& nodes, const Scenario& scenario, bool strict, StageTimes& times) {
  FemSystem system;
  {
    const StageClock clock(times, Stage::assembly);
    system = assemble(nodes, scenario.material, near_place_, near_count_ + between_count_, near_);
    if (system.folded > 0 && strict)
      throw NumericalError(fmt::format("{} elements fold over", system.folded));
    add_loads(face_loads(nodes, scenario), near_place_, near_count_ + between_count_, system.right);
    if (between_count_ > 0) {
      system.right.tail(3 * static_cast<Eigen::Index>(between_count_)) += reduced_;
      add_dense(system.lower);
    }
  }
  {
    const StageClock clock(times, Stage::factorisation);
    near_factor_ = solvers::factor_ordered(system.lower);
  }
  {
    const StageClock clock(times, Stage::solve);
    recover(nodes, system.right);
  }
  near_norm_ = solvers::one_norm(system.lower, true);
  return displacement_;
}

double SubStructure::condition() const {
  return solvers::condition_estimate(*near_factor_, near_norm_, 3 * (near_count_ + between_count_));
}

void SubStructure::recover(const FemNodes& nodes, const VectorX& right) {
  const Eigen::Index between = 3 * static_cast<Eigen::Index>(between_count_);
  const VectorX x = near_factor_->solve(right);
  MatrixX far;
  if (far_ != nullptr) {
    far = halfway_;
    far.bottomRows(between) = x.tail(between);
    far_->backward(static_cast<int>(between), far);
  }
  displacement_ = VectorX::Zero(3 * static_cast<Eigen::Index>(nodes.positions.size()));
  for (std::size_t i = 0; i < nodes.positions.size(); ++i) {
    const auto at = 3 * static_cast<Eigen::Index>(i);
    if (near_place_[i] >= 0)
      displacement_.segment<3>(at) = x.segment<3>(3 * static_cast<Eigen::Index>(near_place_[i]));
    else if (far_place_[i] >= 0)
      displacement_.segment<3>(at) = far.middleRows<3>(3 * static_cast<Eigen::Index>(far_place_[i]));
    else
      displacement_.segment<3>(at) = nodes.prescribed[i];
  }
}

/// The far part's stiffness onto the nodes between, the last of the near ones.
void SubStructure::add_dense(solvers::SparseMatrix& lower) const {
  const Eigen::Index inner = 3 * static_cast<Eigen::Index>(near_count_),
                     between = 3 * static_cast<Eigen::Index>(between_count_);
  solvers::SparseMatrix dense(inner + between, inner + between);
  dense.resizeNonZeros(between * (between + 1) / 2);
  int* outer = dense.outerIndexPtr();
  std::fill(outer, outer + inner + 1, 0);
  Eigen::Index at = 0;
  for (Eigen::Index c = 0; c < between; ++c) {
    for (Eigen::Index r = c; r < between; ++r, ++at) {
      dense.innerIndexPtr()[at] = static_cast<int>(inner + r);
      dense.valuePtr()[at] = schur_(r, c);
    }
    outer[inner + c + 1] = static_cast<int>(at);
  }
  lower = (lower + dense).eval();
}

} // namespace spherecut::experiments::ledger
