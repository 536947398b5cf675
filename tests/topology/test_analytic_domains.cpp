#include "topology/domain.hpp"

#include "tests/support/mesh_checks.hpp"
#include "topology/errors.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <string>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

struct Case {
  std::string name;
  std::shared_ptr<const Domain> domain;
};

std::vector<Case> cases() {
  return {{"box", make_box_domain(Vector3(-0.03, 0.01, -0.02), Vector3(0.05, 0.06, 0.04), 0.004)},
          {"hemisphere", make_hemisphere_domain(0.05, 0.003)},
          {"cylinder", make_cylinder_domain(0.04, 0.06, 0.003)}};
}

/// Closest point of one triangle to x [Ericson, Real-Time Collision Detection, sec. 5.1.5].
Vector3 closest_on_triangle(const Vector3& x, const Vector3& a, const Vector3& b, const Vector3& c) {
  const Vector3 ab = b - a, ac = c - a, ax = x - a, bx = x - b, cx = x - c;
  const double d1 = ab.dot(ax), d2 = ac.dot(ax), d3 = ab.dot(bx), d4 = ac.dot(bx), d5 = ab.dot(cx), d6 = ac.dot(cx);
  if (d1 <= 0 && d2 <= 0)
    return a;
  if (d3 >= 0 && d4 <= d3)
    return b;
  if (d6 >= 0 && d5 <= d6)
    return c;
  const double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4;
  if (vc <= 0 && d1 >= 0 && d3 <= 0)
    return a + d1 / (d1 - d3) * ab;
  if (vb <= 0 && d2 >= 0 && d6 <= 0)
    return a + d2 / (d2 - d6) * ac;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  return a + (vb * ab + vc * ac) / (va + vb + vc);
}

double brute_force_distance(const SurfaceMesh& mesh, const Vector3& x) {
  double best = std::numeric_limits<double>::infinity();
  for (const Triangle& t : mesh.triangles)
    best = std::min(
        best,
        (x - closest_on_triangle(x, mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]])).squaredNorm());
  return std::sqrt(best);
}

/// Inside test by winding number (sum of solid angles, van Oosterom and Strackee 1983).
bool inside_by_winding(const SurfaceMesh& mesh, const Vector3& x) {
  double angle = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vector3 a = mesh.vertices[t[0]] - x, b = mesh.vertices[t[1]] - x, c = mesh.vertices[t[2]] - x;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    angle += 2 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return angle > 6;
}

Vector3 random_point(const BoundingBox& box, std::mt19937& random) {
  std::uniform_real_distribution<double> unit(-0.3, 1.3);
  const Vector3 u(unit(random), unit(random), unit(random));
  return box.lower + u.cwiseProduct(box.extent());
}

} // namespace

TEST_CASE("Analytic domains agree in distance and sign with their own fine tessellation", "[domain]") {
  for (const auto& [name, domain] : cases()) {
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
  for (const auto& [name, domain] : cases()) {
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
  for (const auto& [name, domain] : cases()) {
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
  CHECK(cases()[0].domain->planes().size() == 6);
  CHECK(cases()[1].domain->planes().size() == 1);
  CHECK(cases()[2].domain->planes().size() == 2);
}

TEST_CASE("Analytic domains carry a closed tessellation whose vertices lie on the surface", "[domain]") {
  for (const auto& [name, domain] : cases()) {
    INFO(name);
    tests::require_closed_sphere(domain->surface());
    for (const Vector3& v : domain->surface().vertices)
      REQUIRE(std::abs(domain->signed_distance(v)) < 1e-15);
    CHECK(domain->bounds().extent().minCoeff() > 0.04);
  }
}

TEST_CASE("Analytic domains give finite normals at centres, corners, rims and on the surface", "[domain]") {
  for (const auto& [name, domain] : cases()) {
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
