#include "solvers/elasticity/rotation.hpp"

#include <Eigen/SVD>
#include <cmath>
#include <numbers>

namespace spherecut::solvers {

Matrix3 rotation_of(const Matrix3& deformation) {
  const Eigen::JacobiSVD<Matrix3> parts(deformation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return parts.matrixU() * parts.matrixV().transpose();
}

double rotation_degrees(const Matrix3& deformation) {
  const Matrix3 rotation = rotation_of(deformation);
  const Vector3 axis(rotation(2, 1) - rotation(1, 2), rotation(0, 2) - rotation(2, 0), rotation(1, 0) - rotation(0, 1));
  return std::atan2(axis.norm(), rotation.trace() - 1) * 180 / std::numbers::pi;
}

} // namespace spherecut::solvers
