// Coulomb friction between a tool and the nodes that it presses on, on the condensed compliance of the body. Nothing
// here allocates or throws: the haptic loop calls it too.
#pragma once

#include "topology/tool/tool.hpp"

#include <cstddef>
#include <span>

namespace spherecut::solvers {

/// Nodes in contact whose normal forces are known. Lists other than `nodes` have one entry a candidate.
struct SlidingContact {
  std::span<const int> nodes;         // candidates in contact
  const double* compliance = nullptr; // m/N, 3 rows a candidate, column-major and as many columns
  std::size_t rows = 0;
  std::span<const Vector3> normals; // of the tool
  std::span<const double> limits;   // N, coefficient of friction times normal force
};

/// One round over the nodes. `slip` is how far each has left the place where it stuck to the tool, m, of which the part
/// along the tool's surface counts; `traction` is the force along that surface, N on the body. Node by node the
/// traction is moved against the slip by what its own compliance asks for, and kept within its limit; all slips follow.
/// For given normal forces that goes down to the least of the elastic energy plus the work of the slips, a convex
/// problem [Panagiotopoulos 1975], where nothing sticks that is above its limit and nothing below it slips. Returns the
/// largest displacement that a node was moved by through its own traction, m.
double relax_friction(const SlidingContact& contact, std::span<Vector3> slip, std::span<Vector3> traction) noexcept;

/// Displacement of the tool's material point at x between two poses, m; a tool does not turn about its axis.
Vector3 tool_motion(const topology::ToolPose& from, const topology::ToolPose& to, const Vector3& x) noexcept;

/// x without its part along the unit vector n.
inline Vector3 along_surface(const Vector3& x, const Vector3& n) noexcept {
  return x - n.dot(x) * n;
}

/// Whether a traction has reached its limit, so that the node slips.
inline bool slips(const Vector3& traction, double limit) noexcept {
  return traction.norm() >= (1 - 1e-9) * limit;
}

} // namespace spherecut::solvers
