// Basic value types shared by every floor. SI units throughout: metres, newtons, pascals, seconds.
#pragma once

#include "topology/base/errors.hpp" // what functions of these types throw

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#if EIGEN_DEFAULT_ALIGN_BYTES != 16
#error                                                                                                                 \
    "Eigen aligns memory to more than 16 bytes here (-mavx, -march=native); the libraries of spherecut, as Debian's, \
do to 16, and one would free what the other took. Add -mno-avx to what includes their headers, or -DEIGEN_DONT_VECTORIZE."
#endif

namespace spherecut {

using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;
using VectorX = Eigen::VectorXd;
using MatrixX = Eigen::MatrixXd;

/// Vertex indices of a triangle, counter-clockwise seen from outside the body.
using Triangle = std::array<int, 3>;

/// Axis-aligned box, m.
struct BoundingBox {
  Vector3 lower = Vector3::Zero();
  Vector3 upper = Vector3::Zero();
  [[nodiscard]] Vector3 extent() const { return upper - lower; }
  [[nodiscard]] Vector3 centre() const { return 0.5 * (lower + upper); }
  [[nodiscard]] bool contains(const Vector3& x) const {
    return (x.array() >= lower.array()).all() && (x.array() <= upper.array()).all();
  }
};

/// The half-space normal . x <= offset; normal is a unit vector pointing out of the body.
struct Plane {
  Vector3 normal = Vector3::UnitZ();
  double offset = 0; // m
  [[nodiscard]] double signed_distance(const Vector3& x) const { return normal.dot(x) - offset; }
};

} // namespace spherecut
