#include "solvers/tearing.hpp"

#include "topology/errors.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

using namespace spherecut;
using namespace spherecut::solvers;

namespace {

/// Hoop stress at the angle t and a small radius, from the gradient of the exact field.
double hoop_stress(const Material& material, const Intensities& k, double t) {
  const Matrix3 gradient = tip_field(material, k, std::cos(t), std::sin(t)).gradient;
  const Matrix3 stress = material.lame_lambda() * gradient.trace() * Matrix3::Identity() +
                         material.shear_modulus() * (gradient + gradient.transpose());
  const Vector3 across(-std::sin(t), std::cos(t), 0);
  return across.dot(stress * across);
}

FrontState state_at(double along, double release, double angle = 0) {
  FrontState state;
  state.frame.point = {0, along, 0};
  state.frame.ahead = Vector3::UnitX();
  state.frame.normal = Vector3::UnitZ();
  state.frame.tangent = Vector3::UnitY();
  state.release = release;
  state.toughness = 2;
  state.angle = angle;
  return state;
}

} // namespace

TEST_CASE("A front kinks to where the hoop stress of its field is largest", "[tearing]") {
  const Material material{1000, 0.3, 0};
  constexpr double pi = std::numbers::pi;
  CHECK(kink_angle({1, 0, 0}) == 0);
  CHECK(kink_angle({1, 0, 5}) == 0);
  CHECK(-kink_angle({0, 1, 0}) * 180 / pi == Approx(70.5288).epsilon(1e-5));
  for (const double mix : {0.1, 0.4, 0.9, 1.3, 1.5})
    for (const double sign : {1.0, -1.0}) {
      const Intensities k(std::cos(mix), sign * std::sin(mix), 0.3);
      double best = 0, largest = -1e300;
      for (int i = -20000; i <= 20000; ++i)
        if (const double t = 0.999 * pi * i / 20000, stress = hoop_stress(material, k, t); stress > largest) {
          largest = stress;
          best = t;
        }
      CHECK(kink_angle(k) == Approx(best).margin(2e-4));
    }
  // Pressed faces do not open.
  CHECK(kink_angle({-3, 1, 0}) == Approx(kink_angle({0, 1, 0})));
  CHECK(driving_release_rate(material, {-3, 1, 2}) == Approx(energy_release_rate(material, {0, 1, 2})));
  CHECK(driving_release_rate(material, {3, 1, 2}) == Approx(energy_release_rate(material, {3, 1, 2})));
}

TEST_CASE("A front moves where the release reaches the toughness, most where it exceeds it most", "[tearing]") {
  const std::vector<FrontState> states{state_at(0, 1), state_at(1, 2), state_at(2, 3, 0.5), state_at(3, 4, 0.5)};
  const auto motion = tear_motion(states, 0.1, 0.01); // hardly smoothed
  const auto at = [&](int k) { return motion(states[static_cast<std::size_t>(k)].frame); };
  CHECK(at(0).norm() < 1e-15);
  CHECK((at(1) - Vector3(0.01, 0, 0)).norm() < 1e-12);
  CHECK((at(2) - 0.05 * Vector3(std::cos(0.5), 0, std::sin(0.5))).norm() < 1e-12);
  CHECK((at(3) - 0.1 * Vector3(std::cos(0.5), 0, std::sin(0.5))).norm() < 1e-12);
  // Smoothing spreads it evenly in the limit.
  const auto even = tear_motion(states, 0.1, 100);
  CHECK(even(states[0].frame).norm() == Approx(0.04).epsilon(1e-3));
  // All at the toughness: all move alike.
  const auto exact = tear_motion({state_at(0, 2), state_at(1, 2)}, 0.1, 0.01);
  CHECK(exact(states[0].frame).norm() == Approx(0.1));
  CHECK_THROWS_AS(tear_motion({}, 0.1, 1), InputError);
  CHECK_THROWS_AS(tear_motion(states, 0, 1), InputError);
}
