// Rigid tools: signed distance, normal, pose, mesh.
#include "tests/support/mesh_checks.hpp"
#include "topology/base/errors.hpp"
#include "topology/tool/tool_outline.hpp"

#include <catch2/catch.hpp>
#include <limits>
#include <numbers>
#include <random>

namespace spherecut::topology {
namespace {

struct Case {
  const char* name;
  ToolShape shape;
  ToolPose pose;
  double reach; // m, half-width of the cube in which points are drawn
};

std::vector<Case> cases() {
  const Vector3 point(0.03, -0.02, 0.11), axis(0.3, -0.5, 0.8);
  std::vector<Case> all;
  const auto add = [&](const char* name, const ToolShape& shape, double reach) {
    all.push_back({name, shape, pose_at(shape, point, axis), reach});
  };
  add("sphere", SphereTip{0.007}, 0.02);
  add("punch", FlatPunch{0.006, 0.015}, 0.03);
  add("laparoscope", Laparoscope{0.006, 0.003, 0.02, Vector3(0.1, 0.05, 0.3)}, 0.04);
  return all;
}

Vector3 random_point(std::mt19937& random, const Vector3& centre, double reach) {
  std::uniform_real_distribution<double> coordinate(-reach, reach);
  const double x = coordinate(random), y = coordinate(random), z = coordinate(random);
  return centre + Vector3(x, y, z);
}

} // namespace

TEST_CASE("The outline of a tool in a plane lies on the tool, all around it") {
  for (const Case& c : cases()) {
    INFO(c.name);
    const Vector3 e1 = c.pose.axis.unitOrthogonal(), e2 = c.pose.axis;
    const Vector3 origin = c.pose.point + 0.001 * e1 - 0.002 * e2; // as a contact: on the end, or a little before it
    const double reach = 0.012;
    const auto outline = tool_outline(c.shape, c.pose, origin, e1, e2, reach);
    double lowest = 1, highest = -1, widest = 0, longest = 0;
    bool leaves = false;
    Vector3 before = Vector3::Zero();
    bool follows = false;
    for (const auto& [u, v] : outline) {
      if (std::isnan(u)) {
        leaves = true;
        follows = false;
        continue;
      }
      const Vector3 x = origin + u * e1 + v * e2;
      CHECK(std::abs(tool_distance(c.shape, c.pose, x)) < 1e-9);
      CHECK(std::hypot(u, v) <= reach);
      lowest = std::min(lowest, v);
      highest = std::max(highest, v);
      widest = std::max(widest, std::abs((x - c.pose.point).dot(e1)));
      if (follows)
        longest = std::max(longest, (x - before).norm());
      before = x;
      follows = true;
    }
    CHECK(lowest == Approx(0.002).margin(1e-9)); // the plane holds the axis, so also the tip's deepest point
    CHECK(widest == Approx(tip_radius(c.shape)).epsilon(1e-3));
    CHECK(longest < 0.004 * reach); // no stairs
    CHECK(leaves);
    CHECK(highest > 0.8 * reach);
  }
  // A ball as a whole is a circle; a plane beside it meets nothing.
  const SphereTip ball{0.007};
  const ToolPose pose = pose_at(ball, Vector3::Zero());
  const auto circle = tool_outline(ball, pose, {0, 0.003, 0}, Vector3::UnitX(), Vector3::UnitZ(), 0.1);
  CHECK(circle.size() > 1000);
  CHECK(circle.front() == circle.back());
  for (const auto& [u, v] : circle)
    CHECK(std::hypot(u, v - 0.007) == Approx(std::sqrt(0.007 * 0.007 - 0.003 * 0.003)).epsilon(1e-9));
  CHECK(tool_outline(ball, pose, {0, 0.008, 0}, Vector3::UnitX(), Vector3::UnitZ(), 0.1).empty());
  CHECK_THROWS_AS(tool_outline(ball, pose, {0, 0, 0}, Vector3::UnitX(), Vector3::UnitZ(), 0), InputError);
}

TEST_CASE("Tool distance of each shape is the distance to a dense sampling of its surface") {
  std::mt19937 random(1);
  for (const Case& c : cases()) {
    INFO(c.name);
    const SurfaceMesh mesh = tool_mesh(c.shape, c.pose, 1.5e-4);
    for (int i = 0; i < 60; ++i) {
      const Vector3 x = random_point(random, c.pose.point + 0.01 * c.pose.axis, c.reach);
      double nearest = std::numeric_limits<double>::max();
      for (const Vector3& v : mesh.vertices)
        nearest = std::min(nearest, (x - v).norm());
      const double distance = tool_distance(c.shape, c.pose, x);
      const bool in_overlap = std::holds_alternative<Laparoscope>(c.shape) && distance < 0;
      if (in_overlap)
        CHECK(-distance <= nearest + 1e-12);
      else
        // Vertices lie on the surface: never nearer than it, and within half a cell's diagonal of any of its points.
        CHECK(nearest - std::abs(distance) == Approx(0.6e-4).margin(0.6e-4 + 1e-12));
    }
  }
}

TEST_CASE("Tool distance has a gradient of length one that equals the tool normal") {
  std::mt19937 random(2);
  for (const Case& c : cases()) {
    INFO(c.name);
    int compared = 0;
    for (int i = 0; i < 2000; ++i) {
      const Vector3 x = random_point(random, c.pose.point + 0.01 * c.pose.axis, c.reach);
      const Vector3 n = tool_normal(c.shape, c.pose, x);
      CHECK(n.norm() == Approx(1).epsilon(1e-12));
      const double h = 1e-7;
      Vector3 gradient;
      bool smooth = true;
      for (int k = 0; k < 3; ++k) {
        const Vector3 step = h * Vector3::Unit(k);
        gradient[k] = (tool_distance(c.shape, c.pose, x + step) - tool_distance(c.shape, c.pose, x - step)) / (2 * h);
        smooth =
            smooth && (tool_normal(c.shape, c.pose, x + step) - tool_normal(c.shape, c.pose, x - step)).norm() < 0.01;
      }
      if (!smooth) // across a ridge of the distance
        continue;
      ++compared;
      CHECK((gradient - n).norm() < 1e-5);
    }
    CHECK(compared > 1950);
  }
}

TEST_CASE("Punch distance is exact in every region of the cylinder") {
  const FlatPunch punch{0.005, 0.05};
  const ToolPose pose = pose_at(punch, Vector3::Zero());
  const auto distance = [&](double x, double z) { return tool_distance(punch, pose, {x, 0, z}); };
  CHECK(distance(0.002, -0.001) == Approx(0.001));
  CHECK(distance(0.002, 0.053) == Approx(0.003));
  CHECK(distance(0.009, 0.02) == Approx(0.004));
  CHECK(distance(0.008, -0.004) == Approx(0.005));
  CHECK(distance(0.008, 0.054) == Approx(0.005));
  CHECK(distance(0.001, 0.025) == Approx(-0.004));
  CHECK(distance(0.001, 0.0015) == Approx(-0.0015));
  CHECK(tool_normal(punch, pose, {0.008, 0, -0.004}).isApprox(Vector3(0.6, 0, -0.8)));
}

TEST_CASE("Tool normal is a unit vector on centres and axes") {
  for (const Case& c : cases()) {
    INFO(c.name);
    for (double along : {0.0, 0.003, 0.006, 0.007, 0.0075, 0.012, 0.02, 0.05}) {
      const Vector3 x = c.pose.point + along * c.pose.axis;
      const Vector3 n = tool_normal(c.shape, c.pose, x);
      CHECK(n.norm() == Approx(1).epsilon(1e-12));
      CHECK(n == tool_normal(c.shape, c.pose, x));
    }
    CHECK(tool_normal(c.shape, c.pose, c.pose.point).isApprox(-c.pose.axis, 1e-9));
    CHECK(tool_distance(c.shape, c.pose, c.pose.point) == Approx(0).margin(1e-15));
  }
}

TEST_CASE("A laparoscope's axis runs from its reference point through its port") {
  const Laparoscope scope{0.004, 0.0025, 0.6, Vector3(0.02, 0.05, 0.2)};
  std::mt19937 random(3);
  for (int i = 0; i < 50; ++i) {
    const Vector3 point = random_point(random, Vector3::Zero(), 0.1);
    const ToolPose pose = pose_at(scope, point, Vector3::UnitX());
    CHECK(pose.point == point);
    CHECK(pose.axis.norm() == Approx(1).epsilon(1e-14));
    const Vector3 to_port = scope.port - point;
    CHECK((to_port - to_port.norm() * pose.axis).norm() < 1e-15);
    // The port is on the shaft's axis, hence as deep in the shaft as can be.
    CHECK(tool_distance(scope, pose, scope.port) == Approx(-scope.shaft_radius));
  }
}

TEST_CASE("Other tools take the given axis, of any length") {
  const ToolPose pose = pose_at(SphereTip{}, {1, 2, 3}, {0, -4, 3});
  CHECK(pose.axis.isApprox(Vector3(0, -0.8, 0.6)));
  CHECK(pose_at(FlatPunch{}, Vector3::Zero(), 1e-200 * Vector3::UnitX()).axis.isApprox(Vector3::UnitX()));
}

TEST_CASE("Impossible tools and poses are refused with the field and its limit") {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  const auto refused = [](const ToolShape& shape, const std::string& field) {
    CHECK_THROWS_WITH(check(shape), Catch::Contains(field));
    CHECK_THROWS_AS(check(shape), InputError);
  };
  refused(SphereTip{0}, "radius is 0 m, it must be greater than 0");
  refused(SphereTip{nan}, "radius is nan");
  refused(FlatPunch{-0.01, 0.05}, "radius is -0.01");
  refused(FlatPunch{0.01, infinity}, "length is inf");
  refused(Laparoscope{-1, 0.0025, 0.3, Vector3::Zero()}, "tip_radius is -1");
  refused(Laparoscope{0.004, 0, 0.3, Vector3::Zero()}, "shaft_radius is 0");
  refused(Laparoscope{0.004, 0.0025, nan, Vector3::Zero()}, "shaft_length is nan");
  refused(Laparoscope{0.004, 0.0025, 0.3, {0, nan, 0}}, "port is (0, nan, 0)");
  refused(Laparoscope{0.002, 0.0025, 0.3, Vector3::Zero()}, "shaft_radius is 0.0025 m, it must not exceed tip_radius");
  CHECK_NOTHROW(check(SphereTip{}));
  CHECK_NOTHROW(check(FlatPunch{}));
  CHECK_NOTHROW(check(Laparoscope{}));

  const Laparoscope scope{0.004, 0.0025, 0.3, {0.1, 0, 0}};
  CHECK_THROWS_WITH(pose_at(scope, {0.1, 0, 0}), Catch::Contains("0 m from the port"));
  CHECK_THROWS_WITH(pose_at(SphereTip{}, Vector3::Zero(), Vector3::Zero()), Catch::Contains("axis is (0, 0, 0)"));
  CHECK_THROWS_WITH(pose_at(SphereTip{}, {0, nan, 0}), Catch::Contains("reference point"));
  CHECK_THROWS_AS(tool_mesh(SphereTip{}, pose_at(SphereTip{}, Vector3::Zero()), 0), InputError);
}

TEST_CASE("Tool meshes are closed, outward, on the tool, and hold its volume") {
  const double r = 0.006, s = 0.003, L = 0.02, R = 0.007;
  // The shaft leaves the tip where its cylinder meets the ball: tip + cylinder + half ball - the lens inside the tip.
  const double exit = std::sqrt(r * r - s * s), cap_height = r - exit;
  const double cap = std::numbers::pi * cap_height * cap_height * (3 * r - cap_height) / 3;
  const double scope_volume = 4 * std::numbers::pi / 3 * r * r * r - cap + std::numbers::pi * s * s * (L - exit) +
                              2 * std::numbers::pi / 3 * s * s * s;
  const std::vector<double> volumes{4 * std::numbers::pi / 3 * R * R * R, std::numbers::pi * 0.006 * 0.006 * 0.015,
                                    scope_volume};
  const std::vector<Case> all = cases();
  for (std::size_t i = 0; i < all.size(); ++i) {
    INFO(all[i].name);
    const SurfaceMesh mesh = tool_mesh(all[i].shape, all[i].pose, 3e-4);
    tests::require_closed_sphere(mesh);
    CHECK(volume(mesh) == Approx(volumes[i]).epsilon(2e-3));
    double worst = 0;
    for (const Vector3& v : mesh.vertices)
      worst = std::max(worst, std::abs(tool_distance(all[i].shape, all[i].pose, v)));
    CHECK(worst < 1e-15);
  }
}

TEST_CASE("Tool meshes of laparoscopes with short or full-width shafts are closed and on the tool") {
  const Vector3 port(0, 0.1, 0.4);
  for (const Laparoscope& scope : {Laparoscope{0.004, 0.004, 0.1, port}, Laparoscope{0.004, 0.0025, 0.001, port},
                                   Laparoscope{0.004, 0.0025, 0.0025, port}}) {
    INFO(scope.shaft_radius << " " << scope.shaft_length);
    const ToolPose pose = pose_at(scope, {0.01, 0, 0});
    const SurfaceMesh mesh = tool_mesh(scope, pose, 5e-4);
    tests::require_closed_sphere(mesh);
    for (const Vector3& v : mesh.vertices)
      CHECK(std::abs(tool_distance(scope, pose, v)) < 1e-15);
  }
}

TEST_CASE("Tip radius is that of the part that touches first") {
  CHECK(tip_radius(SphereTip{0.003}) == 0.003);
  CHECK(tip_radius(FlatPunch{0.004, 0.1}) == 0.004);
  CHECK(tip_radius(Laparoscope{0.005, 0.002, 0.1, Vector3::Zero()}) == 0.005);
}

} // namespace spherecut::topology
