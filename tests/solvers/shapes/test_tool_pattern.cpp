// The paper's pattern of 34 nodes: its spheres at the tip, and its place on organs.
#include "solvers/shapes/functions.hpp"
#include "solvers/shapes/tool_pattern.hpp"
#include "topology/base/errors.hpp"
#include "topology/organ/organs.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

using namespace spherecut;
using namespace spherecut::solvers;
using Catch::Matchers::Contains;

namespace {

/// Nodes whose sphere holds the tip.
std::vector<int> tip_support(const std::vector<Vector3>& centres, const std::vector<double>& radii) {
  std::vector<int> support;
  for (int j = 0; j < std::ssize(centres); ++j)
    if ((centres[j] - centres[0]).norm() < radii[j])
      support.push_back(j);
  return support;
}

std::vector<double> radii_of(const NodeCloud& nodes) {
  std::vector<double> radii;
  for (double h : nodes.spacings)
    radii.push_back(pattern_support_radius * h);
  return radii;
}

void check_placed(const topology::Domain& domain, const NodeCloud& nodes, const Vector3& contact, double reach) {
  REQUIRE(nodes.size() == 34);
  CHECK((nodes.positions[0] - contact).norm() < 1e-9);
  const double tolerance = 1e-9 * domain.bounds().extent().norm();
  double closest = std::numeric_limits<double>::infinity(), shallowest = closest, farthest = 0, off_surface = 0;
  for (int i = 0; i < nodes.size(); ++i) {
    const double distance = domain.signed_distance(nodes.positions[i]);
    if (nodes.kinds[i] == NodeKind::interior)
      shallowest = std::min(shallowest, -distance);
    else {
      off_surface = std::max(off_surface, std::abs(distance));
      CHECK(nodes.normals[i].norm() == Approx(1));
    }
    farthest = std::max(farthest, (nodes.positions[i] - contact).norm());
    for (int j = 0; j < i; ++j)
      closest = std::min(closest, (nodes.positions[i] - nodes.positions[j]).norm());
  }
  CHECK(off_surface <= tolerance);
  CHECK(shallowest > 0.05 * reach);
  CHECK(closest > 0.1 * reach);
  CHECK(farthest < 1.2 * reach);

  // The spheres are sound as they are: none has to grow, and those of the outer shells end short of the tip.
  const std::vector<double> radii = radii_of(nodes);
  CHECK(tip_support(nodes.positions, radii) == std::vector<int>{0, 1, 2, 3, 4, 5});
  CHECK(moment_condition(nodes.positions, radii, nodes.positions[0], 0.32 * reach) < 3 * tip_condition_limit);
  const Spheres spheres(nodes.positions, nodes.spacings, pattern_support_radius);
  CHECK(spheres.grown() == 0);
  for (int i = 0; i < nodes.size(); ++i) {
    INFO("node " << i);
    CHECK(moment_condition(nodes.positions, radii, nodes.positions[i], nodes.spacings[i]) < 1e5);
  }
}

} // namespace

TEST_CASE("The pattern has 34 nodes in a half ball with the tip first") {
  const double reach = 0.04;
  const ToolPattern pattern = paper_pattern(reach);
  REQUIRE(pattern.size() == 34);
  REQUIRE(std::ssize(pattern.radii) == 34);
  REQUIRE(std::ssize(pattern.on_surface) == 34);
  REQUIRE(std::ssize(pattern.shells) == 34);
  CHECK(pattern.positions[0] == Vector3::Zero());
  CHECK(pattern.shells[0] == 0);
  CHECK(std::count(pattern.on_surface.begin(), pattern.on_surface.end(), true) == 21);
  for (int i = 0; i < 34; ++i) {
    CHECK(pattern.positions[i].norm() <= reach * (1 + 1e-12));
    CHECK((pattern.on_surface[i] ? pattern.positions[i].z() == 0 : pattern.positions[i].z() < -0.1 * reach));
    for (int j = 0; j < i; ++j)
      CHECK((pattern.positions[i] - pattern.positions[j]).norm() > 0.25 * reach);
  }
  CHECK_THROWS_AS(paper_pattern(0), InputError);
  CHECK_THROWS_AS(paper_pattern(std::nan("")), InputError);
}

TEST_CASE("Spheres reach the tip only as much as its moment matrix needs") {
  const double reach = 0.04, first = 0.32 * reach;
  const ToolPattern pattern = paper_pattern(reach);
  const std::vector<int> support = tip_support(pattern.positions, pattern.radii);
  CHECK(support == std::vector<int>{0, 1, 2, 3, 4, 5});
  const auto condition = [&](const std::vector<double>& radii) {
    return moment_condition(pattern.positions, radii, Vector3::Zero(), first);
  };
  CHECK(condition(pattern.radii) <= tip_condition_limit);
  CHECK(condition(pattern.radii) > 0.99 * tip_condition_limit);
  const auto scaled = [&](double factor) {
    std::vector<double> radii = pattern.radii;
    for (int i = 0; i < pattern.size(); ++i)
      if (pattern.shells[i] == 1)
        radii[i] *= factor;
    return radii;
  };
  CHECK(condition(scaled(0.99)) > tip_condition_limit);
  CHECK(std::isinf(condition(scaled(0.85)))); // short of the tip
  std::vector<double> without_lower = pattern.radii;
  without_lower[5] = 1e-6;
  REQUIRE(pattern.positions[5].z() < 0);
  CHECK(std::isinf(condition(without_lower)));

  // The tip's shape function is nearly 1 at the tip.
  std::vector<double> spacings;
  for (double r : pattern.radii)
    spacings.push_back(r / pattern_support_radius);
  const Spheres spheres(pattern.positions, spacings, pattern_support_radius);
  CHECK(spheres.grown() == 0);
  ShapeFunctions shape;
  REQUIRE(evaluate(spheres, Vector3::Zero(), shape));
  REQUIRE(shape.size() == 6);
  for (int k = 0; k < shape.size(); ++k)
    CHECK(shape.value[k] == Approx(shape.nodes[k] == 0 ? 1 : 0).margin(0.02));
}

TEST_CASE("The pattern fits a box, a half ball and a cylinder") {
  const auto box = topology::make_box_domain({-0.1, -0.1, -0.1}, {0.1, 0.1, 0}, 0.05);
  const ToolPattern pattern = paper_pattern(0.04);
  const NodeCloud on_box = place(pattern, *box, {0.01, 0.02, 0}, Vector3::UnitZ());
  check_placed(*box, on_box, {0.01, 0.02, 0}, 0.04);
  for (int i = 0; i < 34; ++i) // far from the edges the box is a half-space: the pattern itself
    CHECK((on_box.positions[i] - Vector3(0.01, 0.02, 0) - pattern.positions[i]).norm() < 1e-12);

  const auto hemisphere = topology::make_hemisphere_domain(0.1, 0.01);
  for (double angle : {0.0, 0.4, 0.8}) {
    const Vector3 n(std::sin(angle), 0, std::cos(angle));
    for (double reach : {0.02, 0.05}) {
      INFO("polar angle " << angle << ", reach " << reach);
      check_placed(*hemisphere, place(paper_pattern(reach), *hemisphere, 0.1 * n, n), 0.1 * n, reach);
    }
  }
  const auto cylinder = topology::make_cylinder_domain(0.05, 0.2, 0.01);
  check_placed(*cylinder, place(paper_pattern(0.03), *cylinder, {0, -0.05, 0.1}, -Vector3::UnitY()), {0, -0.05, 0.1},
               0.03);
}

TEST_CASE("The pattern bends around an edge of a box and fits an organ's triangles") {
  const auto box = topology::make_box_domain({-0.1, -0.1, -0.1}, {0.1, 0.1, 0}, 0.05);
  const ToolPattern pattern = paper_pattern(0.04);
  for (double x : {0.07, 0.08, 0.09}) {
    INFO("contact at x = " << x);
    check_placed(*box, place(pattern, *box, {x, 0, 0}, Vector3::UnitZ()), {x, 0, 0}, 0.04);
  }
  const auto organ = topology::make_organ_domain(topology::make_hemisphere(0.1, 0.008), 0.004);
  const Vector3 contact = organ->closest_surface_point({0.03, 0.02, 0.11});
  const Vector3 normal = organ->normal(contact);
  const NodeCloud nodes = place(pattern, *organ, contact, normal);
  check_placed(*organ, nodes, contact, 0.04);
  const NodeCloud again = place(pattern, *organ, contact, normal);
  for (int i = 0; i < nodes.size(); ++i)
    CHECK((nodes.positions[i] == again.positions[i] && nodes.spacings[i] == again.spacings[i]));
}

TEST_CASE("A pattern that does not fit is refused") {
  const auto plate = topology::make_box_domain({-0.1, -0.1, -0.004}, {0.1, 0.1, 0}, 0.05);
  CHECK_THROWS_AS(place(paper_pattern(0.04), *plate, Vector3::Zero(), Vector3::UnitZ()), InputError);
  CHECK_THROWS_WITH(place(paper_pattern(0.04), *plate, Vector3::Zero(), Vector3::UnitZ()), Contains("smaller reach"));
  const auto box = topology::make_box_domain({-0.1, -0.1, -0.1}, {0.1, 0.1, 0}, 0.05);
  CHECK_THROWS_WITH(place(paper_pattern(0.04), *box, {0, 0, 0.05}, Vector3::UnitZ()), Contains("from the surface"));
  CHECK_THROWS_WITH(place(paper_pattern(0.04), *box, Vector3::Zero(), Vector3(0, 0, 2)), Contains("unit vector"));
}
