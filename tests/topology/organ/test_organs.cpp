#include "topology/organ/organs.hpp"

#include "tests/support/mesh_checks.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

using namespace spherecut;
using namespace spherecut::topology;
using spherecut::tests::angle_range;
using spherecut::tests::require_closed_sphere;

namespace {

double mean_edge(const SurfaceMesh& mesh) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles)
    for (int e = 0; e < 3; ++e)
      sum += (mesh.vertices[t[e]] - mesh.vertices[t[(e + 1) % 3]]).norm();
  return sum / (3.0 * static_cast<double>(mesh.triangles.size()));
}

} // namespace

TEST_CASE("A block has the exact volume and area and stands on z = 0", "[organs]") {
  const SurfaceMesh mesh = make_block(Vector3(0.1, 0.06, 0.04), 0.011);
  require_closed_sphere(mesh);
  CHECK(volume(mesh) == Approx(0.1 * 0.06 * 0.04).epsilon(1e-12));
  CHECK(area(mesh) == Approx(2 * (0.1 * 0.06 + 0.06 * 0.04 + 0.04 * 0.1)).epsilon(1e-12));
  CHECK(bounds(mesh).lower == Vector3(-0.05, -0.03, 0));
  CHECK(bounds(mesh).upper == Vector3(0.05, 0.03, 0.04));
  CHECK(angle_range(mesh).smallest >= 35);
}

TEST_CASE("A block coarser than itself is a cube of twelve triangles", "[organs]") {
  const SurfaceMesh mesh = make_block(Vector3(1, 1, 1), 10);
  require_closed_sphere(mesh);
  CHECK(mesh.triangles.size() == 12);
  CHECK(volume(mesh) == Approx(1));
}

TEST_CASE("A cylinder's volume and area converge with the square of the edge", "[organs]") {
  const double radius = 0.04, height = 0.07;
  const double exact_volume = std::numbers::pi * radius * radius * height,
               exact_area = 2 * std::numbers::pi * radius * (radius + height);
  double last_volume_error = 0, last_area_error = 0;
  for (const double edge : {0.02, 0.01, 0.005, 0.0025}) {
    const SurfaceMesh mesh = make_cylinder(radius, height, edge);
    require_closed_sphere(mesh);
    const double volume_error = 1 - volume(mesh) / exact_volume, area_error = 1 - area(mesh) / exact_area;
    CHECK(volume_error > 0);
    if (last_volume_error > 0) {
      CHECK(last_volume_error / volume_error == Approx(4).epsilon(0.3));
      CHECK(last_area_error / area_error == Approx(4).epsilon(0.3));
    }
    last_volume_error = volume_error;
    last_area_error = area_error;
    CHECK(angle_range(mesh).smallest > 30);
    CHECK(mean_edge(mesh) == Approx(edge).epsilon(0.25));
    for (const Vector3& v : mesh.vertices) {
      const double rho = std::hypot(v.x(), v.y());
      const bool on_side = std::abs(rho - radius) < 1e-15, on_cap = v.z() == 0 || v.z() == height;
      REQUIRE((on_side || on_cap));
    }
  }
  CHECK(last_volume_error < 1.5e-3);
}

TEST_CASE("A hemisphere's volume and area converge with the square of the edge", "[organs]") {
  const double radius = 0.05;
  const double exact_volume = 2 * std::numbers::pi / 3 * std::pow(radius, 3),
               exact_area = 3 * std::numbers::pi * radius * radius;
  double last_volume_error = 0, last_area_error = 0;
  for (const double edge : {0.016, 0.008, 0.004, 0.002}) {
    const SurfaceMesh mesh = make_hemisphere(radius, edge);
    require_closed_sphere(mesh);
    const double volume_error = 1 - volume(mesh) / exact_volume, area_error = 1 - area(mesh) / exact_area;
    CHECK(volume_error > 0);
    if (last_volume_error > 0) {
      CHECK(last_volume_error / volume_error == Approx(4).epsilon(0.3));
      CHECK(last_area_error / area_error == Approx(4).epsilon(0.3));
    }
    last_volume_error = volume_error;
    last_area_error = area_error;
    CHECK(angle_range(mesh).smallest > 30);
    CHECK(mean_edge(mesh) == Approx(edge).epsilon(0.25));
    bool has_pole = false;
    int rim = 0;
    for (const Vector3& v : mesh.vertices) {
      REQUIRE((v.z() == 0 || std::abs(v.norm() - radius) < 1e-15));
      has_pole = has_pole || v == Vector3(0, 0, radius);
      rim += v.z() == 0 && std::abs(v.norm() - radius) < 1e-15;
    }
    CHECK(has_pole);
    CHECK(rim >= 6);
  }
  CHECK(last_volume_error < 1e-3);
}

TEST_CASE("Organs of impossible size are refused with the offending value", "[organs]") {
  CHECK_THROWS_AS(make_block(Vector3(0.1, -0.1, 0.1), 0.01), InputError);
  CHECK_THROWS_AS(make_block(Vector3(0.1, 0.1, 0.1), 0), InputError);
  CHECK_THROWS_AS(make_block(Vector3(0.1, 0.1, 0.1), 1e-7), InputError);
  CHECK_THROWS_AS(make_cylinder(0.1, 0, 0.01), InputError);
  CHECK_THROWS_AS(make_cylinder(std::numeric_limits<double>::quiet_NaN(), 1, 0.01), InputError);
  CHECK_THROWS_WITH(make_hemisphere(-0.25, 0.01), Catch::Contains("hemisphere radius") && Catch::Contains("-0.25"));
  CHECK_THROWS_AS(make_hemisphere(std::numeric_limits<double>::infinity(), 0.01), InputError);
}
