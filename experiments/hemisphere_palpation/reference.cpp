#include "experiments/hemisphere_palpation/reference.hpp"

#include "experiments/reference/axisymmetric.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

constexpr double quarter_turn = std::numbers::pi / 2;

void append(std::vector<double>& values, const std::vector<double>& more) {
  values.insert(values.end(), more.begin() + (values.empty() ? 0 : 1), more.end());
}

std::vector<double> reversed(std::vector<double> values) {
  std::ranges::reverse(values);
  return values;
}

/// Element corners in angle from the pole. The stress is singular like distance^(-1/2) at the edge of the cap and
/// more weakly where the free surface meets the base; quartic and quadratic grading give those zones the elements they
/// need.
std::vector<double> element_angles(int n) {
  const double edge = std::asin(hemisphere_cap_radius), middle = edge + 0.6 * (quarter_turn - edge);
  std::vector<double> angles;
  append(angles, reversed(graded_interval(edge, 0, n, 4)));
  append(angles, graded_interval(edge, middle, n, 4));
  append(angles, reversed(graded_interval(quarter_turn, middle, n / 2, 2)));
  return angles;
}

HemisphereReference solve(double poisson_ratio, int n) {
  const std::vector<double> angles = element_angles(n);
  const AxisymmetricGrid grid =
      make_grid(reversed(graded_interval(1, 0, 2 * n, 4)), angles, [](double distance, double angle) {
        return Vector2(angle == 0 ? 0 : distance * std::sin(angle),
                       angle == quarter_turn ? 0 : distance * std::cos(angle));
      });
  // The first row is the centre of the base, the last the curved surface; the last column is the base.
  std::vector<AxisymmetricSupport> supports;
  const auto hold = [&](int node, double axial) {
    supports.push_back({node, 0, 0});
    supports.push_back({node, 1, axial});
  };
  for (int j = 0; j < grid.columns; ++j)
    hold(grid.node(0, j), 0);
  for (int i = 0; i < grid.rows; ++i)
    hold(grid.node(i, grid.columns - 1), 0);
  const int cap_columns = 2 * n + 1, surface = grid.rows - 1;
  for (int j = 0; j < cap_columns; ++j)
    hold(grid.node(surface, j), -1);

  const AxisymmetricSolution solution = solve_axisymmetric(grid, {1, poisson_ratio, 0}, supports);
  HemisphereReference result;
  result.source = fmt::format("axisymmetric biquadratic elements, {} x {}", grid.rows / 2, grid.columns / 2);
  result.poisson_ratio = poisson_ratio;
  for (int j = 0; j < grid.columns; ++j) {
    const int k = grid.node(surface, j);
    result.angle.push_back(std::atan2(grid.nodes[k].x(), grid.nodes[k].y()));
    result.radial.push_back(solution.displacement[k].x());
    result.axial.push_back(solution.displacement[k].y());
    if (j < cap_columns)
      result.force -= solution.reaction[k].y();
  }
  return result;
}

} // namespace

Eigen::Vector2d HemisphereReference::displacement(double at_angle) const {
  if (!(at_angle >= 0) || !(at_angle <= quarter_turn + 1e-9))
    throw InputError(fmt::format("hemisphere reference: angle {} rad (allowed: 0 to pi/2)", at_angle));
  const auto above = std::ranges::lower_bound(angle, at_angle) - angle.begin();
  const std::size_t k =
      std::min((static_cast<std::size_t>(std::max<std::ptrdiff_t>(above, 1)) - 1) / 2 * 2, angle.size() - 3);
  const double s = std::min(1.0, 2 * (at_angle - angle[k]) / (angle[k + 2] - angle[k]) - 1); // -1 to 1 in the element
  const auto quadratic = [&](const std::vector<double>& v) {
    return 0.5 * s * (s - 1) * v[k] + (1 - s * s) * v[k + 1] + 0.5 * s * (s + 1) * v[k + 2];
  };
  return {quadratic(radial), quadratic(axial)};
}

Vector3 HemisphereReference::displacement(const Vector3& x) const {
  const double r = std::hypot(x.x(), x.y());
  const Eigen::Vector2d u = displacement(std::min(std::atan2(r, x.z()), quarter_turn));
  return r > 0 ? Vector3(u.x() * x.x() / r, u.x() * x.y() / r, u.y()) : Vector3(0, 0, u.y());
}

double largest_difference(const HemisphereReference& a, const HemisphereReference& b) {
  std::vector<double> angles = a.angle;
  for (double t = 0; t < quarter_turn; t += 0.02)
    angles.push_back(t);
  double largest = 0;
  for (const double t : angles)
    largest = std::max(largest, (a.displacement(t) - b.displacement(t)).norm());
  return largest;
}

HemisphereReference axisymmetric_hemisphere(double poisson_ratio, double tolerance) {
  if (!(poisson_ratio >= 0) || !(poisson_ratio <= 0.45))
    throw InputError(fmt::format("hemisphere reference: Poisson's ratio is {} (allowed: 0 to 0.45)", poisson_ratio));
  int n = 4;
  HemisphereReference coarse = solve(poisson_ratio, n);
  for (int refinement = 1; refinement <= 4; ++refinement) {
    n *= 2;
    HemisphereReference fine = solve(poisson_ratio, n);
    fine.force_change = std::abs(fine.force / coarse.force - 1);
    fine.surface_change = largest_difference(coarse, fine);
    if (fine.force_change < tolerance && fine.surface_change < tolerance)
      return fine;
    coarse = std::move(fine);
  }
  throw NumericalError(fmt::format("hemisphere reference: after {} x {} elements the force still changes by {} and the "
                                   "surface by {} (tolerance {})",
                                   2 * n, 5 * n / 2, coarse.force_change, coarse.surface_change, tolerance));
}

} // namespace spherecut::experiments
