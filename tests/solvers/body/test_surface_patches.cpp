#include "solvers/body/surface_patches.hpp"

#include "experiments/support/cube.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using solvers::DisplacementMean;
using solvers::NodeKind;
using solvers::SurfacePatches;

namespace {

struct Cube {
  solvers::Problem problem = experiments::cube_problem(experiments::linear_field({1, 0.3, 0}), 4, 0.2, 3);
  solvers::Spheres spheres{problem.nodes.positions, problem.nodes.spacings, 1.7};
  SurfacePatches patches{*problem.domain, problem.nodes};
};

void check_mean(const DisplacementMean& mean, const solvers::Problem& problem) {
  double total = 0;
  VectorX linear(3 * problem.nodes.size());
  for (int i = 0; i < problem.nodes.size(); ++i)
    linear.segment<3>(3 * i) = problem.nodes.positions[i];
  for (double weight : mean.weights)
    total += weight;
  CHECK(total == Approx(1).epsilon(1e-12));
  // The shape functions reproduce u(x) = x, so that its mean is the centroid of the share.
  CHECK((mean.of(linear) - mean.centroid).norm() < 1e-12);
  CHECK(std::is_sorted(mean.nodes.begin(), mean.nodes.end()));
  CHECK(std::adjacent_find(mean.nodes.begin(), mean.nodes.end()) == mean.nodes.end());
}

} // namespace

TEST_CASE("Shares of the surface add up to it and carry the mean displacement") {
  const Cube cube;
  double area = 0;
  Vector3 moment = Vector3::Zero();
  for (int i = 0; i < cube.problem.nodes.size(); ++i) {
    const DisplacementMean mean = cube.patches.mean(i, cube.spheres);
    check_mean(mean, cube.problem);
    area += mean.area;
    moment += mean.area * mean.centroid;
    if (cube.problem.nodes.kinds[i] == NodeKind::interior) {
      CHECK(mean.area == 0);
      CHECK(mean.centroid == cube.problem.nodes.positions[i]);
    }
  }
  CHECK(area == Approx(6).epsilon(1e-12));
  CHECK((moment / area - Vector3(0.5, 0.5, 0.5)).norm() < 1e-12);
}

TEST_CASE("Held and free shares share out the surface without overlap") {
  const Cube cube;
  std::vector<int> held_nodes;
  for (const solvers::Prescribed& entry : cube.problem.prescribed)
    held_nodes.push_back(entry.node);
  const auto& held = cube.problem.prescribed_region;
  double area = 0;
  Vector3 moment = Vector3::Zero();
  for (const DisplacementMean& mean : cube.patches.means(held_nodes, cube.spheres, held)) {
    check_mean(mean, cube.problem);
    area += mean.area;
    moment += mean.area * mean.centroid;
  }
  CHECK(area == Approx(1).epsilon(1e-12)); // the base
  CHECK((moment - Vector3(0.5, 0.5, 0)).norm() < 1e-12);
  double free_area = 0;
  for (int i = 0; i < cube.problem.nodes.size(); ++i)
    free_area += cube.patches.mean(i, cube.spheres, held).area;
  CHECK(free_area == Approx(5).epsilon(1e-12));

  // All of the held part goes to the nodes that are named, however few.
  const std::vector<DisplacementMean> two =
      cube.patches.means({held_nodes.front(), held_nodes.back()}, cube.spheres, held);
  CHECK(two[0].area + two[1].area == Approx(1).epsilon(1e-12));
  CHECK(two[0].area == Approx(0.5).epsilon(0.1));
}

TEST_CASE("A point of the held surface belongs to the nearest held node, whatever else lies near") {
  const Cube cube;
  const auto everywhere = [](const Vector3&, const Vector3&) { return true; };
  // Every other node of the surface: points whose nearest node is none of them look for another.
  std::vector<int> some, all;
  for (int i = 0; i < cube.problem.nodes.size(); ++i)
    if (cube.problem.nodes.kinds[i] != NodeKind::interior) {
      all.push_back(i);
      if (i % 2 == 0)
        some.push_back(i);
    }
  for (const std::vector<int>& nodes : {some, all}) {
    const std::vector<DisplacementMean> means = cube.patches.means(nodes, cube.spheres, everywhere);
    double area = 0;
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      area += means[k].area;
      for (const solvers::QuadraturePoint& point : means[k].share) {
        int nearest = nodes[k];
        for (const int other : nodes)
          if ((cube.problem.nodes.positions[other] - point.position).squaredNorm() <
              (cube.problem.nodes.positions[nearest] - point.position).squaredNorm() - 1e-12)
            nearest = other;
        CHECK(nearest == nodes[k]);
      }
    }
    CHECK(area == Approx(6).epsilon(1e-12));
  }
}

TEST_CASE("The value at a point is linear interpolation for linear fields") {
  const Cube cube;
  const Vector3 x(0.31, 0.62, 0.77);
  const DisplacementMean value = solvers::value_at(cube.spheres, x);
  check_mean(value, cube.problem);
  CHECK(value.centroid == x);
}
