#include "topology/search/point_tree.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>

using namespace spherecut;
using topology::PointTree;

namespace {

std::vector<Vector3> cloud(int count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> place(-1, 1);
  std::vector<Vector3> points;
  points.reserve(count);
  for (int i = 0; i < count; ++i) {
    const double x = place(random), y = place(random), z = place(random);
    points.emplace_back(x, y, 0.1 * z);
  }
  return points;
}

/// A lattice, every point of it twice: ties in every coordinate and in every distance.
std::vector<Vector3> doubled_lattice(int side) {
  std::vector<Vector3> points;
  for (int copy = 0; copy < 2; ++copy)
    for (int a = 0; a < side; ++a)
      for (int b = 0; b < side; ++b)
        for (int c = 0; c < side; ++c)
          points.emplace_back(a, b, c);
  return points;
}

void check_against_scan(const std::vector<Vector3>& points, const std::vector<Vector3>& queries) {
  const PointTree tree(points);
  for (const Vector3& x : queries) {
    int nearest = -1;
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < std::ssize(points); ++i)
      if (const double squared = (points[i] - x).squaredNorm(); squared < least) {
        least = squared;
        nearest = i;
      }
    const PointTree::Found found = tree.nearest(x);
    CHECK(found.index == nearest); // the smallest index among equals
    CHECK(found.squared_distance == least);
    for (int guess = -1; guess < std::ssize(points); guess += 7)
      CHECK(tree.nearest(x, guess).index == nearest);
    for (double radius : {0.0, 0.3, 1.0, 2.0}) {
      std::vector<PointTree::Found> within;
      tree.within(x, radius, within);
      std::sort(within.begin(), within.end());
      std::vector<PointTree::Found> expected;
      for (int i = 0; i < std::ssize(points); ++i)
        if (const double squared = (points[i] - x).squaredNorm(); squared < radius * radius)
          expected.push_back({squared, i});
      std::sort(expected.begin(), expected.end());
      REQUIRE(within.size() == expected.size());
      for (std::size_t k = 0; k < within.size(); ++k) {
        CHECK(within[k].index == expected[k].index);
        CHECK(within[k].squared_distance == expected[k].squared_distance);
      }
    }
  }
}

} // namespace

TEST_CASE("The point tree finds what a scan over all points finds") {
  for (int count : {1, 2, 8, 9, 17, 300})
    check_against_scan(cloud(count, 11), cloud(30, 12));
}

TEST_CASE("The point tree keeps to its rules where points and distances tie") {
  std::vector<Vector3> queries = doubled_lattice(3);
  queries.emplace_back(0.5, 0.5, 0.5);
  queries.emplace_back(1.5, 2.0, -3.0);
  check_against_scan(doubled_lattice(4), queries);
}

TEST_CASE("An empty point tree has no nearest point") {
  const PointTree tree({});
  CHECK(tree.nearest(Vector3::Zero()).index == -1);
  std::vector<PointTree::Found> found;
  tree.within(Vector3::Zero(), 1, found);
  CHECK(found.empty());
}
