#include "solvers/finite/unilateral_means.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace spherecut::solvers {

void UnilateralMeans::add(UnilateralMean mean) {
  means_.push_back(std::move(mean));
  known_.push_back(0);
}

std::vector<double> UnilateralMeans::gaps(const VectorX& coefficients) const {
  std::vector<double> all;
  all.reserve(means_.size());
  for (const UnilateralMean& mean : means_)
    all.push_back(mean.gap(coefficients));
  return all;
}

double UnilateralMeans::add_forces(const VectorX& coefficients, VectorX& forces) {
  double energy = 0;
  active_.clear();
  deepest_ = 0;
  VectorX own = VectorX::Zero(forces.size());
  for (std::size_t p = 0; p < means_.size(); ++p) {
    const UnilateralMean& mean = means_[p];
    const double gap = mean.gap(coefficients);
    const double force = known_[p] - mean.stiffness * gap;
    deepest_ = std::max(deepest_, -gap / mean.spacing);
    energy -= 0.5 * known_[p] * known_[p] / mean.stiffness;
    if (!(force > 0))
      continue;
    energy += 0.5 * force * force / mean.stiffness;
    deepest_ = std::max(deepest_, gap / mean.spacing); // a force across a gap
    active_.push_back({static_cast<int>(p), force});
    for (std::size_t k = 0; k < mean.mean.nodes.size(); ++k)
      own.segment<3>(3 * static_cast<Eigen::Index>(mean.mean.nodes[k])) -=
          mean.mean.weights[k] * force * mean.direction;
  }
  force_norm_ = own.norm();
  forces += own;
  return energy;
}

std::vector<double> UnilateralMeans::forces() const {
  std::vector<double> all(means_.size(), 0);
  for (const Active& active : active_)
    all[active.index] = active.force;
  return all;
}

void UnilateralMeans::append_active(const std::vector<Matrix3>& maps,
                                    std::vector<ActiveConstraint>& constraints) const {
  for (const Active& active : active_) {
    const UnilateralMean& mean = means_[active.index];
    const auto [one, other] = mean.carriers;
    constraints.push_back({.key = first_key_ - active.index,
                           .mean = &mean.mean,
                           .direction = maps.empty()
                                            ? mean.direction
                                            : Vector3(0.5 * (maps[one] + maps[other]).transpose() * mean.direction),
                           .stiffness = mean.stiffness});
  }
}

} // namespace spherecut::solvers
