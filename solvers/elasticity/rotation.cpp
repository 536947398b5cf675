#include "solvers/elasticity/rotation.hpp"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <cmath>
#include <numbers>

namespace spherecut::solvers {

Matrix3 rotation_of(const Matrix3& deformation) {
  const Eigen::JacobiSVD<Matrix3> parts(deformation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3 left = parts.matrixU();
  if (left.determinant() * parts.matrixV().determinant() < 0) // of the smallest singular value
    left.col(2) *= -1;
  return left * parts.matrixV().transpose();
}

Matrix3 rotation_between(const Matrix3& one, const Matrix3& other) {
  const Eigen::Quaterniond from(rotation_of(one)), to(rotation_of(other));
  return from.slerp(0.5, to).toRotationMatrix();
}

double rotation_degrees(const Matrix3& deformation) {
  const Matrix3 rotation = rotation_of(deformation);
  const Vector3 axis(rotation(2, 1) - rotation(1, 2), rotation(0, 2) - rotation(2, 0), rotation(1, 0) - rotation(0, 1));
  return std::atan2(axis.norm(), rotation.trace() - 1) * 180 / std::numbers::pi;
}

} // namespace spherecut::solvers
