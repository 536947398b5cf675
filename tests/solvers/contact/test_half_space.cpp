#include "solvers/contact/half_space.hpp"

#include "tests/support/finite_differences.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

using namespace spherecut;
using solvers::half_space_displacement;
using solvers::Material;

namespace {

const Vector3 origin(0.3, -0.2, 0.1);
const Vector3 inward = Vector3(0.3, -0.5, -0.8).normalized();
const Vector3 force(1.3, 0.4, -0.9); // neither normal nor tangential

tests::VectorField field(const Material& material) {
  return [material](const Vector3& x) { return half_space_displacement(material, force, origin, inward, x); };
}

/// Two unit tangents t1, t2 with t1 x t2 = inward.
std::pair<Vector3, Vector3> tangents() {
  const Vector3 t1 = inward.unitOrthogonal();
  return {t1, inward.cross(t1)};
}

} // namespace

TEST_CASE("A point force on a half-space leaves its inside in equilibrium") {
  for (double nu : {0.0, 0.3, 0.49}) {
    const Material material{1.0, nu, 0};
    for (const Vector3& r : {Vector3(0.4, 0.2, 0.9), Vector3(-0.7, 0.5, 0.4), Vector3(0.1, 0.02, 1.0)}) {
      const auto [t1, t2] = tangents();
      const Vector3 x = origin + r.x() * t1 + r.y() * t2 + r.z() * inward;
      CHECK(tests::stress_divergence(material, field(material), x, 2e-3).norm() < 2e-6);
    }
  }
}

TEST_CASE("A point force on a half-space leaves its surface free of traction") {
  for (double nu : {0.0, 0.3, 0.49}) {
    const Material material{2.0, nu, 0};
    const auto [t1, t2] = tangents();
    for (double angle : {0.1, 1.7, 3.0, 5.1}) {
      const Vector3 x = origin + 0.8 * (std::cos(angle) * t1 + std::sin(angle) * t2);
      const Matrix3 sigma = tests::stress(material, tests::gradient(field(material), x, 1e-3));
      CHECK((sigma * inward).norm() < 1e-7 * sigma.norm() + 1e-9);
    }
  }
}

TEST_CASE("Traction over a hemisphere about the point force adds up to the force") {
  const auto [t1, t2] = tangents();
  for (double nu : {0.0, 0.3, 0.49}) {
    const Material material{1.0, nu, 0};
    // Midpoint rule in depth and azimuth: the traction on the body outside the hemisphere is sigma (-radial).
    const int depths = 60, angles = 24;
    Vector3 total = Vector3::Zero();
    for (int i = 0; i < depths; ++i)
      for (int j = 0; j < angles; ++j) {
        const double c = (i + 0.5) / depths, s = std::sqrt(1 - c * c), a = 2 * std::numbers::pi * (j + 0.5) / angles;
        const Vector3 radial = c * inward + s * (std::cos(a) * t1 + std::sin(a) * t2);
        const Matrix3 sigma = tests::stress(material, tests::gradient(field(material), origin + 0.6 * radial, 1e-3));
        total -= sigma * radial * (0.36 * 2 * std::numbers::pi / (depths * angles));
      }
    CHECK((total - force).norm() < 2e-3 * force.norm());
  }
}

TEST_CASE("Normal and tangential point forces give the classic surface displacements") {
  const Material material{3.0, 0.3, 0};
  const double mu = material.shear_modulus(), r = 0.7, four_pi = 4 * std::numbers::pi;
  const Vector3 down = -Vector3::UnitZ(), x(r, 0, 0);
  const Vector3 normal = half_space_displacement(material, 2 * down, Vector3::Zero(), down, x);
  CHECK(normal.z() == Approx(-2 * 2 * (1 - 0.3) / (four_pi * mu * r)));
  CHECK(normal.x() == Approx(-2 * (1 - 0.6) / (four_pi * mu * r))); // the surface is drawn towards the force
  const Vector3 tangential = half_space_displacement(material, Vector3::UnitX(), Vector3::Zero(), down, x);
  CHECK(tangential.x() == Approx(2 / (four_pi * mu * r)));
  CHECK(tangential.z() == Approx(-(1 - 0.6) / (four_pi * mu * r))); // ahead of the force the surface sinks in
}

TEST_CASE("A point force on a half-space is reciprocal between surface points") {
  // Maxwell-Betti: u(A from f at B) . g = u(B from g at A) . f.
  const Material material{1.0, 0.2, 0};
  const auto [t1, t2] = tangents();
  const Vector3 other = origin + 0.3 * t1 - 0.6 * t2, g(-0.2, 0.8, 0.5);
  CHECK(half_space_displacement(material, force, origin, inward, other).dot(g) ==
        Approx(half_space_displacement(material, g, other, inward, origin).dot(force)).epsilon(1e-12));
}

TEST_CASE("A half-space refuses points and normals it cannot serve") {
  const Material material{1.0, 0.3, 0};
  CHECK_THROWS_AS(half_space_displacement(material, force, origin, inward, origin), InputError);
  CHECK_THROWS_AS(half_space_displacement(material, force, origin, 2 * inward, Vector3::Zero()), InputError);
  CHECK_THROWS_AS(half_space_displacement(material, force, origin, inward, origin - inward), InputError);
  CHECK_THROWS_AS(half_space_displacement(Material{-1, 0.3, 0}, force, origin, inward, Vector3::Zero()), InputError);
}
