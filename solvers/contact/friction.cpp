#include "solvers/contact/friction.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace spherecut::solvers {

namespace {

// 3 x 3 block of the compliance: displacement of candidate c for a force on d.
Matrix3 block(const SlidingContact& contact, int c, int d) noexcept {
  const double* first = contact.compliance + 3 * static_cast<std::size_t>(d) * contact.rows + 3 * c;
  Matrix3 result;
  for (Eigen::Index j = 0; j < 3; ++j)
    for (Eigen::Index i = 0; i < 3; ++i)
      result(i, j) = first[static_cast<std::size_t>(j) * contact.rows + static_cast<std::size_t>(i)];
  return result;
}

// Largest displacement along the surface per newton along it.
double softest(const Matrix3& own, const Vector3& normal) noexcept {
  const Vector3 first = normal.unitOrthogonal();
  const Vector3 second = normal.cross(first);
  const double a = first.dot(own * first);
  const double b = second.dot(own * second);
  const double c = 0.5 * (first.dot(own * second) + second.dot(own * first));
  return 0.5 * (a + b) + std::sqrt(0.25 * (a - b) * (a - b) + c * c);
}

} // namespace

double relax_friction(const SlidingContact& contact, std::span<Vector3> slip, std::span<Vector3> traction) noexcept {
  double largest = 0;
  for (const int c : contact.nodes) {
    const auto at = static_cast<std::size_t>(c);
    const Matrix3 own = block(contact, c, c);
    const double compliance = softest(own, contact.normals[at]);
    if (!(compliance > 0))
      continue;
    Vector3 wanted = along_surface(traction[at] - slip[at] / compliance, contact.normals[at]);
    const double size = wanted.norm();
    if (size > contact.limits[at])
      wanted *= std::max(contact.limits[at], 0.0) / size;
    const Vector3 change = wanted - traction[at];
    if (change.isZero(0))
      continue;
    traction[at] = wanted;
    for (const int d : contact.nodes)
      slip[static_cast<std::size_t>(d)] += block(contact, d, c) * change;
    largest = std::max(largest, (own * change).norm());
  }
  return largest;
}

Vector3 tool_motion(const topology::ToolPose& from, const topology::ToolPose& to, const Vector3& x) noexcept {
  return to.point + Eigen::Quaterniond::FromTwoVectors(from.axis, to.axis) * (x - from.point) - x;
}

} // namespace spherecut::solvers
