// Sprinkling around cuts: lip pairs, rings about the front, rims, severed pieces.
#include "solvers/nodes/nodes.hpp"
#include "tests/support/cut_sheets.hpp"
#include "topology/base/errors.hpp"
#include "topology/organ/organs.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

using namespace spherecut;
using namespace spherecut::solvers;
using namespace spherecut::tests;
using Catch::Matchers::Contains;

namespace {

using Sheets = std::vector<topology::SurfaceMesh>;

std::shared_ptr<const topology::Domain> block() {
  return topology::make_box_domain({0, 0, 0}, {0.1, 0.08, 0.06}, 0.02);
}

SprinkleOptions cut_options(const std::shared_ptr<const topology::Domain>& domain, Sheets sheets, double h) {
  SprinkleOptions options;
  options.ring_ahead = true;
  options.spacing.fine = options.spacing.coarse = h;
  options.incision = std::make_shared<topology::Incision>(std::move(sheets), domain);
  return options;
}

SprinkleOptions finer_at_front(SprinkleOptions options, double fine) {
  options.spacing.fine = fine;
  options.spacing.segments = front_segments(*options.incision, 2 * fine);
  return options;
}

/// Distance of two nodes in units of their mean spacing.
double gap(const NodeCloud& nodes, int i, int j) {
  return 2 * (nodes.positions[i] - nodes.positions[j]).norm() / (nodes.spacings[i] + nodes.spacings[j]);
}

/// Pairs are complete, mutually hidden and in place; nobody is outside, on a sheet or too near to one it sees; every
/// place of the body sees a node within reach; the zones are full.
void check_cut_cloud(const topology::Domain& domain, const SprinkleOptions& options, const Sprinkling& sprinkling,
                     double smallest_gap = 0.55) {
  const topology::Incision& incision = *options.incision;
  const NodeCloud& nodes = sprinkling.nodes;
  const std::vector<int> partners = lip_partners(nodes);
  int alone = 0, seen = 0, misplaced = 0, wrong_side = 0, crowded = 0, near_sheet = 0;
  for (int i = 0; i < nodes.size(); ++i) {
    const Vector3& x = nodes.positions[i];
    const double h = nodes.spacings[i], distance = domain.signed_distance(x);
    const auto sheet = incision.closest(x, 0.25 * h);
    if (nodes.kinds[i] == NodeKind::lip) {
      const int j = partners[i];
      if (j < 0 || partners[j] != i) {
        ++alone;
        continue;
      }
      seen += !incision.blocks(x, nodes.positions[j]);
      misplaced +=
          std::abs((x - nodes.positions[j]).dot(nodes.normals[i]) + 2 * lip_offset * h) > 0.02 * lip_offset * h;
      misplaced += !sheet || std::abs(sheet->distance - lip_offset * h) > 0.05 * lip_offset * h;
      // The normal points out of the material: at the sheet.
      wrong_side += !incision.blocks(x, x + 2 * lip_offset * h * nodes.normals[i]);
      wrong_side += std::abs(nodes.normals[i].norm() - 1) > 1e-12 || distance > 1e-9;
    } else {
      near_sheet += sheet.has_value();
      wrong_side += nodes.kinds[i] == NodeKind::interior ? distance > -0.25 * h : std::abs(distance) > 1e-9;
    }
    for (int j = 0; j < nodes.size(); ++j)
      crowded +=
          j != i && j != partners[i] && gap(nodes, i, j) < smallest_gap && !incision.blocks(x, nodes.positions[j]);
  }
  CHECK(alone == 0);
  CHECK(seen == 0);
  CHECK(misplaced == 0);
  CHECK(wrong_side == 0);
  CHECK(near_sheet == 0);
  CHECK(crowded == 0);

  const BoundingBox box = domain.bounds();
  constexpr int probes = 16;
  double farthest = 0;
  for (int i = 0; i < probes; ++i)
    for (int j = 0; j < probes; ++j)
      for (int k = 0; k < probes; ++k) {
        const Vector3 x = box.lower + box.extent().cwiseProduct(Vector3(i + 0.51, j + 0.49, k + 0.52)) / probes;
        if (domain.signed_distance(x) > 0)
          continue;
        double nearest = std::numeric_limits<double>::infinity();
        for (const Vector3& y : nodes.positions)
          if ((x - y).norm() < nearest && !incision.blocks(x, y))
            nearest = (x - y).norm();
        farthest = std::max(farthest, nearest / options.spacing(x));
      }
  CHECK(farthest < 1.05);
  for (const SprinkleZone& zone : sprinkling.report.zones) {
    CHECK(zone.density > 0.9);
    CHECK(zone.density < 1.25);
    CHECK(zone.nearest_min >= smallest_gap - 0.05);
  }
}

/// Distances of the lip pairs and of the interior nodes nearest to the front, in units of h, at equal steps along it.
struct Rings {
  double behind_min = 1e9, behind_max = 0, ahead_min = 1e9, ahead_max = 0;
};
Rings measure_rings(const NodeCloud& nodes, const topology::Incision& incision, const topology::Domain& domain) {
  Rings rings;
  for (const topology::FrontSegment& piece : incision.front()) {
    const Vector3 p = 0.5 * (piece.from + piece.to);
    double behind = 1e9, ahead = 1e9, h = 0;
    for (int i = 0; i < nodes.size(); ++i) {
      const auto frame = incision.front_frame(nodes.positions[i], nodes.spacings[i]);
      if (!frame || (frame->point - p).norm() > 0.6 * nodes.spacings[i])
        continue;
      h = nodes.spacings[i];
      if (nodes.kinds[i] == NodeKind::lip)
        behind = std::min(behind, frame->distance / h);
      else
        ahead = std::min(ahead, frame->distance / h);
    }
    if (h == 0 || domain.signed_distance(p) > -h)
      continue;
    rings.behind_min = std::min(rings.behind_min, behind);
    rings.behind_max = std::max(rings.behind_max, behind);
    rings.ahead_min = std::min(rings.ahead_min, ahead);
    rings.ahead_max = std::max(rings.ahead_max, ahead);
  }
  return rings;
}

} // namespace

TEST_CASE("The spacing field is fine along segments too, and grows with its slope from them") {
  SpacingField field{0.01, 0.03, 0.5, 0.02, 1.5, {}};
  field.segments = {{Vector3(0, 0, 0), Vector3(1, 0, 0)}};
  CHECK(field.finest() == 0.01);
  CHECK(field({0.5, 0.014, 0}) == 0.01);
  CHECK(field({0.5, 0, 0.025}) == Approx(0.015));
  CHECK(field({1.025, 0, 0}) == Approx(0.015));
  CHECK(field({0.5, 1, 0}) == 0.03);
  field.centres = {{0.5, 0.1, 0}}; // with its radius of 0.02
  CHECK(field({0.5, 0.1, 0.045}) == Approx(0.015));
  CHECK(SpacingField{0.01, 0.03}.finest() == 0.03);
}

TEST_CASE("A front is handed on to the spacing field in few pieces that follow it") {
  const auto domain = block();
  const topology::Incision incision({disc_sheet({0.05, 0.04, 0.03}, {0.3, 0.2, 1}, 0.02, 3, 96)}, domain);
  const auto segments = front_segments(incision, 0.006);
  CHECK(segments.size() < 30);
  double length = 0, worst = 0;
  for (const auto& [a, b] : segments) {
    length += (b - a).norm();
    for (double t : {0.0, 0.5, 1.0})
      worst = std::max(worst, std::abs((a + t * (b - a) - Vector3(0.05, 0.04, 0.03)).norm() - 0.02));
  }
  CHECK(length == Approx(incision.front_length()).epsilon(0.01));
  CHECK(worst < 3e-4);
  CHECK_THROWS_AS(front_segments(incision, 0), InputError);
}

TEST_CASE("A cut from the surface gets lip pairs, rings about its front and a rim") {
  const auto domain = block();
  for (const Sheets& sheets : {Sheets{flat_sheet({-0.01, -0.01, 0.031}, {0.06, 0, 0}, {0, 0.1, 0}, 6, 10)},
                               Sheets{flat_sheet({0.043, -0.01, 0.07}, {0.003, 0.1, 0}, {-0.01, 0, -0.04}, 9, 4)}}) {
    const SprinkleOptions options = cut_options(domain, sheets, 0.01);
    const Sprinkling sprinkling = sprinkle(*domain, options);
    check_cut_cloud(*domain, options, sprinkling, 0.8);
    const Rings rings = measure_rings(sprinkling.nodes, *options.incision, *domain);
    CHECK(rings.behind_min == Approx(0.5).margin(0.01));
    CHECK(rings.behind_max < 0.75);
    CHECK(rings.ahead_min == Approx(0.5).margin(0.01));
    CHECK(rings.ahead_max < 0.75);
    // The rim: pairs on the surface at steps of about h, none farther than h from the next along it.
    const NodeCloud& nodes = sprinkling.nodes;
    int rim = 0;
    for (int i = 0; i < nodes.size(); ++i)
      if (nodes.kinds[i] == NodeKind::lip && std::abs(domain->signed_distance(nodes.positions[i])) < 1e-9) {
        ++rim;
        std::vector<double> distances;
        for (int j = 0; j < nodes.size(); ++j)
          if (nodes.kinds[j] == NodeKind::lip && std::abs(domain->signed_distance(nodes.positions[j])) < 1e-9)
            distances.push_back((nodes.positions[i] - nodes.positions[j]).norm() / 0.01);
        std::sort(distances.begin(), distances.end()); // itself, its partner, the next pair
        CHECK(distances[2] > 0.6);
        CHECK(distances[2] < 1.2);
      }
    CHECK(rim > 24);
    REQUIRE(sprinkling.report.pieces.size() == 1);
    CHECK(sprinkling.report.pieces[0].nodes == nodes.size());
    CHECK(expected_count(*domain, options.spacing, 40, options.incision.get()) == Approx(nodes.size()).epsilon(0.1));
  }
}

TEST_CASE("A through cut leaves two full halves") {
  const auto domain = block();
  // Tilted; and exactly between the faces of the block, where the sheet ends on the surface.
  for (const Sheets& sheets : {Sheets{flat_sheet({0.047, -0.01, -0.01}, {0.01, 0.1, 0}, {0.003, 0, 0.08}, 1, 1)},
                               Sheets{flat_sheet({0, 0, 0.03}, {0.1, 0, 0}, {0, 0.08, 0}, 5, 4)}}) {
    const SprinkleOptions options = cut_options(domain, sheets, 0.01);
    const Sprinkling sprinkling = sprinkle(*domain, options);
    check_cut_cloud(*domain, options, sprinkling, 0.8);
    REQUIRE(sprinkling.report.pieces.size() == 2);
    const std::vector<int> piece_of = node_pieces(sprinkling.nodes, *options.incision);
    for (int p : {0, 1}) {
      CHECK(std::count(piece_of.begin(), piece_of.end(), p) == sprinkling.report.pieces[p].nodes);
      CHECK(sprinkling.report.pieces[p].nodes > 300);
      CHECK_FALSE(sprinkling.report.pieces[p].flat);
    }
    int across = 0, lips = 0;
    for (int i = 0; i < sprinkling.nodes.size(); ++i) {
      lips += sprinkling.nodes.kinds[i] == NodeKind::lip ? (piece_of[i] == 0 ? 1 : -1) : 0;
      for (int j = 0; j < i; ++j)
        across += piece_of[i] != piece_of[j] &&
                  !options.incision->blocks(sprinkling.nodes.positions[i], sprinkling.nodes.positions[j]);
    }
    CHECK(lips == 0);
    CHECK(across == 0);
  }
}

TEST_CASE("A buried disc in a graded cloud has regular rings inside and outside its front") {
  const auto domain = block();
  const SprinkleOptions options =
      finer_at_front(cut_options(domain, {disc_sheet({0.05, 0.04, 0.03}, {0.3, 0.2, 1}, 0.02, 4, 32)}, 0.008), 0.004);
  const Sprinkling sprinkling = sprinkle(*domain, options);
  check_cut_cloud(*domain, options, sprinkling, 0.7);
  const Rings rings = measure_rings(sprinkling.nodes, *options.incision, *domain);
  CHECK(rings.behind_min > 0.47);
  CHECK(rings.behind_max < 0.75);
  CHECK(rings.ahead_min > 0.47);
  CHECK(rings.ahead_max < 0.75);
  CHECK(sprinkling.report.lip_nodes == Approx(2 * 0.02 * 0.02 * 3.14159 / (0.004 * 0.004)).epsilon(0.25));
  // On a body of 8 spacings the nodes near the front are those of the fine zone.
  double farthest_fine = 0;
  for (int i = 0; i < sprinkling.nodes.size(); ++i)
    if (sprinkling.nodes.spacings[i] < 0.0041)
      farthest_fine =
          std::max(farthest_fine, options.incision->front_frame(sprinkling.nodes.positions[i], 1)->distance);
  CHECK(farthest_fine < 0.008);
}

TEST_CASE("A disc smaller than its rings still gets a pair") {
  const auto domain = block();
  const SprinkleOptions options =
      cut_options(domain, {disc_sheet({0.05, 0.04, 0.03}, {0.3, 0.2, 1}, 0.004, 2, 16)}, 0.01);
  const Sprinkling sprinkling = sprinkle(*domain, options);
  check_cut_cloud(*domain, options, sprinkling, 0.5);
  CHECK(sprinkling.report.lip_nodes == 2);
}

TEST_CASE("Corners of a front and curved sheets keep their pairs on the sheet") {
  const auto domain = block();
  SprinkleOptions options =
      cut_options(domain, {flat_sheet({0.03, 0.02, 0.03}, {0.04, 0, 0.006}, {0, 0.04, 0.005}, 3, 3)}, 0.008);
  check_cut_cloud(*domain, options, sprinkle(*domain, options), 0.5);
  options =
      cut_options(domain,
                  {mapped_sheet(16, 8,
                                [](double s, double t) {
                                  return Vector3(0.05 + 0.02 * std::sin(3 * t - 1.2), -0.01 + 0.1 * s, 0.07 - 0.05 * t);
                                })},
                  0.008);
  check_cut_cloud(*domain, options, sprinkle(*domain, options), 0.6);
}

TEST_CASE("Crossing sheets keep their pairs off the line where they cross and fill every quarter") {
  const auto domain = block();
  const SprinkleOptions options =
      cut_options(domain,
                  {flat_sheet({0.047, -0.01, -0.01}, {0.01, 0.1, 0}, {0.003, 0, 0.08}, 3, 3),
                   flat_sheet({-0.01, 0.037, -0.01}, {0.12, 0.005, 0}, {0.003, 0, 0.08}, 3, 3)},
                  0.01);
  const Sprinkling sprinkling = sprinkle(*domain, options);
  check_cut_cloud(*domain, options, sprinkling, 0.5);
  REQUIRE(sprinkling.report.pieces.size() == 4);
  for (const SprinklePiece& piece : sprinkling.report.pieces)
    CHECK(piece.nodes > 150);
  // Two quarters of a lip node's surroundings see it; its own sheet is nearest, the other no nearer than 0.25 h.
  for (int i = 0; i < sprinkling.nodes.size(); ++i)
    if (sprinkling.nodes.kinds[i] == NodeKind::lip) {
      const Vector3& x = sprinkling.nodes.positions[i];
      const int sheet = options.incision->closest(x, 0.01)->sheet;
      const topology::Incision other({options.incision->sheets()[1 - sheet]}, domain);
      CHECK(other.closest(x, 1)->distance > 0.2 * 0.01);
    }
}

TEST_CASE("A cut in a half ball puts its rim on the exact sphere and on the circle of its base") {
  const auto domain = topology::make_hemisphere_domain(0.1, 0.01);
  const SprinkleOptions options =
      cut_options(domain, {flat_sheet({0.013, -0.12, -0.02}, {0.02, 0.24, 0}, {0, 0.01, 0.14}, 4, 4)}, 0.015);
  const Sprinkling sprinkling = sprinkle(*domain, options);
  check_cut_cloud(*domain, options, sprinkling, 0.7);
  int sphere = 0, base = 0, circle = 0;
  for (int i = 0; i < sprinkling.nodes.size(); ++i)
    if (const Vector3& x = sprinkling.nodes.positions[i]; sprinkling.nodes.kinds[i] == NodeKind::lip) {
      const bool on_sphere = std::abs(x.norm() - 0.1) < 1e-9, on_base = std::abs(x.z()) < 1e-9;
      sphere += on_sphere && !on_base;
      base += on_base && !on_sphere;
      circle += on_sphere && on_base;
    }
  CHECK(circle == 4);
  CHECK(base > 20);
  CHECK(sphere > 30);
}

TEST_CASE("A cut in an organ given by triangles is lined like any other") {
  const auto domain = topology::make_organ_domain(topology::make_liver(5000));
  const SprinkleOptions options =
      cut_options(domain, {flat_sheet({-0.02, -0.1, 0}, {0.01, 0.2, 0}, {0.003, 0, 0.1}, 10, 10)}, 0.02);
  const Sprinkling sprinkling = sprinkle(*domain, options);
  check_cut_cloud(*domain, options, sprinkling, 0.7);
  CHECK(sprinkling.report.lip_nodes > 20);
}

TEST_CASE("A thin slice gets nodes on both faces and one that is thinner still is reported flat") {
  const auto domain = block();
  const auto slice = [&](double thickness) {
    const SprinkleOptions options =
        cut_options(domain, {flat_sheet({-0.01, -0.01, 0.06 - thickness}, {0.12, 0, 0}, {0, 0.1, 0}, 6, 5)}, 0.01);
    return sprinkle(*domain, options).report.pieces;
  };
  for (double thickness : {0.003, 0.0015}) {
    const auto pieces = slice(thickness);
    REQUIRE(pieces.size() == 2);
    CHECK(pieces[1].nodes > 150);
    CHECK_FALSE(pieces[1].flat);
  }
  const auto pieces = slice(2e-4);
  REQUIRE(pieces.size() == 2);
  CHECK(pieces[1].flat);
}

TEST_CASE("A cut cloud depends on its random seed alone") {
  const auto domain = block();
  SprinkleOptions options = cut_options(domain, {disc_sheet({0.05, 0.04, 0.03}, {0.3, 0.2, 1}, 0.025, 3, 24)}, 0.01);
  const NodeCloud first = sprinkle(*domain, options).nodes, second = sprinkle(*domain, options).nodes;
  CHECK(first.positions == second.positions);
  CHECK(first.normals == second.normals);
  options.random_seed = 2;
  CHECK(sprinkle(*domain, options).nodes.positions != first.positions);
}

TEST_CASE("A seed on a sheet is refused, one beside it keeps the pairs away") {
  const auto domain = block();
  SprinkleOptions options =
      cut_options(domain, {flat_sheet({0.05, -0.01, 0.03}, {0, 0.1, 0}, {0, 0, 0.04}, 4, 4)}, 0.01);
  options.seeds.push_back({{0.05, 0.04, 0.06}, NodeKind::surface});
  CHECK_THROWS_AS(sprinkle(*domain, options), InputError);
  CHECK_THROWS_WITH(sprinkle(*domain, options), Contains("sheet of the incision"));
  options.seeds[0].position.x() = 0.051;
  const Sprinkling sprinkling = sprinkle(*domain, options);
  CHECK(sprinkling.nodes.positions[0] == options.seeds[0].position);
  for (int i = 1; i < sprinkling.nodes.size(); ++i)
    CHECK(gap(sprinkling.nodes, 0, i) > 0.35);
}
