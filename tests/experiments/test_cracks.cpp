// The exact crack fields against the equations they solve.
#include "experiments/analytic/cracks.hpp"
#include "tests/support/finite_differences.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

using namespace spherecut;
using namespace spherecut::experiments;
using spherecut::tests::gradient;
using spherecut::tests::stress;
using spherecut::tests::stress_divergence;

namespace {
const solvers::Material material{2.0, 0.3, 0};
const CutFrame frame = tilted_frame({0.1, -0.2, 0.3}, {0.3, -0.2, 0.15});
} // namespace

TEST_CASE("A cut's frame is right-handed as the front's is, and turns coordinates there and back") {
  CHECK((frame.normal.cross(frame.ahead) - frame.tangent).norm() < 1e-14);
  const Vector3 x(0.3, 1.2, -0.7);
  CHECK((frame.global(frame.local(x)) + frame.origin - x).norm() < 1e-14);
}

TEST_CASE("The three modes at a straight front are in equilibrium, with free faces and the gradients given") {
  for (int mode = 0; mode < 3; ++mode) {
    const solvers::Intensities k = Vector3::Unit(mode);
    const auto u = [&](const Vector3& x) { return straight_crack_displacement(material, frame, k, x); };
    for (const double angle : {-2.9, -1.2, 0.4, 1.9, 3.0}) {
      const double r = 0.7;
      const Vector3 x = frame.origin + r * std::cos(angle) * frame.ahead + r * std::sin(angle) * frame.normal;
      CHECK(stress_divergence(material, u, x, 1e-3).norm() < 1e-6);
      Matrix3 turn;
      turn << frame.ahead, frame.normal, frame.tangent;
      const auto tip = solvers::tip_field(material, k, r * std::cos(angle), r * std::sin(angle));
      CHECK((turn * tip.gradient * turn.transpose() - gradient(u, x, 1e-4)).norm() < 1e-8);
    }
    for (const double side : {1.0, -1.0}) {
      const auto tip = solvers::tip_field(material, k, -0.4, side * 1e-14);
      const Matrix3 sigma = stress(material, tip.gradient);
      CHECK(sigma.col(1).norm() < 1e-10);
    }
    // Ahead of the front the stress is K / sqrt(2 std::numbers::pi r) in the mode's own component.
    const auto tip = solvers::tip_field(material, k, 0.5, 0);
    const Matrix3 sigma = stress(material, tip.gradient);
    CHECK(sigma(mode == 0 ? 1 : mode == 1 ? 0 : 2, 1) == Approx(1 / std::sqrt(std::numbers::pi)).epsilon(1e-10));
  }
}

TEST_CASE("The pressurised penny is in equilibrium, carries the pressure and opens as an ellipsoid") {
  const double a = 1.3, p = 0.7;
  const auto u = [&](const Vector3& x) { return penny_displacement(material, frame, a, p, x); };
  for (const Vector3& at :
       {Vector3(0.4, 0.5, 0.3), Vector3(-1.5, 0.6, 0.9), Vector3(0.2, -0.8, -0.9), Vector3(2, -1, 0)}) {
    const Vector3 x = frame.origin + frame.global(at);
    CHECK(stress_divergence(material, u, x, 2e-3).norm() < 1e-5);
  }
  for (const double r : {0.2, 0.8, 1.1}) {
    const Vector3 x = frame.origin + r * frame.ahead;
    const Vector3 above = u(x + 1e-9 * frame.normal), below = u(x - 1e-9 * frame.normal);
    CHECK((above - below).dot(frame.normal) == Approx(penny_opening(material, a, p, r)).epsilon(1e-6));
    const Matrix3 sigma = stress(material, gradient(u, x + 0.01 * frame.normal, 2e-3));
    CHECK(frame.normal.dot(sigma * frame.normal) == Approx(-p).epsilon(0.02));
  }
  double volume = 0;
  for (int i = 0; i < 2000; ++i) {
    const double r = a * (i + 0.5) / 2000;
    volume += 2 * std::numbers::pi * r * a / 2000 * penny_opening(material, a, p, r);
  }
  CHECK(volume == Approx(penny_opening_volume(material, a, p)).epsilon(1e-4));
}

TEST_CASE("The field of a penny's jump is Sneddon's under pressure, and in equilibrium under shear") {
  const double a = 0.8;
  const Matrix3 pressure = 1.5 * frame.normal * frame.normal.transpose();
  const Matrix3 shear = frame.normal * frame.ahead.transpose() + frame.ahead * frame.normal.transpose();
  for (const Vector3& at : {Vector3(0.4, 0.5, 0.3), Vector3(-1.5, 0.6, 0.9), Vector3(0.2, -1.8, -0.9)}) {
    const Vector3 x = frame.origin + frame.global(at);
    const Vector3 exact = penny_displacement(material, frame, a, 1.5, x);
    CHECK((loaded_penny_displacement(material, frame, a, pressure, x) - exact).norm() < 1e-3 * exact.norm());
    const auto u = [&](const Vector3& y) { return loaded_penny_displacement(material, frame, a, shear, y); };
    CHECK(stress_divergence(material, u, x, 2e-3).norm() < 1e-5);
  }
  // Over the middle of the crack the shear is released, the less the farther from it.
  const auto u = [&](const Vector3& y) { return loaded_penny_displacement(material, frame, a, shear, y); };
  const Matrix3 sigma = stress(material, gradient(u, frame.origin + 0.25 * frame.normal, 1e-3));
  CHECK(frame.ahead.dot(sigma * frame.normal) < -0.35);
  CHECK(frame.ahead.dot(sigma * frame.normal) > -1);
}

TEST_CASE(
    "The tilted penny has the intensities of pressure and shear, and strips those of the half-plane at small cracks") {
  const double a = 0.9;
  const auto straight = tilted_penny_intensities(material, a, 2, 0, 1);
  CHECK(straight[0] == Approx(4 * std::sqrt(a / std::numbers::pi)));
  CHECK(straight.tail<2>().norm() < 1e-14);
  const auto ahead = tilted_penny_intensities(material, a, 2, 0.5, 0),
             beside = tilted_penny_intensities(material, a, 2, 0.5, std::numbers::pi / 2);
  CHECK(ahead[2] == Approx(0).margin(1e-14));
  CHECK(beside[1] == Approx(0).margin(1e-14));
  CHECK(std::abs(beside[2] / ahead[1]) == Approx(1 - material.poisson_ratio));
  CHECK(edge_notched_strip_intensity(3, 1e-4, 1) ==
        Approx(1.1215 * 3 * std::sqrt(std::numbers::pi * 1e-4)).epsilon(2e-3));
}
