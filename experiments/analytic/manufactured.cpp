#include "experiments/analytic/manufactured.hpp"

#include <cmath>
#include <random>

namespace spherecut::experiments {

namespace {

class NormalNumbers {
 public:
  explicit NormalNumbers(std::uint32_t seed) : generator_(seed) {}
  double number() { return distribution_(generator_); }
  Vector3 vector() {
    Vector3 v;
    for (int i = 2; i >= 0; --i)
      v[i] = number();
    return v;
  }

 private:
  std::mt19937 generator_;
  std::normal_distribution<double> distribution_;
};

} // namespace

Vector3 ManufacturedField::displacement(const Vector3& x) const {
  Vector3 u = offset + slope * x;
  for (const PlaneWave& w : waves)
    u += w.amplitude * std::sin(w.wave_vector.dot(x) + w.phase);
  return u;
}

Matrix3 ManufacturedField::gradient(const Vector3& x) const {
  Matrix3 g = slope;
  for (const PlaneWave& w : waves)
    g += w.amplitude * w.wave_vector.transpose() * std::cos(w.wave_vector.dot(x) + w.phase);
  return g;
}

Matrix3 ManufacturedField::stress(const Vector3& x) const {
  const Matrix3 g = gradient(x);
  return material.lame_lambda() * g.trace() * Matrix3::Identity() + material.shear_modulus() * (g + g.transpose());
}

Vector3 ManufacturedField::body_force(const Vector3& x) const {
  // Navier's equation, b = -(lambda + mu) grad div u - mu lap u, with grad -> k and sin'' = -sin.
  const double mu = material.shear_modulus(), lambda = material.lame_lambda();
  Vector3 b = Vector3::Zero();
  for (const PlaneWave& w : waves) {
    const Vector3& k = w.wave_vector;
    b += std::sin(k.dot(x) + w.phase) * (mu * k.squaredNorm() * w.amplitude + (lambda + mu) * k.dot(w.amplitude) * k);
  }
  return b;
}

Vector3 ManufacturedField::traction(const Vector3& x, const Vector3& normal) const {
  return stress(x) * normal;
}

solvers::Loads ManufacturedField::loads() const {
  solvers::Loads result;
  result.traction = [field = *this](const Vector3& x, const Vector3& n) { return field.traction(x, n); };
  if (!waves.empty())
    result.body_force = [field = *this](const Vector3& x) { return field.body_force(x); };
  return result;
}

ManufacturedField linear_field(const solvers::Material& material, std::uint32_t seed) {
  material.check();
  NormalNumbers random(seed);
  ManufacturedField field;
  field.material = material;
  field.offset = random.vector();
  for (int i = 0; i < 3; ++i)
    field.slope.col(i) = random.vector();
  return field;
}

ManufacturedField smooth_field(const solvers::Material& material, std::uint32_t seed) {
  material.check();
  NormalNumbers random(seed);
  ManufacturedField field;
  field.material = material;
  for (int i = 0; i < 4; ++i) {
    PlaneWave wave;
    const Vector3 direction = random.vector().normalized(), amplitude = random.vector();
    wave.wave_vector = (2.0 + 0.7 * i) * direction;
    const Vector3 longitudinal = direction * direction.dot(amplitude);
    wave.amplitude = amplitude - 2 * material.poisson_ratio * longitudinal;
    wave.phase = random.number();
    field.waves.push_back(wave);
  }
  return field;
}

} // namespace spherecut::experiments
