#include "experiments/reference/lens.hpp"

#include "topology/base/errors.hpp"

#include <array>
#include <cmath>
#include <complex>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

using std::numbers::pi;

// Oblate coordinates about a disc, x = cosh(xi) cos(eta), z = sinh(xi) sin(eta): near the rim they are the square of xi
// + i eta, so that quadratic elements have the root there. A Moebius transformation that fades outwards bends the disc
// to the cap; it leaves the axis in its place.
solvers::Intensities lens_by_elements(const solvers::Material& material, double half_angle, double far, int fine) {
  if (!(half_angle > 0 && half_angle < pi / 2 && far >= 2 && std::isfinite(far) && fine >= 8))
    throw InputError(
        fmt::format("lens: half angle {} rad in a ball of {} rim radii with {} elements; allowed: 0 to {}, "
                    "2 and more, 8 and more",
                    half_angle, far, fine, pi / 2));
  const double bend = -std::tan(half_angle / 2), rim = 1 / (1 + bend * bend), sphere = rim / std::sin(half_angle);
  const std::vector<double> quarter = graded_interval(0, pi / 2, 2 * fine, 2);
  std::vector<double> around;
  for (auto eta = quarter.rbegin(); eta != quarter.rend(); ++eta)
    around.push_back(-*eta);
  around.insert(around.end(), quarter.begin() + 1, quarter.end());
  const AxisymmetricGrid grid =
      make_grid(graded_interval(0, std::acosh(far * rim), 3 * fine, 2), around, [&](double xi, double eta) {
        const std::complex<double> w(std::sinh(xi) * std::sin(eta), std::cosh(xi) * std::cos(eta));
        const std::complex<double> x = w / (1.0 + bend / std::pow(std::cosh(xi), 2) * w);
        const bool on_axis = std::abs(eta) > pi / 2 - 1e-12;
        return Vector2(on_axis ? 0 : x.imag(), x.real());
      });
  std::vector<AxisymmetricSupport> supports;
  const double strain = (1 - 2 * material.poisson_ratio) / material.young_modulus;
  for (int j = 0; j < grid.columns; ++j) {
    const int node = grid.node(grid.rows - 1, j);
    for (int component = 0; component < 2; ++component)
      supports.push_back({node, component, strain * grid.nodes[static_cast<std::size_t>(node)][component]});
  }
  const AxisymmetricSolution solution = solve_axisymmetric(grid, material, supports);
  // The jump at two distances s behind the rim, fitted by A s^(1/2) + B s^(3/2). The element at the rim is left out: no
  // polynomial of xi and eta has the angles of the field there.
  std::array<Vector2, 2> scaled;
  std::array<double, 2> s{};
  const int tip = (grid.columns - 1) / 2;
  for (int k = 0; k < 2; ++k) {
    const auto upper = static_cast<std::size_t>(grid.node(0, tip + (4 + k) * fine / 2));
    const auto lower = static_cast<std::size_t>(grid.node(0, tip - (4 + k) * fine / 2));
    const double angle = std::asin(grid.nodes[upper].x() / sphere);
    s[k] = sphere * (half_angle - angle);
    const Vector2 jump = solution.displacement[upper] - solution.displacement[lower];
    const Vector2 normal(std::sin(angle), std::cos(angle)), ahead(std::cos(angle), -std::sin(angle));
    scaled[k] = Vector2(jump.dot(normal), jump.dot(ahead)) / std::sqrt(s[k]);
  }
  const Vector2 leading = (s[1] * scaled[0] - s[0] * scaled[1]) / (s[1] - s[0]);
  const double plane = material.young_modulus / (1 - material.poisson_ratio * material.poisson_ratio);
  const Vector2 k = plane * std::sqrt(2 * pi / rim) / 8 * leading;
  return {k.x(), k.y(), 0};
}

} // namespace spherecut::experiments
