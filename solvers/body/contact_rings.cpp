#include "solvers/body/contact_rings.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::solvers {

namespace {

constexpr double pi = std::numbers::pi;

struct Frame {
  Vector3 first, second;
};

/// Two unit vectors that complete the normal to a frame, the same for the same normal.
Frame tangents(const Vector3& normal) {
  const Vector3 first = normal.unitOrthogonal();
  return {first, normal.cross(first)};
}

/// The surface point nearest to `start` on the line along `normal`.
Vector3 onto_surface(const topology::Domain& domain, const Vector3& start, const Vector3& normal, double reach) {
  Vector3 x = start;
  for (int iteration = 0; iteration < 50; ++iteration) {
    const double distance = domain.signed_distance(x);
    if (std::abs(distance) < 1e-12 * reach)
      return x;
    const double slope = domain.normal(x).dot(normal);
    if (std::abs(slope) < 0.1 || (x - start).norm() > reach)
      break;
    x -= distance / slope * normal;
  }
  throw InputError(fmt::format("the contact ring point ({:.6g}, {:.6g}, {:.6g}) m does not meet the surface along the "
                               "contact's axis: the contact reaches over an edge of the body",
                               start.x(), start.y(), start.z()));
}

} // namespace

double contact_ring_offset(Method method) {
  return method == Method::galerkin ? 0.25 : 0.4;
}

std::vector<SeedNode> contact_rings(const topology::Domain& domain, const Vector3& centre, const Vector3& normal,
                                    double radius, double spacing, double offset) {
  if (!(radius > 0) || !(spacing > 0) || !(offset > 0))
    throw InputError(fmt::format("contact rings of radius {} m, spacing {} m, offset {}: all must be positive", radius,
                                 spacing, offset));
  std::vector<SeedNode> seeds{{centre, NodeKind::surface}};
  const Frame frame = tangents(normal);
  for (int ring = 0; ring < 2; ++ring) {
    const double ring_radius = radius + (ring == 0 ? -offset : offset) * spacing;
    if (ring_radius < 0.3 * spacing)
      continue;
    const int count = std::max(3, static_cast<int>(std::round(2 * pi * ring_radius / spacing)));
    for (int k = 0; k < count; ++k) {
      const double angle = 2 * pi * (k + 0.5 * ring) / count;
      const Vector3 start = centre + ring_radius * (std::cos(angle) * frame.first + std::sin(angle) * frame.second);
      seeds.push_back({onto_surface(domain, start, normal, 4 * ring_radius), NodeKind::surface});
    }
  }
  return seeds;
}

SpacingField edge_spacing(const Vector3& centre, const Vector3& normal, double radius, double fine, double coarse,
                          double slope) {
  const Frame frame = tangents(normal);
  SpacingField spacing;
  spacing.fine = fine;
  spacing.coarse = coarse;
  spacing.slope = slope;
  constexpr int count = 32;
  for (int k = 0; k < count; ++k) {
    const double angle = 2 * pi * k / count;
    spacing.centres.emplace_back(centre + radius * (std::cos(angle) * frame.first + std::sin(angle) * frame.second));
  }
  return spacing;
}

} // namespace spherecut::solvers
