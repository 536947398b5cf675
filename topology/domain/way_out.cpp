#include "topology/domain/way_out.hpp"

#include <algorithm>

namespace spherecut::topology {

// No point nearer than its distance to the surface is outside: sphere tracing [Hart 1996].
double way_out(const Domain& domain, const Vector3& from, const Vector3& direction, double longest) {
  constexpr double least_step = 1e-5; // of the diagonal
  const double step = least_step * domain.bounds().extent().norm();
  double way = step;
  while (way < longest) {
    const double depth = -domain.signed_distance(from + way * direction);
    if (depth < 0)
      return way;
    way += std::max(step, depth);
  }
  return longest;
}

} // namespace spherecut::topology
