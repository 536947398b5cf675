// The exact crack fields against the equations they solve.
#include "experiments/analytic/cracks.hpp"
#include "experiments/reference/lens.hpp"
#include "tests/support/finite_differences.hpp"
#include "topology/base/errors.hpp"

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

namespace {

/// Stress on the ellipse's upper face, from two heights over it at which the rule is fine enough.
Matrix3 stress_over(double a, double b, const std::function<Vector3(double, double)>& shape, double x, double y) {
  const auto u = [&](const Vector3& at) {
    return ellipse_jump_displacement(material, frame, a, b, shape, at, 150, 300);
  };
  const auto at = [&](double height) {
    return stress(material,
                  gradient(u, frame.origin + x * frame.ahead + y * frame.tangent + height * frame.normal, 2e-3));
  };
  return 2 * at(0.03) - at(0.06);
}

} // namespace

TEST_CASE("The elliptical crack carries its pressure, is a penny when round, and has the intensity of its opening") {
  const double a = 1, b = 0.4, p = 0.7;
  const Vector3 opening = ellipse_opening(material, a, b, p) * frame.normal;
  for (const auto& [x, y] : {std::pair(0.1, 0.05), std::pair(0.5, -0.1)}) {
    const Matrix3 sigma = stress_over(
        a, b, [&](double, double) { return opening; }, x, y);
    CHECK(frame.normal.dot(sigma * frame.normal) == Approx(-p).epsilon(0.03));
    CHECK(std::abs(frame.ahead.dot(sigma * frame.normal)) < 0.03 * p);
  }
  CHECK(ellipse_opening(material, 0.9, 0.9, p) == Approx(penny_opening(material, 0.9, p, 0)));
  CHECK(ellipse_intensity(0.9, 0.9, p, 0.3) == Approx(2 * p * std::sqrt(0.9 / std::numbers::pi)));
  CHECK(ellipse_intensity(25, 6, 1, std::numbers::pi / 2) / ellipse_intensity(25, 6, 1, 0) ==
        Approx(std::sqrt(25.0 / 6)));
  CHECK(ellipse_intensity(25, 6, 1, std::numbers::pi / 2) == Approx(4.0680).epsilon(1e-3)); // in print, MPa sqrt(mm)
  // At the ends of both axes the jump at the distance s is 8 (1 - nu^2) K sqrt(s / (2 pi)) / E.
  const double nu = material.poisson_ratio, s = 1e-6;
  for (const auto& [axis, t] : {std::pair(a, 0.0), std::pair(b, std::numbers::pi / 2)})
    CHECK(ellipse_opening(material, a, b, p) * std::sqrt(1 - std::pow(1 - s / axis, 2)) ==
          Approx(8 * (1 - nu * nu) * ellipse_intensity(a, b, p, t) * std::sqrt(s / (2 * std::numbers::pi)) /
                 material.young_modulus)
              .epsilon(1e-5));
}

TEST_CASE("The penny in torsion carries tau r / a around its axis and has the intensity of its turn") {
  const double a = 1.2, tau = 0.6, turn = torsion_turn(material, a, tau, 0);
  const auto shape = [&](double x, double y) -> Vector3 { return turn * (x * frame.tangent - y * frame.ahead); };
  for (const auto& [x, y] : {std::pair(0.5, 0.0), std::pair(-0.3, 0.6)}) {
    const Matrix3 sigma = stress_over(a, a, shape, x, y);
    const Vector3 pull = sigma * frame.normal, wanted = -tau / a * (x * frame.tangent - y * frame.ahead);
    CHECK((pull - wanted).norm() < 0.03 * wanted.norm());
  }
  const double s = 1e-6;
  CHECK(torsion_turn(material, a, tau, a - s) * (a - s) ==
        Approx(4 * torsion_intensity(a, tau) * std::sqrt(s / (2 * std::numbers::pi)) / material.shear_modulus())
            .epsilon(1e-5));
}

TEST_CASE("The cap's intensities by elements: the disc's when flat, settled, and a few per cent from those in print") {
  const solvers::Material cap{1, 0.22, 0};
  const double disc = 2 / std::sqrt(std::numbers::pi);
  const solvers::Intensities flat = lens_by_elements(cap, 0.01, 20);
  CHECK(flat[0] == Approx(disc).epsilon(2e-3));
  CHECK(std::abs(flat[1]) < 0.005 * disc);
  const double half = std::numbers::pi / 4;
  const solvers::Intensities coarse = lens_by_elements(cap, half, 20, 12), fine = lens_by_elements(cap, half, 20, 24);
  CHECK((coarse - fine).norm() < 2e-3 * fine.norm());
  CHECK((lens_by_elements(cap, half, 5) - fine).norm() < 1e-2 * fine.norm()); // held walls at five rim radii
  const solvers::Intensities printed = lens_intensities(std::numbers::sqrt2, 1);
  CHECK(fine[0] / printed[0] == Approx(1.014).epsilon(2e-3));
  CHECK(fine[1] / printed[1] == Approx(1.040).epsilon(4e-3));
  CHECK_THROWS_AS(lens_by_elements(cap, 0, 20), InputError);
  CHECK_THROWS_AS(lens_by_elements(cap, half, 1), InputError);
}
