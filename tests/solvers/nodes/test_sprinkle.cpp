// Sprinkling of nodes: nearest neighbours, density, sharp features, reproducibility.
#include "solvers/nodes/nodes.hpp"
#include "topology/base/errors.hpp"
#include "topology/organ/organs.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

using namespace spherecut;
using namespace spherecut::solvers;
using Catch::Matchers::Contains;

namespace {

SprinkleOptions uniform(double h) {
  SprinkleOptions options;
  options.spacing.fine = options.spacing.coarse = h;
  return options;
}

/// Fine spherical zone of 25 mm about the pole of a half ball of radius 0.1 m.
SprinkleOptions graded_to_pole(double slope) {
  SprinkleOptions options;
  options.spacing = {0.006, 0.05, slope, 0.025, 1.5, {{0, 0, 0.1}}};
  return options;
}

/// Smallest distance of node i to another, in units of the mean spacing of the two.
double brute_nearest(const NodeCloud& nodes, int i) {
  double best = std::numeric_limits<double>::infinity();
  for (int j = 0; j < nodes.size(); ++j)
    if (j != i)
      best = std::min(best,
                      2 * (nodes.positions[j] - nodes.positions[i]).norm() / (nodes.spacings[j] + nodes.spacings[i]));
  return best;
}

void require_same_bits(const NodeCloud& a, const NodeCloud& b) {
  REQUIRE(a.size() == b.size());
  for (int i = 0; i < a.size(); ++i) {
    REQUIRE(a.positions[i] == b.positions[i]);
    REQUIRE(a.spacings[i] == b.spacings[i]);
    REQUIRE(a.reaches[i] == b.reaches[i]);
    REQUIRE(a.kinds[i] == b.kinds[i]);
    REQUIRE(a.normals[i] == b.normals[i]);
  }
}

/// Kinds agree with where the nodes are, normals with the body; every free node has room and no place is left out.
void check_cloud(const topology::Domain& domain, const SprinkleOptions& options, const Sprinkling& sprinkling) {
  const NodeCloud& nodes = sprinkling.nodes;
  const double tolerance = 1e-9 * domain.bounds().extent().norm();
  int wrong = 0, crowded = 0;
  for (int i = 0; i < nodes.size(); ++i) {
    const double distance = domain.signed_distance(nodes.positions[i]);
    const double h = options.spacing(nodes.positions[i]);
    wrong += nodes.spacings[i] != h || nodes.reaches[i] != options.spacing.reach(nodes.positions[i], h);
    if (nodes.kinds[i] == NodeKind::interior)
      wrong += !(distance <= -options.wall_clearance * h) || nodes.normals[i] != Vector3::Zero();
    else
      wrong += !(std::abs(distance) <= tolerance) || !(std::abs(nodes.normals[i].norm() - 1) < 1e-12) ||
               !(domain.signed_distance(nodes.positions[i] + 0.01 * h * nodes.normals[i]) > 0);
    if (i >= std::ssize(options.seeds))
      crowded += brute_nearest(nodes, i) < 0.7;
  }
  CHECK(wrong == 0);
  CHECK(crowded == 0);

  // No point of the body is farther than 1.05 h from all nodes (a lattice of probes finer than the filling's own).
  const BoundingBox box = domain.bounds();
  constexpr int probes = 24;
  double farthest = 0;
  for (int i = 0; i < probes; ++i)
    for (int j = 0; j < probes; ++j)
      for (int k = 0; k < probes; ++k) {
        const Vector3 x = box.lower + box.extent().cwiseProduct(Vector3(i + 0.5, j + 0.5, k + 0.5)) / probes;
        if (domain.signed_distance(x) > 0)
          continue;
        double nearest = std::numeric_limits<double>::infinity();
        for (const Vector3& y : nodes.positions)
          nearest = std::min(nearest, (x - y).norm());
        farthest = std::max(farthest, nearest / options.spacing(x));
      }
  CHECK(farthest < 1.05);
}

int count_near(const NodeCloud& nodes, const Vector3& x, NodeKind kind) {
  int count = 0;
  for (int i = 0; i < nodes.size(); ++i)
    count += nodes.kinds[i] == kind && (nodes.positions[i] - x).norm() < 1e-9;
  return count;
}

} // namespace

TEST_CASE("The spacing field is flat about its centres and grows with its slope") {
  const SpacingField field{0.01, 0.03, 0.5, 0.02, 1.5, {{0, 0, 0}, {1, 0, 0}}};
  CHECK(field({0, 0, 0}) == 0.01);
  CHECK(field({0, 0.035, 0}) == Approx(0.01));
  CHECK(field({0, 0.045, 0}) == Approx(0.015));
  CHECK(field({1, 0, -0.045}) == Approx(0.015));
  CHECK(field({0.5, 0, 0}) == 0.03);
  CHECK(SpacingField{0.01, 0.03}({0, 0, 0}) == 0.03);
}

TEST_CASE("A sphere that reaches into a finer zone holds the nodes that one of constant spacing would") {
  // Nodes that the field asks for within two of the length about x, over those of a constant spacing.
  const auto population = [](const SpacingField& field, const Vector3& x, double h, double length) {
    constexpr int cells = 40;
    double sum = 0;
    for (int i = 0; i < cells; ++i)
      for (int j = 0; j < cells; ++j)
        for (int k = 0; k < cells; ++k) {
          const Vector3 y = (Vector3(i, j, k).array() + 0.5).matrix() * (2.0 / cells) - Vector3::Ones();
          if (y.norm() < 1)
            sum += std::pow(h / field(x + 2 * length * y), 3) * std::pow(2.0 / cells * length / h, 3);
        }
    return sum / (4 * std::numbers::pi / 3);
  };
  const SpacingField point{0.004, 0.05, 0.35, 0.01, 1.5, {{0, 0, 0}}};
  SpacingField line = point;
  line.centres.clear();
  line.segments = {{Vector3(-0.1, 0, 0), Vector3(0.1, 0, 0)}};
  int shrunk = 0;
  for (const SpacingField& field : {point, line})
    for (const double distance : {0.0, 0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2, 0.4}) {
      const Vector3 x = distance * Vector3(0.1, 0.6, 0.8).normalized();
      const double h = field(x), reach = field.reach(x, h);
      INFO("distance " << distance << ", reach over spacing " << reach / h);
      CHECK(reach > 0.4 * h);
      CHECK(reach <= h);
      const double filled = population(field, x, h, reach);
      CHECK(filled < 1.12);
      if (reach < h) {
        ++shrunk;
        CHECK(filled > 0.88);
      }
    }
  CHECK(shrunk > 8);
  CHECK(point.reach({0.4, 0, 0}, 0.05) == 0.05); // far from the zone
  CHECK(point.reach({0, 0, 0}, 0.004) == 0.004); // in it
  CHECK(SpacingField{0.01, 0.03}.reach({0, 0, 0}, 0.03) == 0.03);
}

TEST_CASE("A box is filled evenly, with all its corners and edges") {
  const auto box = topology::make_box_domain({0, 0, 0}, {0.1, 0.08, 0.06}, 0.02);
  const SprinkleOptions options = uniform(0.01);
  const Sprinkling sprinkling = sprinkle(*box, options);
  const NodeCloud& nodes = sprinkling.nodes;
  check_cloud(*box, options, sprinkling);

  REQUIRE(sprinkling.report.zones.size() == 1);
  const SprinkleZone& zone = sprinkling.report.zones[0];
  CHECK(zone.expected == Approx(480).epsilon(1e-3));
  CHECK(zone.density > 1.0);
  CHECK(zone.density < 1.15);
  CHECK(zone.nearest_min >= 0.85);
  CHECK(zone.nearest_median > 0.9);
  CHECK(zone.nearest_median < 1.1);
  CHECK(sprinkling.report.interior_nodes + sprinkling.report.surface_nodes + sprinkling.report.edge_nodes ==
        nodes.size());

  for (int c = 0; c < 8; ++c) {
    const Vector3 corner((c & 1) != 0 ? 0.1 : 0, (c & 2) != 0 ? 0.08 : 0, (c & 4) != 0 ? 0.06 : 0);
    CHECK(count_near(nodes, corner, NodeKind::edge) == 1);
  }
  for (int k = 1; k < 10; ++k)
    CHECK(count_near(nodes, {0.01 * k, 0, 0.06}, NodeKind::edge) == 1);
  CHECK(sprinkling.report.edge_nodes == 8 + 4 * (9 + 7 + 5));
  for (int i = 0; i < nodes.size(); ++i) {
    if ((nodes.positions[i] - Vector3(0.1, 0.08, 0.06)).norm() < 1e-9)
      CHECK((nodes.normals[i] - Vector3(1, 1, 1).normalized()).norm() < 1e-9);
    if ((nodes.positions[i] - Vector3(0.05, 0, 0)).norm() < 1e-9)
      CHECK((nodes.normals[i] - Vector3(0, -1, -1).normalized()).norm() < 1e-9);
  }
}

TEST_CASE("The rim of a half ball is followed on the exact circle") {
  const auto hemisphere = topology::make_hemisphere_domain(0.1, 0.03); // coarse chords, sagitta 1 mm
  const SprinkleOptions options = uniform(0.015);
  const Sprinkling sprinkling = sprinkle(*hemisphere, options);
  check_cloud(*hemisphere, options, sprinkling);
  std::vector<double> angles;
  for (int i = 0; i < sprinkling.nodes.size(); ++i) {
    if (sprinkling.nodes.kinds[i] != NodeKind::edge)
      continue;
    const Vector3& x = sprinkling.nodes.positions[i];
    CHECK(std::abs(std::hypot(x.x(), x.y()) - 0.1) < 1e-9);
    CHECK(std::abs(x.z()) < 1e-9);
    const Vector3 mean = (x.normalized() - Vector3::UnitZ()).normalized();
    CHECK((sprinkling.nodes.normals[i] - mean).norm() < 1e-3);
    angles.push_back(std::atan2(x.y(), x.x()));
  }
  REQUIRE(angles.size() == std::lround(2 * std::numbers::pi * 0.1 / 0.015));
  std::sort(angles.begin(), angles.end());
  for (std::size_t k = 1; k < angles.size(); ++k)
    CHECK(angles[k] - angles[k - 1] == Approx(2 * std::numbers::pi / angles.size()).epsilon(0.05));
}

TEST_CASE("A graded half ball is full in every zone") {
  const auto hemisphere = topology::make_hemisphere_domain(0.1, 0.01);
  for (double slope : {0.3, 0.6})
    for (std::uint64_t seed : {1, 2, 3}) {
      SprinkleOptions options = graded_to_pole(slope);
      options.random_seed = seed;
      const Sprinkling sprinkling = sprinkle(*hemisphere, options);
      INFO("slope " << slope << ", seed " << seed);
      if (seed == 1)
        check_cloud(*hemisphere, options, sprinkling);
      REQUIRE(sprinkling.report.zones.size() >= 3);
      int nodes = 0;
      for (const SprinkleZone& zone : sprinkling.report.zones) {
        INFO("zone from " << zone.spacing_from << " to " << zone.spacing_to);
        CHECK(zone.density > 0.9);
        CHECK(zone.density < 1.3);
        CHECK(zone.nearest_min > 0.85);
        CHECK(zone.nearest_median > 0.88);
        CHECK(zone.nearest_median < 1.1);
        nodes += zone.nodes;
      }
      CHECK(nodes == sprinkling.nodes.size());
    }
}

TEST_CASE("A cylinder and a body without any edge are filled") {
  const auto cylinder = topology::make_cylinder_domain(0.05, 0.1, 0.01);
  const SprinkleOptions options = uniform(0.01);
  const Sprinkling sprinkling = sprinkle(*cylinder, options);
  check_cloud(*cylinder, options, sprinkling);
  // Without sharp edges the front has to start from the surface samples alone.
  SprinkleOptions smooth = options;
  smooth.sharp_edge_degrees = 180;
  const Sprinkling edgeless = sprinkle(*cylinder, smooth);
  CHECK(edgeless.report.edge_nodes == 0);
  check_cloud(*cylinder, smooth, edgeless);
}

TEST_CASE("An organ given by its triangles is filled as the exact body is") {
  const auto organ = topology::make_organ_domain(topology::make_cylinder(0.05, 0.1, 0.01), 0.004);
  const SprinkleOptions options = uniform(0.01);
  const Sprinkling sprinkling = sprinkle(*organ, options);
  check_cloud(*organ, options, sprinkling);
  const Sprinkling exact = sprinkle(*topology::make_cylinder_domain(0.05, 0.1, 0.01), options);
  CHECK(sprinkling.report.edge_nodes == exact.report.edge_nodes);
  CHECK(sprinkling.nodes.size() == Approx(exact.nodes.size()).epsilon(0.05));
  REQUIRE(sprinkling.report.zones.size() == 1);
  CHECK(sprinkling.report.zones[0].density > 1);
  CHECK(sprinkling.report.zones[0].density < 1.15);
}

TEST_CASE("The same random seed gives the same bits and another one other nodes") {
  const auto hemisphere = topology::make_hemisphere_domain(0.1, 0.02);
  SprinkleOptions options = graded_to_pole(0.4);
  const Sprinkling first = sprinkle(*hemisphere, options), second = sprinkle(*hemisphere, options);
  require_same_bits(first.nodes, second.nodes);
  options.random_seed = 2;
  const Sprinkling other = sprinkle(*hemisphere, options);
  CHECK(other.nodes.positions.back() != first.nodes.positions.back());
}

TEST_CASE("Seeds come first, unmoved, and others keep away from them") {
  const auto box = topology::make_box_domain({-0.05, -0.05, -0.1}, {0.05, 0.05, 0}, 0.02);
  SprinkleOptions options = uniform(0.01);
  options.seeds.push_back({{0, 0, 0}, NodeKind::surface});
  for (double radius : {0.0175, 0.0225}) // a pair of rings half a spacing apart
    for (int k = 0; k < 12; ++k) {
      const double angle = 2 * std::numbers::pi * k / 12;
      options.seeds.push_back({{radius * std::cos(angle), radius * std::sin(angle), 0}, NodeKind::surface});
    }
  options.seeds.push_back({{0.05, 0.013, 0}, NodeKind::edge});
  options.seeds.push_back({{0, 0, -0.05}, NodeKind::interior});
  const Sprinkling sprinkling = sprinkle(*box, options);
  check_cloud(*box, options, sprinkling);
  for (std::size_t k = 0; k < options.seeds.size(); ++k) {
    CHECK(sprinkling.nodes.positions[k] == options.seeds[k].position);
    CHECK(sprinkling.nodes.kinds[k] == options.seeds[k].kind);
  }
  CHECK((sprinkling.nodes.normals[0] - Vector3::UnitZ()).norm() < 1e-12);
  CHECK((sprinkling.nodes.normals[25] - Vector3(1, 0, 1).normalized()).norm() < 1e-9);
}

TEST_CASE("A sprinkling repeated without a move is the same cloud") {
  const auto hemisphere = topology::make_hemisphere_domain(0.1, 0.02);
  SprinkleOptions options = graded_to_pole(0.3);
  for (int k = 0; k < 8; ++k) {
    const double angle = 2 * std::numbers::pi * k / 8;
    for (double r : {0.009, 0.012}) {
      const Vector3 x = Vector3(r * std::cos(angle), r * std::sin(angle), 0.1).normalized() * 0.1;
      options.seeds.push_back({x, NodeKind::surface});
    }
  }
  const Sprinkling first = sprinkle(*hemisphere, options);
  CHECK(first.kept_from.empty());
  const Sprinkling again = resprinkle(*hemisphere, options, first.nodes);
  require_same_bits(first.nodes, again.nodes);
  REQUIRE(std::ssize(again.kept_from) == first.nodes.size());
  for (int i = 0; i < first.nodes.size(); ++i)
    CHECK(again.kept_from[i] == i);
}

TEST_CASE("A small slide of the fine zone keeps most nodes and fills what it leaves") {
  const auto hemisphere = topology::make_hemisphere_domain(0.1, 0.01);
  SprinkleOptions options = graded_to_pole(0.3);
  NodeCloud previous = sprinkle(*hemisphere, options).nodes;
  for (int step = 1; step <= 5; ++step) { // 6 mm, one fine spacing, each
    const double angle = 0.06 * step;
    options.spacing.centres = {{0.1 * std::sin(angle), 0, 0.1 * std::cos(angle)}};
    const Sprinkling slid = resprinkle(*hemisphere, options, previous);
    INFO("step " << step);
    check_cloud(*hemisphere, options, slid);
    for (const SprinkleZone& zone : slid.report.zones) {
      CHECK(zone.density > 0.85);
      CHECK(zone.density < 1.35);
      CHECK(zone.nearest_min >= 0.7);
      CHECK(zone.nearest_median > 0.8);
    }
    REQUIRE(std::ssize(slid.kept_from) == slid.nodes.size());
    int kept = 0, last = -1, wrong = 0;
    for (int i = 0; i < slid.nodes.size(); ++i)
      if (const int from = slid.kept_from[i]; from >= 0) {
        wrong += slid.nodes.positions[i] != previous.positions[from] || from <= last;
        last = from;
        ++kept;
      }
    CHECK(wrong == 0);
    CHECK(kept > 0.6 * previous.size());
    CHECK(kept < previous.size());
    previous = slid.nodes;
  }
}

TEST_CASE("A far move of the fine zone leaves no trace of the old one") {
  const auto box = topology::make_box_domain({0, 0, 0}, {0.1, 0.05, 0.05}, 0.01);
  SprinkleOptions options;
  options.spacing = {0.004, 0.012, 0.3, 0.005, 1.5, {{0.02, 0.025, 0.05}}};
  const NodeCloud previous = sprinkle(*box, options).nodes;
  options.spacing.centres = {{0.08, 0.025, 0.05}};
  const Sprinkling moved = resprinkle(*box, options, previous);
  check_cloud(*box, options, moved);
  int stale = 0;
  for (int i = 0; i < moved.nodes.size(); ++i)
    stale += moved.nodes.positions[i].x() < 0.04 && moved.nodes.spacings[i] < 0.008;
  CHECK(stale == 0);
  const int fresh = sprinkle(*box, options).nodes.size();
  CHECK(std::abs(moved.nodes.size() - fresh) < 0.1 * fresh);
}

TEST_CASE("An emptied zone is reported and refused") {
  const auto hemisphere = topology::make_hemisphere_domain(0.1, 0.01);
  const SprinkleOptions options = graded_to_pole(0.3);
  const NodeCloud full = sprinkle(*hemisphere, options).nodes;
  NodeCloud hollow; // every second coarse node is lost
  int coarse = 0;
  for (int i = 0; i < full.size(); ++i)
    if (full.spacings[i] < 0.015 || coarse++ % 2 != 0)
      hollow.add(full, i);
  CHECK_NOTHROW(require_filled(inspect_filling(*hemisphere, options, full), 0.8));
  const SprinkleReport report = inspect_filling(*hemisphere, options, hollow);
  CHECK(report.zones.front().density > 0.9);
  CHECK(report.zones.back().density < 0.65);
  CHECK_THROWS_AS(require_filled(report, 0.8), NumericalError);
  CHECK_THROWS_WITH(require_filled(report, 0.8), Contains("under-filled"));
  SprinkleOptions strict = options;
  strict.minimum_density = 2;
  CHECK_THROWS_AS(sprinkle(*hemisphere, strict), NumericalError);
}

TEST_CASE("The number of nodes is foreseen and can be asked for") {
  const auto box = topology::make_box_domain({0, 0, 0}, {0.1, 0.1, 0.1}, 0.05);
  const auto hemisphere = topology::make_hemisphere_domain(0.1, 0.01);
  const SpacingField flat{0.01, 0.01}, graded = graded_to_pole(0.3).spacing;
  const auto check = [](const topology::Domain& domain, const SpacingField& shape, int target) {
    SprinkleOptions options;
    options.spacing = spacing_for_count(domain, shape, target);
    const int made = sprinkle(domain, options).nodes.size();
    INFO("target " << target << ", made " << made);
    CHECK(std::abs(made - target) < std::max(5.0, 0.04 * target));
    CHECK(expected_count(domain, options.spacing) == Approx(made).epsilon(0.1));
    CHECK(options.spacing.coarse / options.spacing.fine == Approx(shape.coarse / shape.fine));
  };
  for (int target : {100, 500, 1500}) {
    check(*box, flat, target);
    check(*hemisphere, flat, target);
    check(*hemisphere, graded, target);
  }
  CHECK_THROWS_AS(spacing_for_count(*box, flat, 3), InputError);
  CHECK_THROWS_AS(spacing_for_count(*box, flat, 300000), InputError);
}

TEST_CASE("Options out of range are refused with the value and the limit") {
  const auto box = topology::make_box_domain({0, 0, 0}, {0.1, 0.1, 0.1}, 0.05);
  const auto refused = [&](auto&& change, const char* part) {
    SprinkleOptions options = uniform(0.02);
    change(options);
    INFO(part);
    CHECK_THROWS_AS(sprinkle(*box, options), InputError);
    CHECK_THROWS_WITH(sprinkle(*box, options), Contains(part));
  };
  refused([](SprinkleOptions& o) { o.spacing.fine = 0; }, "spacing.fine is 0");
  refused([](SprinkleOptions& o) { o.spacing.fine = std::nan(""); }, "spacing.fine");
  refused([](SprinkleOptions& o) { o.spacing.coarse = 0.01; }, "spacing.coarse is 0.01");
  refused([](SprinkleOptions& o) { o.spacing.slope = 1.5; }, "spacing.slope is 1.5");
  refused([](SprinkleOptions& o) { o.wall_clearance = -1; }, "wall_clearance is -1");
  refused([](SprinkleOptions& o) { o.maximum_nodes = 100; }, "maximum_nodes = 100");
  refused([](SprinkleOptions& o) { o.spacing.fine = o.spacing.coarse = 1e-5; }, "maximum_nodes = 200000");
  refused([](SprinkleOptions& o) { o.spacing.fine = o.spacing.coarse = 1; }, "at least 4");
  refused([](SprinkleOptions& o) { o.seeds.push_back({{0.2, 0, 0}, NodeKind::surface}); }, "outside the body");
  refused([](SprinkleOptions& o) { o.seeds.push_back({{0.05, 0.05, 0.05}, NodeKind::surface}); }, "inside the body");
  refused([](SprinkleOptions& o) { o.seeds.assign(2, {{0.05, 0.05, 0.1}, NodeKind::surface}); }, "another seed");
}
