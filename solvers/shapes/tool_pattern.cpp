#include "solvers/shapes/tool_pattern.hpp"

#include "solvers/shapes/functions.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <numbers>

namespace spherecut::solvers {

namespace {

/// Nodes of a shell on a circle of latitude.
struct Ring {
  int shell;
  double depression; // degrees below the surface
  int nodes;
  double first; // azimuth of the first node, degrees
};

constexpr std::array<double, 4> shell_radii{0, 0.32, 0.66, 1}; // in units of reach
constexpr std::array<Ring, 9> rings{{{0, 0, 1, 0},
                                     {1, 0, 4, 0},
                                     {1, 90, 1, 0},
                                     {2, 0, 8, 22.5},
                                     {2, 45, 4, 45},
                                     {2, 90, 1, 0},
                                     {3, 0, 8, 0},
                                     {3, 38, 6, 30},
                                     {3, 90, 1, 0}}};
constexpr double outer_radius = 0.97;   // of the spheres of the outer shells, in units of the distance from the tip
constexpr double wall_clearance = 0.45; // of inside nodes, in units of their spacing

/// The steps by which a placed surface node may deviate from its distance before the surface is followed in small
/// steps.
constexpr double distance_tolerance = 0.15;
constexpr int surface_steps = 8;

/// The point at `length` from `start` along the surface, setting out in a tangential direction.
Vector3 follow_surface(const topology::Domain& domain, const Vector3& start, const Vector3& direction, double length) {
  Vector3 straight = domain.closest_surface_point(start + length * direction);
  if (std::abs((straight - start).norm() - length) <= distance_tolerance * length)
    return straight;
  Vector3 x = start, heading = direction;
  const double step = length / surface_steps;
  for (int k = 0; k < surface_steps; ++k) {
    // At a sharp edge the closest point stays on the edge; the next step sets out along the face behind it.
    const Vector3 next = domain.closest_surface_point(x + step * heading);
    const Vector3 normal = domain.normal(next + 1e-3 * step * heading);
    const Vector3 along = heading - normal * normal.dot(heading);
    x = next;
    if (along.norm() > 0.2)
      heading = along.normalized();
    else { // the surface turns off squarely: go on against the old normal, into the face behind the edge
      const Vector3 away = -domain.normal(x - 1e-3 * step * heading);
      heading = (away - normal * normal.dot(away)).normalized();
    }
  }
  return x;
}

/// p, or the nearest place inwards that is `clearance` deep. False when there is none.
bool move_inside(const topology::Domain& domain, double clearance, Vector3& p) {
  for (int attempt = 0; attempt < 6; ++attempt) {
    const double distance = domain.signed_distance(p);
    if (distance <= -clearance * (1 - 1e-9))
      return true;
    const Vector3 foot = domain.closest_surface_point(p);
    const Vector3 normal = domain.normal(foot);
    p = foot - clearance * (1 + 1e-3 * attempt) * normal;
    if (attempt > 0) // near an edge: clear of both faces in turn
      p -= 0.2 * clearance * normal;
  }
  return false;
}

} // namespace

double moment_condition(const std::vector<Vector3>& centres, const std::vector<double>& radii, const Vector3& x,
                        double scale) {
  Eigen::Matrix4d moment = Eigen::Matrix4d::Zero();
  for (std::size_t j = 0; j < centres.size(); ++j) {
    const Vector3 offset = centres[j] - x;
    const double weight = quartic_spline(offset.norm() / radii[j]);
    if (weight <= 0)
      continue;
    const Eigen::Vector4d p(1, offset.x() / scale, offset.y() / scale, offset.z() / scale);
    moment += weight * p * p.transpose();
  }
  const Eigen::FullPivLU<Eigen::Matrix4d> factor(moment);
  if (!factor.isInvertible())
    return std::numeric_limits<double>::infinity();
  const auto norm = [](const Eigen::Matrix4d& m) { return m.cwiseAbs().colwise().sum().maxCoeff(); };
  return norm(moment) * norm(factor.inverse());
}

ToolPattern paper_pattern(double reach) {
  if (!(reach > 0) || !std::isfinite(reach))
    throw InputError(fmt::format("paper_pattern: reach is {} m; it must be positive", reach));
  constexpr double degree = std::numbers::pi / 180;
  ToolPattern pattern;
  pattern.reach = reach;
  for (const Ring& ring : rings)
    for (int k = 0; k < ring.nodes; ++k) {
      const double azimuth = (ring.first + 360.0 * k / ring.nodes) * degree, down = ring.depression * degree;
      const double distance = reach * shell_radii[ring.shell], rho = ring.depression < 90 ? std::cos(down) : 0;
      const bool on_surface = ring.depression == 0;
      pattern.positions.push_back(
          distance * Vector3(rho * std::cos(azimuth), rho * std::sin(azimuth), on_surface ? 0 : -std::sin(down)));
      pattern.radii.push_back(ring.shell == 0 ? pattern_support_radius * reach * shell_radii[1]
                                              : outer_radius * distance);
      pattern.on_surface.push_back(on_surface);
      pattern.shells.push_back(ring.shell);
    }
  // The smallest spheres of the first shell that hold the tip well enough, by bisection.
  const double first = reach * shell_radii[1];
  double too_small = first, enough = 2 * first;
  while (enough - too_small > 1e-6 * first) {
    const double radius = 0.5 * (too_small + enough);
    for (int i = 0; i < pattern.size(); ++i)
      if (pattern.shells[i] == 1)
        pattern.radii[i] = radius;
    (moment_condition(pattern.positions, pattern.radii, Vector3::Zero(), first) <= tip_condition_limit ? enough
                                                                                                       : too_small) =
        radius;
  }
  for (int i = 0; i < pattern.size(); ++i)
    if (pattern.shells[i] == 1)
      pattern.radii[i] = enough;
  return pattern;
}

NodeCloud place(const ToolPattern& pattern, const topology::Domain& domain, const Vector3& contact,
                const Vector3& normal) {
  const auto at = [](const Vector3& x) { return fmt::format("({:.6g}, {:.6g}, {:.6g}) m", x.x(), x.y(), x.z()); };
  if (!(std::abs(normal.norm() - 1) < 1e-6))
    throw InputError(fmt::format("tool pattern: the normal has length {}; it must be a unit vector", normal.norm()));
  const Vector3 tip = domain.closest_surface_point(contact);
  if (!((tip - contact).norm() <= 0.1 * pattern.reach))
    throw InputError(
        fmt::format("tool pattern: the contact at {} is {:.3g} m from the surface; the limit is {:.3g} m, a "
                    "tenth of the reach",
                    at(contact), (tip - contact).norm(), 0.1 * pattern.reach));
  const Eigen::Quaterniond frame = Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), normal);
  NodeCloud nodes;
  for (int i = 0; i < pattern.size(); ++i) {
    const Vector3 offset = frame * pattern.positions[i];
    const double length = pattern.positions[i].norm(), spacing = pattern.radii[i] / pattern_support_radius;
    Vector3 x = tip + offset;
    if (i == 0)
      x = tip;
    else if (pattern.on_surface[i])
      x = follow_surface(domain, tip, offset / length, length);
    else if (!move_inside(domain, std::min(wall_clearance * spacing, 0.9 * length), x))
      throw InputError(
          fmt::format("tool pattern: the body at {} is too thin for node {} of a pattern of reach {:.3g} m; "
                      "take a smaller reach",
                      at(tip), i, pattern.reach));
    for (int j = 0; j < i; ++j)
      if (const double apart = (nodes.positions[j] - x).norm(); apart < 0.1 * shell_radii[1] * pattern.reach)
        throw InputError(
            fmt::format("tool pattern: at {} the surface is too bent for a pattern of reach {:.3g} m: nodes "
                        "{} and {} come within {:.3g} m; take a smaller reach",
                        at(tip), pattern.reach, j, i, apart));
    const double stretch = length > 0 ? (x - tip).norm() / length : 1;
    nodes.add(x, stretch * spacing, pattern.on_surface[i] ? NodeKind::surface : NodeKind::interior,
              pattern.on_surface[i] ? domain.normal(x) : Vector3(Vector3::Zero()));
  }
  return nodes;
}

} // namespace spherecut::solvers
