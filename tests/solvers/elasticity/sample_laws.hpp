// Laws and deformations that the tests of solvers/elasticity share.
#pragma once

#include "solvers/elasticity/law.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <random>

namespace spherecut::tests {

inline solvers::HolzapfelLaw sample_fibres(double dispersion) {
  return {.shear_modulus = 3e3,
          .fibre_modulus = 2.4e3,
          .fibre_exponent = 0.84,
          .dispersion = dispersion,
          .families = 2,
          .same_everywhere = true,
          .directions = {Vector3(1, 2, 0.5).normalized(), Vector3(2, -1, 1).normalized()}};
}

/// Every law, with nothing zero.
inline std::vector<solvers::LawSpec> sample_laws(double poisson_ratio) {
  using namespace solvers;
  const double mu = 3e3;
  const double bulk = bulk_modulus_of(mu, poisson_ratio);
  return {{LinearLaw{mu}, bulk, {}},
          {NeoHookeanLaw{mu}, bulk, {}},
          {YeohLaw{0.5 * mu, -0.02 * mu, 0.1 * mu}, bulk, {}},
          {OgdenLaw{{{0.4 * mu, 2.5}, {-0.2 * mu, -4}, {0.02 * mu, 10}}}, bulk, {}}, // 1/2 sum = mu
          {sample_fibres(0.1), bulk, {}},
          {sample_fibres(0), bulk, {}}};
}

/// I + size times numbers of a normal distribution, with det F above 0.2.
inline std::vector<Matrix3> sample_gradients(std::size_t count, double size, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Matrix3> all;
  while (all.size() < count) {
    const Matrix3 f = Matrix3::Identity() + size * Matrix3::NullaryExpr([&] { return normal(random); });
    if (f.determinant() > 0.2)
      all.push_back(f);
  }
  return all;
}

inline Matrix3 sample_rotation(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  return Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
      .normalized()
      .toRotationMatrix();
}

struct PointState {
  double energy = 0;
  Matrix3 stress = Matrix3::Zero();
};

inline PointState at(const solvers::Law& law, const Matrix3& f, bool volumetric = true) {
  PointState state;
  if (volumetric)
    law.evaluate({&f, 1}, {}, {&state.energy, 1}, {&state.stress, 1});
  else
    law.evaluate_isochoric({&f, 1}, {}, {&state.energy, 1}, {&state.stress, 1});
  return state;
}

} // namespace spherecut::tests
