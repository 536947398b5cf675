#include "topology/search/box_tree.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <random>
#include <vector>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

using BoxRandom = std::mt19937_64;
using Corners = std::array<Vector3, 3>;

double uniform(BoxRandom& random, double from, double to) {
  return std::uniform_real_distribution<double>(from, to)(random);
}

Vector3 within_one(BoxRandom& random) {
  return Vector3::NullaryExpr([&] { return uniform(random, -1, 1); });
}

/// Strips `width` wide across a bent sheet of about one by one, turned anyhow and somewhere.
std::vector<Corners> strips(BoxRandom& random, double width, int count) {
  const Eigen::Quaterniond turn = Eigen::Quaterniond::UnitRandom();
  const Vector3 place = 2 * within_one(random);
  const auto at = [&](int i, double t) -> Vector3 {
    return place + turn * Vector3(width * i, t, 0.1 * std::sin(3 * width * i) + 0.05 * t * t);
  };
  std::vector<Corners> triangles;
  for (int i = 0; i < count; ++i) {
    triangles.push_back({at(i, 0), at(i + 1, 0), at(i, 1)});
    triangles.push_back({at(i + 1, 0), at(i + 1, 1), at(i, 1)});
  }
  return triangles;
}

/// A point of a triangle, often of its border.
Vector3 point_of(const Corners& p, BoxRandom& random) {
  double u = uniform(random, 0, 1), v = uniform(random, 0, 1 - u);
  if (random() % 3 == 0)
    u = 0;
  if (random() % 3 == 0)
    v = 1 - u;
  return p[0] + u * (p[1] - p[0]) + v * (p[2] - p[0]);
}

bool visits(const BoxTree& tree, int wanted, const Vector3& a, const Vector3& b) {
  return tree.any_on_segment(a, b, [&](int place) { return tree.order()[place] == wanted; });
}

bool visits_between(const BoxTree& tree, int wanted, const Vector3& centre, const Vector3& half, const Vector3& y) {
  return tree.any_between(centre, half, y, [&](int place) { return tree.order()[place] == wanted; });
}

} // namespace

TEST_CASE("A segment visits every triangle that it comes to, however narrow and however it ends there", "[box_tree]") {
  BoxRandom random(5);
  for (int scene = 0; scene < 40; ++scene) {
    const double width = std::pow(10, uniform(random, -5, -1));
    const std::vector<Corners> triangles = strips(random, width, 100);
    const BoxTree tree(triangles, 1e-12);
    for (int i = 0; i < 2000; ++i) {
      const int wanted = static_cast<int>(random() % triangles.size());
      const Vector3 x = point_of(triangles[static_cast<std::size_t>(wanted)], random);
      const Vector3 way = std::pow(10, uniform(random, -6, 0)) * within_one(random);
      const double before = i % 2 == 0 ? 0 : uniform(random, 0, 1); // ends on the triangle, or passes through
      REQUIRE(visits(tree, wanted, x - before * way, x + way));
      // And from some place of a box: x is on the way from it.
      const Vector3 half = std::pow(10, uniform(random, -6, -1)) * within_one(random).cwiseAbs();
      const Vector3 centre = x - before * way + half.cwiseProduct(within_one(random));
      REQUIRE(visits_between(tree, wanted, centre, half, x + way));
    }
  }
}

TEST_CASE("Triangles within the margin of a segment are visited, and few of those farther off", "[box_tree]") {
  BoxRandom random(6);
  int far_visits = 0, far = 0;
  for (int scene = 0; scene < 20; ++scene) {
    constexpr double margin = 1e-3;
    const std::vector<Corners> triangles = strips(random, 0.01, 100);
    const BoxTree tree(triangles, margin);
    for (int i = 0; i < 1000; ++i) {
      const int wanted = static_cast<int>(random() % triangles.size());
      const Corners& p = triangles[static_cast<std::size_t>(wanted)];
      const Vector3 normal = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
      const Vector3 along = (normal.cross(within_one(random))).normalized();
      const Vector3 beside = point_of(p, random) + 0.98 * margin * normal; // runs above the triangle
      REQUIRE(visits(tree, wanted, beside, beside + 0.1 * along));
      REQUIRE(visits_between(tree, wanted, beside, Vector3::Zero(), beside + 0.1 * along));
      const Vector3 off = beside + 5 * margin * normal;
      ++far;
      far_visits += visits(tree, wanted, off, off + 0.005 * along) ? 1 : 0;
    }
  }
  CHECK(far_visits < far / 10);
}
