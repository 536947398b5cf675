#include "tests/support/finite_differences.hpp"

namespace spherecut::tests {

Matrix3 gradient(const VectorField& u, const Vector3& x, double h) {
  Matrix3 result;
  for (int j = 0; j < 3; ++j) {
    const Vector3 e = h * Vector3::Unit(j);
    result.col(j) = (8 * (u(x + e) - u(x - e)) - (u(x + 2 * e) - u(x - 2 * e))) / (12 * h);
  }
  return result;
}

Matrix3 stress(const solvers::Material& material, const Matrix3& displacement_gradient) {
  const Matrix3 strain = 0.5 * (displacement_gradient + displacement_gradient.transpose());
  return material.lame_lambda() * strain.trace() * Matrix3::Identity() + 2 * material.shear_modulus() * strain;
}

Vector3 stress_divergence(const solvers::Material& material, const VectorField& u, const Vector3& x, double h) {
  const auto sigma = [&](const Vector3& y) { return stress(material, gradient(u, y, h)); };
  Vector3 result = Vector3::Zero();
  for (int j = 0; j < 3; ++j) {
    const Vector3 e = h * Vector3::Unit(j);
    result += ((8 * (sigma(x + e) - sigma(x - e)) - (sigma(x + 2 * e) - sigma(x - 2 * e))) / (12 * h)).col(j);
  }
  return result;
}

} // namespace spherecut::tests
