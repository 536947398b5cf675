#include "solvers/fracture/virtual_shift.hpp"

#include <algorithm>
#include <cmath>

namespace spherecut::solvers {

Faded faded_across(double r, double inner, double outer) {
  const double t = std::clamp((outer - r) / (outer - inner), 0.0, 1.0);
  return {t * t * (3 - 2 * t), r > inner && r < outer ? -6 * t * (1 - t) / (outer - inner) : 0.0};
}

Faded faded_along(double s, double half_length) {
  const double t = s / half_length, rest = 1 - t * t;
  return std::abs(t) < 1 ? Faded{rest * rest, -4 * t * rest / half_length} : Faded{};
}

Cover cover(const topology::Domain& domain, const Vector3& x, double inset) {
  Cover result;
  if (!(inset > 0))
    return result;
  const double t = -domain.signed_distance(x) / inset;
  if (t >= 1)
    return result;
  result.share = t > 0 ? t * t * (3 - 2 * t) : 0;
  if (t > 0)
    result.gradient = -6 * t * (1 - t) / inset * domain.normal(x);
  return result;
}

double front_curvature(const topology::Incision& incision, const topology::FrontFrame& front, double h) {
  const auto before = incision.front_frame(front.point - h * front.tangent, 2 * h);
  const auto after = incision.front_frame(front.point + h * front.tangent, 2 * h);
  if (!before || !after)
    return 0;
  const double length = (after->point - before->point).norm();
  return length > 0.5 * h ? (after->ahead - before->ahead).dot(front.tangent) / length : 0;
}

} // namespace spherecut::solvers
