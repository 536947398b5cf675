#include "solvers/shapes/cell_shapes.hpp"
#include "solvers/shapes/functions.hpp"
#include "tests/support/bodies.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::solvers;
using namespace spherecut::tests;

namespace {

std::shared_ptr<const MaterialRegions> two_regions(std::vector<RegionFace> first, std::vector<RegionFace> second = {}) {
  std::vector<MaterialRegion> regions{{"first", std::move(first), {2, 0.3, 0}}};
  if (!second.empty())
    regions.push_back({"second", std::move(second), {3, 0.3, 0}});
  return std::make_shared<const MaterialRegions>(std::move(regions));
}

const Vector3 layer_normal = Vector3(0.1, -0.2, 1).normalized(); // normal of the layers

/// Layers along `layer_normal`: the first region up to 0.4, the second from 0.4 to 0.75.
std::shared_ptr<const MaterialRegions> tilted_layers() {
  return two_regions(half_space_faces({layer_normal, 0.4}), slab_faces({layer_normal, 0.75}, 0.35));
}

/// Continuous, linear in each layer.
double kinked(const Vector3& x) {
  const double s = layer_normal.dot(x);
  return 0.3 + 0.2 * x.x() - 0.7 * x.y() + 1.5 * s + 3 * std::max(s - 0.4, 0.0) - 7 * std::max(s - 0.75, 0.0);
}
Vector3 gradient_of_kinked(const Vector3& x) {
  const double s = layer_normal.dot(x);
  return Vector3(0.2, -0.7, 0) + (1.5 + (s > 0.4 ? 3 : 0) - (s > 0.75 ? 7 : 0)) * layer_normal;
}

Spheres spheres_with(const Problem& box, std::shared_ptr<const MaterialRegions> regions) {
  Sight sight;
  sight.regions = std::move(regions);
  return {box.nodes.positions, box.nodes.spacings, 2, Basis::linear, 1e7, sight};
}

} // namespace

TEST_CASE("Shape functions beside faces between materials reproduce fields with a kink in them") {
  const Problem box = held_box(Vector3::Zero(), Vector3::Ones(), 0.125, 0.25, {1, 0.3, 0});
  const Spheres spheres = spheres_with(box, tilted_layers());
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> place(0, 1);
  ShapeFunctions shape;
  for (int trial = 0; trial < 500; ++trial) {
    const Vector3 x(place(random), place(random), place(random));
    REQUIRE(evaluate(spheres, x, shape));
    double sum = 0, value = 0;
    Vector3 gradient = Vector3::Zero();
    for (int k = 0; k < shape.size(); ++k) {
      sum += shape.value[k];
      value += shape.value[k] * kinked(box.nodes.positions[shape.nodes[k]]);
      gradient += kinked(box.nodes.positions[shape.nodes[k]]) * shape.gradient(k);
    }
    CHECK(sum == Approx(1).margin(1e-10));
    CHECK(value == Approx(kinked(x)).margin(1e-9));
    CHECK((gradient - gradient_of_kinked(x)).norm() < 1e-7);
  }
}

TEST_CASE("Gradients beside a round face are the differences of the values, and values meet where no face is near") {
  const Problem box = held_box(Vector3::Zero(), Vector3::Ones(), 0.125, 0.25, {1, 0.3, 0});
  const Spheres spheres = spheres_with(box, two_regions(ball_faces({0.45, 0.5, 0.55}, 0.27)));
  const Spheres plain(box.nodes.positions, box.nodes.spacings, 2, Basis::linear, 1e7);
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> place(0.05, 0.95);
  ShapeFunctions shape, beside, other;
  constexpr double step = 1e-6;
  for (int trial = 0; trial < 200; ++trial) {
    const Vector3 x(place(random), place(random), place(random));
    const double away = (x - Vector3(0.45, 0.5, 0.55)).norm() - 0.27;
    if (std::abs(away) < 10 * step)
      continue;
    REQUIRE(evaluate(spheres, x, shape));
    if (std::abs(away) > 0.25) { // spheres are as large
      REQUIRE(evaluate(plain, x, other));
      CHECK(shape.nodes == other.nodes);
      CHECK(shape.value == other.value);
    }
    Vector3 numeric = Vector3::Zero(), exact = Vector3::Zero();
    const auto value_at = [&](const Vector3& y) {
      REQUIRE(evaluate(spheres, y, beside));
      double value = 0;
      for (int k = 0; k < beside.size(); ++k)
        value += beside.value[k] * std::sin(7.0 * beside.nodes[k]);
      return value;
    };
    for (int axis = 0; axis < 3; ++axis)
      numeric[axis] =
          (value_at(x + step * Vector3::Unit(axis)) - value_at(x - step * Vector3::Unit(axis))) / (2 * step);
    for (int k = 0; k < shape.size(); ++k)
      exact += std::sin(7.0 * shape.nodes[k]) * shape.gradient(k);
    CHECK((numeric - exact).norm() < 1e-5 * (1 + exact.norm()));
  }
}

TEST_CASE("A cell at a face has the gradients of its points alone") {
  const Problem box = held_box(Vector3::Zero(), Vector3::Ones(), 0.25, 0.2, {1, 0.3, 0});
  const Spheres spheres = spheres_with(box, tilted_layers());
  const std::vector<QuadraturePoint> points{{{0.4, 0.5, 0.42}, 0.01}, {{0.45, 0.5, 0.5}, 0.02}};
  CellShapes cell;
  CellEvaluator(spheres).evaluate(points, cell);
  ShapeFunctions shape;
  for (int q = 0; q < 2; ++q) {
    REQUIRE(evaluate(spheres, points[q].position, shape));
    for (int k = 0; k < shape.size(); ++k) {
      const auto at = std::find(cell.nodes.begin(), cell.nodes.end(), shape.nodes[k]) - cell.nodes.begin();
      REQUIRE(at < std::ssize(cell.nodes));
      CHECK((cell.gradient(at, q) - std::sqrt(points[q].weight) * shape.gradient(k)).norm() < 1e-12);
    }
  }
}

TEST_CASE("What goes without ramps is refused or falls back as documented") {
  const Problem box = held_box(Vector3::Zero(), Vector3::Ones(), 0.25, 0.2, {1, 0.3, 0});
  Sight sight;
  sight.regions = tilted_layers();
  CHECK_THROWS_AS(Spheres(box.nodes.positions, box.nodes.spacings, 3, Basis::quadratic, 1e9, sight), InputError);
  const Spheres spheres = spheres_with(box, tilted_layers());
  ShapeFunctions shape;
  CHECK_THROWS_AS(evaluate_second(spheres, {0.5, 0.5, 0.45}, shape), InputError);
}
