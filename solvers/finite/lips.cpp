#include "solvers/finite/lips.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::solvers {

FiniteLips::FiniteLips(const FiniteBody& body, std::vector<LipPair> pairs, double stiffness)
    : pairs_(std::move(pairs)) {
  if (!(stiffness > 0) || !std::isfinite(stiffness))
    throw InputError(fmt::format("stiffness {} of the contact of lips: it must be positive", stiffness));
  for (const LipPair& pair : pairs_) {
    DisplacementMean apart = body.contact_mean(pair.plus); // mean of `plus` less that of `minus`
    const DisplacementMean minus = body.contact_mean(pair.minus);
    const std::array<int, 2> carriers = body.cut_functions() == nullptr
                                            ? std::array{pair.plus, pair.minus}
                                            : std::array{body.carrier_of(apart), body.carrier_of(minus)};
    for (std::size_t k = 0; k < minus.nodes.size(); ++k) {
      apart.nodes.push_back(minus.nodes[k]);
      apart.weights.push_back(-minus.weights[k]);
    }
    const double h = body.problem().nodes.spacings[pair.plus];
    const double penalty = stiffness * body.problem().material.young_modulus * std::max(apart.area / h, h);
    contact_.add({.mean = std::move(apart),
                  .direction = pair.normal,
                  .at_rest = pair.gap * pair.normal,
                  .stiffness = penalty,
                  .spacing = h,
                  .carriers = carriers});
  }
}

// A normal N of the body at rest becomes F^-T N.
void FiniteLips::turn(const std::vector<Matrix3>& maps) {
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    const auto& [of_plus, of_minus] = contact_.means()[p].carriers;
    const Vector3 plus = maps[of_plus].inverse().transpose() * pairs_[p].normal;
    const Vector3 minus = maps[of_minus].inverse().transpose() * pairs_[p].normal;
    const Vector3 both = plus.normalized() + minus.normalized();
    if (both.norm() > 0.1) // else the faces look away from each other, and the last normal stays
      contact_.mean(p).direction = both.normalized();
  }
}

} // namespace spherecut::solvers
