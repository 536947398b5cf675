#include "experiments/analytic/half_space.hpp"
#include "experiments/analytic/manufactured.hpp"

#include "solvers/contact/half_space.hpp"
#include "tests/support/finite_differences.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <numbers>

using namespace spherecut;
using namespace spherecut::experiments;
using solvers::Material;
using std::numbers::pi;

namespace {

/// Depth of the surface at (r, 0, 0) under an axisymmetric pressure on a disc, by adding up point forces. The pressure
/// is sampled at s = a sin t, which takes the square-root singularity of a punch's pressure out of the integral.
double depth_under(const Material& material, double a, const std::function<double(double)>& pressure, double r) {
  const int rings = 200, sectors = 200;
  const Vector3 down = -Vector3::UnitZ();
  double depth = 0;
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < sectors; ++j) {
      const double t = pi / 2 * (i + 0.5) / rings, angle = 2 * pi * (j + 0.5) / sectors, s = a * std::sin(t);
      const double area = s * a * std::cos(t) * (pi / 2 / rings) * (2 * pi / sectors);
      const Vector3 origin(s * std::cos(angle), s * std::sin(angle), 0);
      depth -= half_space_displacement(material, pressure(s) * area * down, origin, down, Vector3(r, 0, 0)).z();
    }
  return depth;
}

double total_force(double a, const std::function<double(double)>& pressure) {
  const int rings = 4000;
  double force = 0;
  for (int i = 0; i < rings; ++i) {
    const double t = pi / 2 * (i + 0.5) / rings, s = a * std::sin(t);
    force += pressure(s) * 2 * pi * s * a * std::cos(t) * (pi / 2 / rings);
  }
  return force;
}

} // namespace

TEST_CASE("The pressure of a flat punch makes its force and its profile") {
  const double a = 0.7, d = 0.03;
  for (double nu : {0.0, 0.3, 0.49}) {
    const Material material{5.0, nu, 0};
    const auto pressure = [&](double s) { return flat_punch_pressure(material, a, d, s); };
    CHECK(total_force(a, pressure) == Approx(flat_punch_force(material, a, d)).epsilon(1e-6));
    for (double r : {1.1 * a, 1.5 * a, 3 * a})
      CHECK(depth_under(material, a, pressure, r) == Approx(flat_punch_profile(a, d, r)).epsilon(1e-4));
    // At the centre the kernel's 1/s meets the ring's s: half a point of singular area is lost.
    CHECK(depth_under(material, a, pressure, 0) == Approx(flat_punch_profile(a, d, 0)).epsilon(1e-3));
  }
  CHECK(flat_punch_profile(a, d, a) == d);
  CHECK(flat_punch_profile(a, d, a * (1 + 1e-12)) == Approx(d).epsilon(1e-5));
}

TEST_CASE("The pressure of a sphere makes its force and its profile") {
  const double R = 2.0, d = 0.02;
  for (double nu : {0.0, 0.3, 0.49}) {
    const Material material{5.0, nu, 0};
    const HertzContact contact = hertz_contact(material, R, d);
    const double a = contact.radius;
    const auto pressure = [&](double s) { return contact.peak_pressure * std::sqrt(1 - s * s / (a * a)); };
    CHECK(total_force(a, pressure) == Approx(contact.force).epsilon(1e-6));
    for (double r : {1.1 * a, 1.5 * a, 3 * a})
      CHECK(depth_under(material, a, pressure, r) == Approx(hertz_profile(R, d, r)).epsilon(1e-4));
    CHECK(depth_under(material, a, pressure, 0) == Approx(hertz_profile(R, d, 0)).epsilon(1e-3));
    CHECK(hertz_profile(R, d, a * (1 - 1e-9)) == Approx(hertz_profile(R, d, a * (1 + 1e-9))));
    // The surface leaves the sphere with no kink.
    const double h = 1e-5 * a;
    CHECK((hertz_profile(R, d, a + h) - hertz_profile(R, d, a)) / h == Approx(-a / R).epsilon(1e-2));
  }
}

TEST_CASE("A sphere's force is the work of its depth: dW/dd = F grows as 2 E* a") {
  // Any axisymmetric indenter: dF/dd = 2 E* a, the stiffness of a flat punch as wide as the contact.
  const Material material{3.0, 0.4, 0};
  const double R = 1.3, d = 0.05, h = 1e-6;
  const double stiffness =
      (hertz_contact(material, R, d + h).force - hertz_contact(material, R, d - h).force) / (2 * h);
  CHECK(stiffness == Approx(flat_punch_force(material, hertz_contact(material, R, d).radius, 1)).epsilon(1e-6));
}

TEST_CASE("A bonded punch is stiffer by the known factors") {
  CHECK(bonded_punch_factor(0) == Approx(std::log(3)));
  CHECK(bonded_punch_factor(0.3) == Approx(1.0286).epsilon(1e-4));
  CHECK(bonded_punch_factor(0.499999) == Approx(1).epsilon(1e-5));
  CHECK(bonded_punch_factor(0.5) == 1);
  CHECK_THROWS_AS(bonded_punch_factor(0.6), InputError);
}

TEST_CASE("Contacts refuse lengths without meaning") {
  const Material material{1, 0.3, 0};
  CHECK_THROWS_AS(flat_punch_force(material, 0, 1), InputError);
  CHECK_THROWS_AS(flat_punch_force(material, 1, -1), InputError);
  CHECK_THROWS_AS(hertz_contact(material, NAN, 1), InputError);
  CHECK_THROWS_AS(hertz_contact(Material{1, 0.5, 0}, 1, 1), InputError);
}

TEST_CASE("Manufactured fields balance their own loads") {
  for (double nu : {0.0, 0.3, 0.45, 0.49, 0.499}) {
    const Material material{10.0, nu, 0};
    for (const ManufacturedField& field : {smooth_field(material), smooth_field(material, 3), linear_field(material)}) {
      const auto u = [&](const Vector3& x) { return field.displacement(x); };
      for (const Vector3& x : {Vector3(0.2, 0.7, 0.4), Vector3(0.9, 0.1, 0.6)}) {
        const Matrix3 g = field.gradient(x);
        CHECK((tests::gradient(u, x, 1e-3) - g).norm() < 1e-9 * g.norm());
        CHECK((tests::stress(material, g) - field.stress(x)).norm() < 1e-11 * field.stress(x).norm());
        const Vector3 b = field.body_force(x);
        CHECK((tests::stress_divergence(material, u, x, 5e-3) + b).norm() < 1e-4 * (1 + b.norm()));
        const Vector3 n = Vector3(1, -2, 0.5).normalized();
        CHECK((field.traction(x, n) - field.stress(x) * n).norm() == 0);
      }
    }
  }
}

TEST_CASE("The smooth field keeps its pressure of the order of its shear stress up to nu = 0.4999") {
  for (double nu : {0.0, 0.3, 0.49, 0.4999}) {
    const ManufacturedField field = smooth_field(Material{1.0, nu, 0});
    double pressure = 0, deviator = 0;
    for (double x : {0.1, 0.5, 0.9})
      for (double y : {0.2, 0.6})
        for (double z : {0.3, 0.8}) {
          const Matrix3 sigma = field.stress(Vector3(x, y, z));
          const double mean = sigma.trace() / 3;
          pressure += mean * mean;
          deviator += (sigma - mean * Matrix3::Identity()).squaredNorm();
        }
    CHECK(std::sqrt(pressure / deviator) < 3);
    CHECK(std::sqrt(pressure / deviator) > 0.01);
  }
}

TEST_CASE("Manufactured loads are those of the field, and a seed names one field") {
  const Material material{10.0, 0.3, 0};
  const ManufacturedField field = smooth_field(material);
  const solvers::Loads loads = field.loads();
  const Vector3 x(0.3, 0.4, 0.5);
  CHECK(loads.body_force(x) == field.body_force(x));
  CHECK(loads.traction(x, Vector3::UnitX()) == field.traction(x, Vector3::UnitX()));
  CHECK_FALSE(linear_field(material).loads().body_force);
  CHECK(smooth_field(material, 5).displacement(x) == smooth_field(material, 5).displacement(x));
  CHECK(smooth_field(material, 5).displacement(x) != smooth_field(material, 6).displacement(x));
}
