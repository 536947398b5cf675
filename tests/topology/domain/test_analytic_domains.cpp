#include "topology/domain/domain.hpp"

#include "tests/support/mesh_checks.hpp"
#include "tests/support/mesh_oracles.hpp"
#include "topology/base/errors.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <string>

using namespace spherecut;
using namespace spherecut::topology;
using spherecut::tests::brute_force_distance;
using spherecut::tests::inside_by_winding;
using spherecut::tests::random_point;

namespace {

struct DomainCase {
  std::string name;
  std::shared_ptr<const Domain> domain;
};

std::vector<DomainCase> domain_cases() {
  Matrix3 axes;
  axes << 2.0 / 3, -2.0 / 3, 1.0 / 3, 2.0 / 3, 1.0 / 3, -2.0 / 3, 1.0 / 3, 2.0 / 3, 2.0 / 3;
  return {{"box", make_box_domain(Vector3(-0.03, 0.01, -0.02), Vector3(0.05, 0.06, 0.04), 0.004)},
          {"hemisphere", make_hemisphere_domain(0.05, 0.003)},
          {"cylinder", make_cylinder_domain(0.04, 0.06, 0.003)},
          {"turned box", make_turned_box_domain({0.01, -0.02, 0.03}, axes, {0.05, 0.03, 0.04}, 0.004)}};
}

} // namespace

TEST_CASE("Analytic domains agree in distance and sign with their own fine tessellation", "[domain]") {
  for (const auto& [name, domain] : domain_cases()) {
    INFO(name);
    std::mt19937 random(7);
    for (int i = 0; i < 60; ++i) {
      const Vector3 x = random_point(domain->bounds(), random);
      INFO(x.transpose());
      const double d = domain->signed_distance(x);
      // Chord error of 3 mm edges on radii of 40 mm and more: below edge^2 / (6 R).
      CHECK(std::abs(d) == Approx(brute_force_distance(domain->surface(), x)).margin(5e-5));
      if (std::abs(d) > 5e-5)
        CHECK((d < 0) == inside_by_winding(domain->surface(), x));
    }
  }
}

TEST_CASE("Analytic domains: closest point, distance, normal and gradient are one consistent field", "[domain]") {
  for (const auto& [name, domain] : domain_cases()) {
    INFO(name);
    std::mt19937 random(11);
    for (int i = 0; i < 500; ++i) {
      const Vector3 x = random_point(domain->bounds(), random);
      INFO(x.transpose());
      const double d = domain->signed_distance(x);
      const Vector3 p = domain->closest_surface_point(x), n = domain->normal(x);
      CHECK((x - p).norm() == Approx(std::abs(d)).margin(1e-15));
      CHECK(std::abs(domain->signed_distance(p)) < 1e-15);
      CHECK(n.norm() == Approx(1).epsilon(1e-13));
      CHECK((p + d * n - x).norm() < 1e-15);

      // Away from the medial axis, where the closest point jumps, the normal is the gradient.
      const double h = 1e-7;
      Vector3 difference;
      bool smooth = true;
      for (int k = 0; k < 3; ++k) {
        const Vector3 step = h * Vector3::Unit(k);
        difference[k] = (domain->signed_distance(x + step) - domain->signed_distance(x - step)) / (2 * h);
        smooth =
            smooth && (domain->closest_surface_point(x + step) - domain->closest_surface_point(x - step)).norm() < 1e-5;
      }
      if (smooth)
        CHECK((difference - n).norm() < 1e-5);
    }
  }
}

TEST_CASE("Analytic domains are the intersection of their planes and curved part", "[domain]") {
  for (const auto& [name, domain] : domain_cases()) {
    INFO(name);
    std::mt19937 random(13);
    for (int i = 0; i < 500; ++i) {
      const Vector3 x = random_point(domain->bounds(), random);
      double greatest = domain->curved_distance(x);
      for (const Plane& plane : domain->planes()) {
        CHECK(plane.normal.norm() == 1);
        greatest = std::max(greatest, plane.signed_distance(x));
      }
      const double d = domain->signed_distance(x);
      CHECK((greatest < 0) == (d < 0));
      if (d < 0)
        CHECK(greatest == Approx(d).margin(1e-15));
      if (std::isfinite(domain->curved_distance(x))) {
        const double h = 1e-7;
        Vector3 difference;
        for (int k = 0; k < 3; ++k)
          difference[k] =
              (domain->curved_distance(x + h * Vector3::Unit(k)) - domain->curved_distance(x - h * Vector3::Unit(k))) /
              (2 * h);
        CHECK((difference - domain->curved_gradient(x)).norm() < 1e-5);
      }
    }
  }
  CHECK(domain_cases()[0].domain->planes().size() == 6);
  CHECK(domain_cases()[1].domain->planes().size() == 1);
  CHECK(domain_cases()[2].domain->planes().size() == 2);
}

TEST_CASE("Analytic domains carry a closed tessellation whose vertices lie on the surface", "[domain]") {
  for (const auto& [name, domain] : domain_cases()) {
    INFO(name);
    tests::require_closed_sphere(domain->surface());
    for (const Vector3& v : domain->surface().vertices)
      REQUIRE(std::abs(domain->signed_distance(v)) < 1e-15);
    CHECK(domain->bounds().extent().minCoeff() > 0.04);
  }
}

TEST_CASE("Analytic domains give finite normals at centres, corners, rims and on the surface", "[domain]") {
  for (const auto& [name, domain] : domain_cases()) {
    INFO(name);
    std::vector<Vector3> awkward = domain->surface().vertices;
    awkward.push_back(Vector3::Zero());
    awkward.push_back(domain->bounds().centre());
    awkward.push_back(domain->bounds().upper);
    awkward.push_back(domain->bounds().lower);
    awkward.emplace_back(0.04, 0, -1e-200);
    for (const Vector3& x : awkward) {
      INFO(x.transpose());
      CHECK(domain->normal(x).norm() == Approx(1));
      CHECK(domain->closest_surface_point(x).allFinite());
      CHECK(domain->curved_gradient(x).allFinite());
    }
  }
}

TEST_CASE("The box distance outside an edge and a corner is Euclidean", "[domain]") {
  const auto box = make_box_domain(Vector3::Zero(), Vector3::Ones(), 0.5);
  CHECK(box->signed_distance(Vector3(1.3, 1.4, 0.5)) == Approx(0.5));
  CHECK(box->signed_distance(Vector3(-1, -2, -2)) == Approx(3));
  CHECK(box->signed_distance(Vector3(0.5, 0.5, 0.9)) == Approx(-0.1));
  CHECK_THROWS_AS(make_box_domain(Vector3::Ones(), Vector3::Zero(), 0.5), InputError);
}
