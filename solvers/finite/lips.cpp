#include "solvers/finite/lips.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

FiniteLips::FiniteLips(const FiniteBody& body, std::vector<LipPair> pairs, double stiffness)
    : body_(body), pairs_(std::move(pairs)), known_(pairs_.size(), 0) {
  if (!(stiffness > 0) || !std::isfinite(stiffness))
    throw InputError(fmt::format("stiffness {} of the contact of lips: it must be positive", stiffness));
  for (const LipPair& pair : pairs_) {
    DisplacementMean apart = body_.contact_mean(pair.plus);
    const DisplacementMean minus = body_.contact_mean(pair.minus);
    for (std::size_t k = 0; k < minus.nodes.size(); ++k) {
      apart.nodes.push_back(minus.nodes[k]);
      apart.weights.push_back(-minus.weights[k]);
    }
    const double h = body_.problem().nodes.spacings[pair.plus];
    stiffness_.push_back(stiffness * body_.problem().material.young_modulus * std::max(apart.area / h, h));
    apart_.push_back(std::move(apart));
    normals_.push_back(pair.normal);
  }
}

// A normal N of the body at rest becomes F^-T N.
void FiniteLips::turn(const std::vector<Matrix3>& maps) {
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    const Vector3 plus = maps[pairs_[p].plus].inverse().transpose() * pairs_[p].normal;
    const Vector3 minus = maps[pairs_[p].minus].inverse().transpose() * pairs_[p].normal;
    const Vector3 both = plus.normalized() + minus.normalized();
    if (both.norm() > 0.1) // else the faces look away from each other, and the last normal stays
      normals_[p] = both.normalized();
  }
}

double FiniteLips::opening(std::size_t pair, const VectorX& coefficients) const {
  return normals_[pair].dot(pairs_[pair].gap * pairs_[pair].normal + apart_[pair].of(coefficients));
}

std::vector<double> FiniteLips::openings(const VectorX& coefficients) const {
  std::vector<double> all;
  for (std::size_t p = 0; p < pairs_.size(); ++p)
    all.push_back(opening(p, coefficients));
  return all;
}

double FiniteLips::add(const VectorX& coefficients, VectorX& forces) {
  double energy = 0;
  active_.clear();
  deepest_ = 0;
  VectorX own = VectorX::Zero(forces.size());
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    const double gap = opening(p, coefficients);
    const double force = known_[p] - stiffness_[p] * gap;
    const double h = body_.problem().nodes.spacings[pairs_[p].plus];
    deepest_ = std::max(deepest_, -gap / h);
    energy -= 0.5 * known_[p] * known_[p] / stiffness_[p];
    if (!(force > 0))
      continue;
    energy += 0.5 * force * force / stiffness_[p];
    deepest_ = std::max(deepest_, gap / h); // a force across a gap
    active_.push_back({static_cast<int>(p), force});
    for (std::size_t k = 0; k < apart_[p].nodes.size(); ++k)
      own.segment<3>(3 * apart_[p].nodes[k]) -= apart_[p].weights[k] * force * normals_[p];
  }
  force_norm_ = own.norm();
  forces += own;
  return energy;
}

std::vector<double> FiniteLips::forces() const {
  std::vector<double> all(pairs_.size(), 0);
  for (const Active& active : active_)
    all[active.pair] = active.force;
  return all;
}

void FiniteLips::append_active(const std::vector<Matrix3>& maps, std::vector<ActiveConstraint>& constraints) const {
  for (const Active& active : active_) {
    const LipPair& pair = pairs_[active.pair];
    const Vector3& normal = normals_[active.pair];
    constraints.push_back(
        {.key = -1 - active.pair,
         .mean = &apart_[active.pair],
         .direction = maps.empty() ? normal : Vector3(0.5 * (maps[pair.plus] + maps[pair.minus]).transpose() * normal),
         .stiffness = stiffness_[active.pair]});
  }
}

} // namespace spherecut::solvers
