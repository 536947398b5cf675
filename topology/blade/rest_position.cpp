#include "topology/blade/rest_position.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::topology {

RestPlace rest_position(const Vector3& x, const std::function<Vector3(const Vector3&)>& displacement, double tolerance,
                        double coarse_tolerance, int most_steps) {
  constexpr int most_in_vain = 20;
  Vector3 rest = x, residual = rest + displacement(rest) - x;
  Matrix3 inverse = Matrix3::Identity(); // of the derivative of the residual
  std::optional<Vector3> coarse;
  double least = std::numeric_limits<double>::infinity();
  int step = 0;
  for (int in_vain = 0; step < most_steps && residual.norm() > tolerance; ++step) {
    if (!coarse && residual.norm() <= coarse_tolerance)
      coarse = rest;
    in_vain = residual.norm() < least ? 0 : in_vain + 1;
    if (in_vain == most_in_vain)
      break;
    least = std::min(least, residual.norm());
    const Vector3 move = -inverse * residual;
    rest += move;
    const Vector3 next = rest + displacement(rest) - x, change = inverse * (next - residual);
    // Broyden's update of the inverse [Broyden 1965, by Sherman and Morrison], unless it would be singular.
    if (const double pivot = move.dot(change); std::abs(pivot) > 1e-3 * move.squaredNorm())
      inverse += (move - change) * (move.transpose() * inverse) / pivot;
    residual = next;
  }
  if (residual.norm() <= tolerance)
    return {rest};
  if (!coarse && residual.norm() <= coarse_tolerance)
    coarse = rest;
  if (coarse)
    return {*coarse, false};
  throw NumericalError(fmt::format("no rest position found for ({}, {}, {}): {} m left after {} steps, {} m wanted",
                                   x.x(), x.y(), x.z(), residual.norm(), step, std::max(tolerance, coarse_tolerance)));
}

std::optional<Vector3> rest_position_from(const std::vector<Vector3>& starts, const Vector3& x,
                                          const std::function<Vector3(const Vector3&)>& displacement, double tolerance,
                                          double difference) {
  constexpr int most_steps = 20, most_halvings = 6;
  const auto residual_at = [&](const Vector3& rest) -> Vector3 { return rest + displacement(rest) - x; };
  for (Vector3 rest : starts) {
    Vector3 residual = residual_at(rest);
    for (int step = 0; step < most_steps && residual.norm() > tolerance; ++step) {
      Matrix3 derivative;
      for (int d = 0; d < 3; ++d)
        derivative.col(d) = (residual_at(rest + difference * Vector3::Unit(d)) - residual) / difference;
      Vector3 move = -derivative.fullPivLu().solve(residual), next = residual;
      int halving = 0;
      for (; halving < most_halvings; ++halving, move *= 0.5)
        if (next = residual_at(rest + move); next.norm() < residual.norm())
          break;
      if (halving == most_halvings || !move.allFinite())
        break;
      rest += move;
      residual = next;
    }
    if (residual.norm() <= tolerance)
      return rest;
  }
  return std::nullopt;
}

} // namespace spherecut::topology
