#include "solvers/shapes/cut_sight.hpp"

#include "tests/support/allocation_counter.hpp"
#include "tests/support/cut_block.hpp"
#include "tests/support/sheets.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <optional>
#include <random>

using namespace spherecut;
using namespace spherecut::solvers;
using namespace spherecut::tests;

namespace {

Vector3 random_point(std::mt19937_64& random, double half) {
  std::uniform_real_distribution<double> place(-half, half);
  const double x = place(random), y = place(random), z = place(random);
  return {x, y, z};
}

Spheres spheres_of(const CutBlock& block, SightRule rule, double rho = 2.0) {
  return {block.nodes.positions, block.nodes.spacings, rho, Basis::linear, 1e9, {block.incision, rule}};
}

// Value and gradient of sum_j f(x_j) h_j(x).
struct Sum {
  double value = 0;
  Vector3 gradient = Vector3::Zero();
};
template <class Function>
Sum combine(const std::vector<Vector3>& centres, const ShapeFunctions& shape, const Function& function) {
  Sum sum;
  for (int k = 0; k < shape.size(); ++k) {
    const double f = function(centres[shape.nodes[k]]);
    sum.value += f * shape.value[k];
    sum.gradient += f * shape.gradient(k);
  }
  return sum;
}

double front_distance(const CutFrame& frame, const Vector3& x) {
  return std::hypot((x - frame.origin).dot(frame.ahead), (x - frame.origin).dot(frame.normal));
}

} // namespace

TEST_CASE("Around a cut the shape functions reproduce linear fields by every rule", "[cut_sight]") {
  const SightRule rule = GENERATE(SightRule::visibility, SightRule::diffraction, SightRule::enriched);
  const bool through = GENERATE(false, true);
  const CutBlock block = cut_block(8, through, 3);
  const Spheres spheres = spheres_of(block, rule);
  std::mt19937_64 random(5);
  ShapeFunctions shape;
  const auto linear = [](const Vector3& x) { return 0.3 + x.dot(Vector3(1.1, -0.7, 0.4)); };
  double worst = 0, worst_gradient = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const Vector3 x = random_point(random, 0.5);
    REQUIRE(evaluate(spheres, x, shape));
    REQUIRE(std::is_sorted(shape.nodes.begin(), shape.nodes.end()));
    const Sum sum = combine(block.nodes.positions, shape, linear);
    worst = std::max(worst, std::abs(sum.value - linear(x)));
    worst_gradient = std::max(worst_gradient, (sum.gradient - Vector3(1.1, -0.7, 0.4)).norm());
  }
  CHECK(worst < 1e-11);
  CHECK(worst_gradient < 1e-9);
}

TEST_CASE("Near the front the enriched basis reproduces the crack field", "[cut_sight]") {
  const CutBlock block = cut_block(8, false, 4);
  const CutFrame& frame = block.frame;
  const Spheres spheres = spheres_of(block, SightRule::enriched);
  std::mt19937_64 random(6);
  ShapeFunctions shape;
  int tried = 0;
  double worst = 0, worst_gradient = 0;
  for (int trial = 0; trial < 12000; ++trial) {
    const Vector3 x = random_point(random, 0.45);
    const double r = front_distance(frame, x);
    if (r > 0.95 * Sight{}.blend * Sight{}.reach / 8.0 || r < 1e-3)
      continue;
    ++tried;
    REQUIRE(evaluate(spheres, x, shape));
    for (int mode = 0; mode < 2; ++mode) {
      const auto field = [&](const Vector3& y) {
        const Vector3 d = y - frame.origin;
        const double theta = std::atan2(d.dot(frame.normal), d.dot(frame.ahead));
        const double root = std::sqrt(front_distance(frame, y));
        return mode == 0 ? root * std::sin(theta / 2) : root * std::cos(theta / 2) * (1 + std::sin(theta));
      };
      const double step = 1e-5 * r;
      Vector3 gradient;
      for (int a = 0; a < 3; ++a)
        gradient[a] = (field(x + step * Vector3::Unit(a)) - field(x - step * Vector3::Unit(a))) / (2 * step);
      const Sum sum = combine(block.nodes.positions, shape, field);
      worst = std::max(worst, std::abs(sum.value - field(x)));
      // Differences across the sheet are not the field's.
      if (std::abs((x - frame.origin).dot(frame.normal)) > 2 * step)
        worst_gradient = std::max(worst_gradient, (sum.gradient - gradient).norm() / gradient.norm());
    }
  }
  CHECK(tried > 200);
  CHECK(worst < 1e-9);
  CHECK(worst_gradient < 1e-6);
}

TEST_CASE("Off the rim of a slanted cut no enriched support runs wild", "[cut_sight]") {
  // At a sharp corner of a lip a point sees the nodes of its own face and, at the end of their reach, a few others: as
  // many as the enriched basis has functions, and yet next to nothing across the face.
  const auto domain = topology::make_box_domain({0, -0.03, 0}, {0.04, 0, 0.03}, 0.004);
  int looked_at = 0;
  for (int stage = 0; stage < 6; ++stage) {
    SprinkleOptions options;
    options.spacing.fine = options.spacing.coarse = 0.004;
    options.random_seed = static_cast<std::uint64_t>(stage) + 1;
    const double front = -0.027 + 0.001 * stage;
    options.incision = std::make_shared<topology::Incision>(
        std::vector<topology::SurfaceMesh>{
            tests::grid_sheet(4, 4,
                              [&](double s, double t) {
                                return Vector3(0.012 + 0.03 * s, -0.034 + t * (front + 0.034), 0.015 + 0.03 * s);
                              })},
        domain);
    const NodeCloud nodes = sprinkle(*domain, options).nodes;
    const Sight sight{.incision = options.incision, .rule = SightRule::enriched, .reach = 2.5};
    const Spheres spheres(nodes.positions, nodes.spacings, 1.75, Basis::linear, 1e7, sight);
    std::mt19937_64 random(static_cast<std::uint64_t>(stage));
    ShapeFunctions shape;
    for (int i = 0; i < nodes.size(); ++i)
      for (int k = 0; k < 8 && nodes.kinds[i] == NodeKind::lip; ++k) {
        const Vector3 x = nodes.positions[i] + (k == 0 ? Vector3(Vector3::Zero()) : random_point(random, 0.001));
        if (domain->signed_distance(x) > 0 || !evaluate(spheres, x, shape))
          continue;
        ++looked_at;
        double values = 0;
        for (const double value : shape.value)
          values += std::abs(value);
        INFO("stage " << stage << ", node " << i << " at " << nodes.positions[i].transpose());
        CHECK(values < 10);
      }
  }
  CHECK(looked_at > 500);
}

TEST_CASE("First derivatives around a cut agree with finite differences of the values", "[cut_sight]") {
  const SightRule rule = GENERATE(SightRule::visibility, SightRule::diffraction, SightRule::enriched);
  const CutBlock block = cut_block(8, false, 7);
  const Spheres spheres = spheres_of(block, rule);
  std::mt19937_64 random(8);
  ShapeFunctions shape, ahead, behind;
  const double step = 1e-6;
  const auto value_of = [](const ShapeFunctions& s, int node) {
    const auto found = std::lower_bound(s.nodes.begin(), s.nodes.end(), node);
    return found == s.nodes.end() || *found != node ? 0.0 : s.value[found - s.nodes.begin()];
  };
  std::vector<double> errors;
  for (int trial = 0; trial < 400; ++trial) {
    const Vector3 x = random_point(random, 0.45);
    if (front_distance(block.frame, x) < 0.01)
      continue;
    REQUIRE(evaluate(spheres, x, shape));
    double error = 0;
    for (int a = 0; a < 3; ++a) {
      REQUIRE(evaluate(spheres, x + step * Vector3::Unit(a), ahead));
      REQUIRE(evaluate(spheres, x - step * Vector3::Unit(a), behind));
      for (int k = 0; k < shape.size(); ++k) {
        const double slope = (value_of(ahead, shape.nodes[k]) - value_of(behind, shape.nodes[k])) / (2 * step);
        error = std::max(error, std::abs(slope - shape.gradient(k)[a]) / 8);
      }
    }
    errors.push_back(error);
  }
  // By sight alone shape functions jump where a node comes into view; few points lie that near to such a plane.
  std::sort(errors.begin(), errors.end());
  CHECK(errors[errors.size() * 95 / 100] < 1e-6);
  if (rule != SightRule::visibility)
    CHECK(errors.back() < 1e-4);
}

TEST_CASE("Along a front beside which the spacing changes the enriched basis does not jump", "[cut_sight]") {
  CutBlock block = cut_block(8, false, 7);
  const CutFrame& frame = block.frame;
  for (int i = 0; i < block.nodes.size(); ++i)
    block.nodes.spacings[i] *= 1 + 0.3 * std::sin(7 * (block.nodes.positions[i] - frame.origin).dot(frame.tangent));
  const Spheres spheres = spheres_of(block, SightRule::enriched, 2.4);
  const auto field = [](const Vector3& x) { return std::sin(9 * x.x()) * std::cos(8 * x.y()) + std::cos(10 * x.z()); };
  ShapeFunctions shape;
  // Places ahead of the front and above the sheet where the enrichment fades.
  for (const auto& [ahead, above] : {std::pair(0.16, 0.01), std::pair(0.1, 0.1), std::pair(-0.02, 0.15)}) {
    INFO("line " << ahead << " m ahead of the front, " << above << " m above the sheet");
    const Vector3 start = frame.origin + ahead * frame.ahead + above * frame.normal;
    const auto at = [&](double along) {
      REQUIRE(evaluate(spheres, start + along * frame.tangent, shape));
      return combine(block.nodes.positions, shape, field);
    };
    constexpr double step = 1e-3;
    Sum before = at(-0.42);
    double steepest = 0, off = 0;
    for (int k = 1; k <= 840; ++k) {
      const Sum now = at(-0.42 + k * step);
      const double slope = 0.5 * (before.gradient + now.gradient).dot(frame.tangent);
      steepest = std::max(steepest, std::abs(now.value - before.value) / step);
      off = std::max(off, std::abs(now.value - before.value - step * slope));
      before = now;
    }
    CHECK(steepest < 10); // the field's own slope is at most 20
    CHECK(off < 1e-3);
    for (const double end : {-0.4, 0.0, 0.4}) // of a segment of the front
      CHECK(std::abs(at(end + 1e-9).value - at(end - 1e-9).value) < 1e-7);
  }
}

TEST_CASE("No point has a node from beyond a cut through the body, and pairs on its faces stand apart", "[cut_sight]") {
  const SightRule rule = GENERATE(SightRule::visibility, SightRule::enriched);
  const CutBlock block = cut_block(8, true, 2);
  const Spheres spheres = spheres_of(block, rule);
  const auto side = [&](const Vector3& x) { return (x - block.frame.origin).dot(block.frame.normal) > 0; };
  ShapeFunctions shape;
  std::mt19937_64 random(9);
  std::vector<Vector3> points = block.nodes.positions;
  for (int trial = 0; trial < 1000; ++trial)
    points.push_back(random_point(random, 0.5));
  int across = 0;
  for (const Vector3& x : points) {
    REQUIRE(evaluate(spheres, x, shape));
    for (int node : shape.nodes)
      across += side(block.nodes.positions[node]) != side(x) ? 1 : 0;
  }
  CHECK(across == 0);
}

TEST_CASE("Far from the cut the shape functions are those of the uncut body, bit for bit", "[cut_sight]") {
  const CutBlock block = cut_block(14, false, 2);
  const Spheres cut = spheres_of(block, SightRule::enriched);
  const Spheres whole(block.nodes.positions, block.nodes.spacings, 2.0);
  ShapeFunctions a, b;
  for (const Vector3& x : {Vector3(0.1, 0.1, 0.48), Vector3(0.49, -0.4, -0.45), Vector3(-0.3, 0.2, -0.4)}) {
    REQUIRE(evaluate(cut, x, a));
    REQUIRE(evaluate(whole, x, b));
    CHECK(a.nodes == b.nodes);
    CHECK(a.value == b.value);
    CHECK(a.dx == b.dx);
  }
}

TEST_CASE("Behind the front visibility ends a sphere where diffraction bends it", "[cut_sight]") {
  const CutBlock block = cut_block(8, false, 2);
  const CutFrame& frame = block.frame;
  const Spheres bending = spheres_of(block, SightRule::diffraction), ending = spheres_of(block, SightRule::visibility);
  const double h = 1.0 / 8;
  ShapeFunctions bent, ended;
  const Vector3 x = frame.origin - 0.3 * h * frame.ahead + 0.05 * h * frame.normal;
  REQUIRE(evaluate(bending, x, bent));
  REQUIRE(evaluate(ending, x, ended));
  CHECK(bent.size() > ended.size());
  for (int node : ended.nodes)
    CHECK_FALSE(block.incision->blocks(x, block.nodes.positions[node]));
}

TEST_CASE("A point right on a sheet is taken to its + side", "[cut_sight]") {
  const CutBlock block = cut_block(8, true, 2);
  const Spheres spheres = spheres_of(block, SightRule::enriched);
  ShapeFunctions shape;
  REQUIRE(evaluate(spheres, block.frame.origin, shape));
  for (int node : shape.nodes)
    CHECK((block.nodes.positions[node] - block.frame.origin).dot(block.frame.normal) > 0);
}

TEST_CASE("Around a cut evaluation does not allocate once warm", "[cut_sight]") {
  const CutBlock block = cut_block(8, false, 2);
  const Spheres spheres = spheres_of(block, SightRule::enriched);
  ShapeFunctions shape;
  std::mt19937_64 random(3);
  std::vector<Vector3> points;
  for (int trial = 0; trial < 100; ++trial)
    points.push_back(random_point(random, 0.4));
  for (const Vector3& x : points)
    REQUIRE(evaluate(spheres, x, shape));
  const std::size_t before = allocations();
  for (const Vector3& x : points)
    REQUIRE(evaluate(spheres, x, shape));
  CHECK(allocations() == before);
}

TEST_CASE("Second derivatives exist for visibility alone", "[cut_sight]") {
  const CutBlock block = cut_block(8, false, 2);
  ShapeFunctions shape;
  const Vector3 x = block.frame.origin - 0.2 * block.frame.ahead + 0.05 * block.frame.normal;
  CHECK_THROWS_AS(evaluate_second(spheres_of(block, SightRule::enriched), x, shape), InputError);
  const Spheres spheres = spheres_of(block, SightRule::visibility);
  REQUIRE(evaluate_second(spheres, x, shape));
  CHECK(shape.dxx.size() == shape.nodes.size());
  ShapeFunctions plain;
  REQUIRE(evaluate(spheres, x, plain));
  CHECK(plain.nodes == shape.nodes);
}

TEST_CASE("On a curved sheet the nodes of one face support one another, and never those of the other face",
          "[cut_sight]") {
  // A sheet rolled about the y axis with radius 10 h; lip nodes h apart on both faces.
  constexpr double h = 0.01, radius = 10 * h;
  const auto domain = topology::make_box_domain({-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1}, 0.02);
  const auto on_sheet = [&](double angle, double y, double off) {
    return Vector3((radius + off) * std::sin(angle), y, (radius + off) * std::cos(angle) - radius);
  };
  topology::SurfaceMesh sheet;
  constexpr int n = 24;
  for (int i = 0; i <= n; ++i)
    for (int k = 0; k <= n; ++k)
      sheet.vertices.push_back(on_sheet(0.6 * (2.0 * i / n - 1), 0.06 * (2.0 * k / n - 1), 0));
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k) {
      const int a = i * (n + 1) + k;
      sheet.triangles.push_back({a, a + n + 1, a + n + 2});
      sheet.triangles.push_back({a, a + n + 2, a + 1});
    }
  const auto incision = std::make_shared<topology::Incision>(std::vector<topology::SurfaceMesh>{sheet}, domain);
  std::vector<Vector3> centres;
  std::vector<int> side; // +1 outside, -1 inside
  for (int layer = -2; layer <= 2; ++layer)
    for (int i = -3; i <= 3; ++i)
      for (int k = -3; k <= 3; ++k)
        for (int s : {1, -1})
          if (layer == 0 || s == 1) {
            const double off = layer == 0 ? s * lip_offset * h : layer * h;
            centres.push_back(on_sheet(0.1 * i, h * k, off));
            side.push_back(off > 0 ? 1 : -1);
          }
  const Spheres spheres(centres, std::vector<double>(centres.size(), h), 2.0, Basis::linear, 1e9,
                        {incision, SightRule::visibility});
  ShapeFunctions shape;
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const double off = Vector3(centres[i].x(), 0, centres[i].z() + radius).norm() - radius;
    if (std::abs(off) > 0.1 * h || std::abs(centres[i].x()) > 2.1 * h || std::abs(centres[i].y()) > 2.1 * h)
      continue;
    REQUIRE(evaluate(spheres, centres[i], shape));
    int neighbours_on_face = 0;
    for (int node : shape.nodes) {
      CHECK(side[node] == side[i]);
      const double other = Vector3(centres[node].x(), 0, centres[node].z() + radius).norm() - radius;
      neighbours_on_face += std::abs(other) < 0.1 * h ? 1 : 0;
    }
    CHECK(neighbours_on_face >= 9); // itself and the eight around it
  }
}
