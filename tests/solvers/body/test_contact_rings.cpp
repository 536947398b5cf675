#include "solvers/body/contact_rings.hpp"

#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <numbers>

using namespace spherecut;
using solvers::contact_rings;
using solvers::SeedNode;

namespace {

double axis_distance(const Vector3& x, const Vector3& centre, const Vector3& normal) {
  const Vector3 arm = x - centre;
  return (arm - arm.dot(normal) * normal).norm();
}

/// Checks centre, two rings at exact radii, on the surface, with even steps of about the spacing.
void check_rings(const topology::Domain& domain, const Vector3& centre, const Vector3& normal, double radius,
                 double spacing, double offset) {
  const std::vector<SeedNode> seeds = contact_rings(domain, centre, normal, radius, spacing, offset);
  CHECK(seeds.front().position == centre);
  std::array<std::vector<Vector3>, 2> rings;
  for (std::size_t k = 1; k < seeds.size(); ++k) {
    const double r = axis_distance(seeds[k].position, centre, normal);
    CHECK(std::abs(domain.signed_distance(seeds[k].position)) < 1e-11 * radius);
    CHECK(seeds[k].kind == solvers::NodeKind::surface);
    rings[r < radius ? 0 : 1].push_back(seeds[k].position);
  }
  for (int ring : {0, 1}) {
    const double expected = radius + (ring == 0 ? -offset : offset) * spacing;
    REQUIRE(rings[ring].size() >= 3);
    for (std::size_t k = 0; k < rings[ring].size(); ++k) {
      const Vector3& x = rings[ring][k];
      CHECK(axis_distance(x, centre, normal) == Approx(expected).epsilon(1e-12));
      const Vector3 step = rings[ring][(k + 1) % rings[ring].size()] - x;
      CHECK((step - step.dot(normal) * normal).norm() ==
            Approx(2 * expected * std::sin(std::numbers::pi / rings[ring].size())).epsilon(1e-9));
    }
    CHECK(2 * std::numbers::pi * expected / rings[ring].size() == Approx(spacing).epsilon(0.2));
  }
}

} // namespace

TEST_CASE("Contact rings have exact radii on a plane and on a half ball") {
  const auto box = topology::make_box_domain(Vector3(-1, -1, -1), Vector3(1, 1, 0.3), 0.5);
  const auto half_ball = topology::make_hemisphere_domain(0.05, 0.01);
  for (double offset : {0.25, 0.4}) {
    check_rings(*box, {0.1, -0.2, 0.3}, Vector3::UnitZ(), 0.3, 0.05, offset);
    check_rings(*box, {1, 0.2, -0.3}, Vector3::UnitX(), 0.3, 0.1, offset);
    check_rings(*half_ball, {0, 0, 0.05}, Vector3::UnitZ(), 0.0125, 0.003, offset);
    const Vector3 aside = Vector3(1, 2, 3).normalized();
    check_rings(*half_ball, 0.05 * aside, aside, 0.01, 0.002, offset);
  }
}

TEST_CASE("An inner ring that would crowd the centre is left out") {
  const auto box = topology::make_box_domain(Vector3(-1, -1, -1), Vector3(1, 1, 0), 0.5);
  const std::vector<SeedNode> seeds = contact_rings(*box, Vector3::Zero(), Vector3::UnitZ(), 0.1, 0.2, 0.4);
  for (std::size_t k = 1; k < seeds.size(); ++k)
    CHECK(seeds[k].position.norm() == Approx(0.18));
}

TEST_CASE("Contact rings that reach over an edge, and sizes that make no sense, are refused") {
  const auto box = topology::make_box_domain(Vector3(-1, -1, -1), Vector3(1, 1, 0), 0.5);
  const auto half_ball = topology::make_hemisphere_domain(0.05, 0.01);
  CHECK_THROWS_AS(contact_rings(*half_ball, {0, 0, 0.05}, Vector3::UnitZ(), 0.06, 0.005, 0.25), InputError);
  CHECK_THROWS_AS(contact_rings(*box, {0.95, 0, 0}, Vector3::UnitZ(), 0.2, 0.05, 0.25), InputError);
  for (const Vector3& sizes : {Vector3(0, 1, 1), Vector3(1, -1, 1), Vector3(1, 1, 0)})
    CHECK_THROWS_AS(contact_rings(*box, Vector3::Zero(), Vector3::UnitZ(), sizes[0], sizes[1], sizes[2]), InputError);
}

TEST_CASE("Edge spacing is finest on the contact edge and grows at the given slope") {
  const Vector3 centre(0.01, 0.02, 0.03), normal = Vector3(1, 1, 2).normalized();
  const solvers::SpacingField spacing = solvers::edge_spacing(centre, normal, 0.02, 0.001, 0.01, 0.3);
  const Vector3 tangent = normal.unitOrthogonal();
  const Vector3 edge = centre + 0.02 * tangent;
  CHECK(spacing(edge) == Approx(0.001).epsilon(0.01));
  CHECK(spacing(edge - 0.008 * normal) == Approx(0.001 + 0.3 * (0.008 - 0.0015)).epsilon(0.05));
  CHECK(spacing(centre) == Approx(0.001 + 0.3 * (0.02 - 0.0015)).epsilon(0.01));
  CHECK(spacing(centre + Vector3(1, 0, 0)) == 0.01);
  for (const Vector3& c : spacing.centres) {
    CHECK(axis_distance(c, centre, normal) == Approx(0.02));
    CHECK(std::abs((c - centre).dot(normal)) < 1e-15);
  }
}
