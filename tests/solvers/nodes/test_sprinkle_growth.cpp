// Sprinkling around a cut that grows: what stays, what goes, and that the region of an increment is as full as any.
#include "solvers/nodes/nodes.hpp"
#include "tests/support/cut_sheets.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

using namespace spherecut;
using namespace spherecut::solvers;
using namespace spherecut::tests;

namespace {

std::shared_ptr<const topology::Domain> growing_block() {
  return topology::make_box_domain({0, 0, 0}, {0.1, 0.08, 0.06}, 0.02);
}

/// An edge cut, tilted against the block, `steps` increments of 3 mm deep.
std::shared_ptr<const topology::Incision> edge_cut(const std::shared_ptr<const topology::Domain>& domain, int steps) {
  const Vector3 ahead = Vector3(1, 0.05, -0.1).normalized(), side = Vector3(0, 1, 0.05).normalized();
  topology::SurfaceMesh sheet;
  for (int i = 0; i <= steps + 3; ++i)
    for (int j = 0; j <= 10; ++j)
      sheet.vertices.emplace_back(Vector3(-0.01, -0.015, 0.035) + 0.003 * i * ahead + 0.011 * j * side);
  for (int i = 0; i < steps + 3; ++i)
    for (int j = 0; j < 10; ++j) {
      const int a = 11 * i + j, b = a + 11;
      sheet.triangles.push_back({a, b, b + 1});
      sheet.triangles.push_back({a, b + 1, a + 1});
    }
  return std::make_shared<topology::Incision>(std::vector{sheet}, domain, steps);
}

/// A cloud that loses and gains nodes.
struct GrowingCloud {
  NodeCloud nodes;
  int left; // of those that it began with, which come first
  explicit GrowingCloud(const NodeCloud& start) : nodes(start), left(start.size()) {}
  void apply(const SprinkleIncrement& increment) {
    NodeCloud next;
    for (int i = 0; i < nodes.size(); ++i)
      if (!std::binary_search(increment.removed.begin(), increment.removed.end(), i))
        next.add(nodes, i);
    left -= static_cast<int>(std::count_if(increment.removed.begin(), increment.removed.end(),
                                           [this](int removed) { return removed < left; }));
    for (int i = 0; i < increment.added.size(); ++i)
      next.add(increment.added, i);
    nodes = std::move(next);
  }
};

void check_grown(const topology::Domain& domain, const SprinkleOptions& options, const NodeCloud& nodes) {
  const topology::Incision& incision = *options.incision;
  const std::vector<int> partners = lip_partners(nodes);
  int wrong = 0, crowded = 0, near_sheet = 0;
  for (int i = 0; i < nodes.size(); ++i) {
    const Vector3& x = nodes.positions[i];
    const double h = nodes.spacings[i];
    wrong += nodes.reaches[i] != options.spacing.reach(x, h);
    if (nodes.kinds[i] == NodeKind::lip)
      wrong += partners[i] < 0 || partners[partners[i]] != i || !incision.blocks(x, nodes.positions[partners[i]]);
    else
      near_sheet += incision.closest(x, 0.29 * h).has_value();
    for (int j = 0; j < i; ++j)
      crowded +=
          j != partners[i] && (nodes.positions[j] - x).norm() < 0.55 * h && !incision.blocks(x, nodes.positions[j]);
  }
  CHECK(wrong == 0);
  CHECK(near_sheet == 0);
  CHECK(crowded == 0);
  const BoundingBox box = domain.bounds();
  constexpr int probes = 16;
  double farthest = 0;
  for (int i = 0; i < probes; ++i)
    for (int j = 0; j < probes; ++j)
      for (int k = 0; k < probes; ++k) {
        const Vector3 x = box.lower + box.extent().cwiseProduct(Vector3(i + 0.51, j + 0.49, k + 0.52)) / probes;
        double nearest = 1e9;
        for (const Vector3& y : nodes.positions)
          if ((x - y).norm() < nearest && !incision.blocks(x, y))
            nearest = (x - y).norm();
        farthest = std::max(farthest, nearest / options.spacing(x));
      }
  CHECK(farthest < 1.15);
  for (const SprinkleZone& zone : inspect_filling(domain, options, nodes).zones) {
    CHECK(zone.density > 0.9);
    CHECK(zone.density < 1.25);
  }
  // Rings: on the middle of the front, pairs behind within 0.25 to 1.1 h, single nodes ahead within 0.3 to 0.9 h.
  for (const topology::FrontSegment& piece : incision.front()) {
    const Vector3 p = 0.5 * (piece.from + piece.to);
    const double h = options.spacing(p);
    if (domain.signed_distance(p) > -1.2 * h)
      continue;
    double behind = 1e9, ahead = 1e9;
    for (int i = 0; i < nodes.size(); ++i)
      if (const auto frame = incision.front_frame(nodes.positions[i], 1.5 * h);
          frame && (frame->point - p).norm() < 0.7 * h) {
        double& least = nodes.kinds[i] == NodeKind::lip ? behind : ahead;
        least = std::min(least, frame->distance / h);
      }
    CHECK(behind > 0.24);
    CHECK(behind < 1.15);
    CHECK(ahead > 0.29);
    CHECK(ahead < (options.ring_ahead ? 0.95 : 1.05));
  }
}

} // namespace

TEST_CASE("A cut grown by twenty increments keeps distant nodes and stays as full as one made at once") {
  const auto domain = growing_block();
  const bool ring_ahead = GENERATE(false, true);
  for (double h : {0.01, 0.0075}) {
    INFO("h " << h << ", ring ahead " << ring_ahead);
    SprinkleOptions options;
    options.ring_ahead = ring_ahead;
    options.spacing.fine = options.spacing.coarse = h;
    const NodeCloud uncut = sprinkle(*domain, options).nodes;
    GrowingCloud cloud(uncut);
    std::shared_ptr<const topology::Incision> before;
    std::size_t most_changed = 0;
    for (int step = 1; step <= 20; ++step) {
      options.incision = edge_cut(domain, step);
      const SprinkleIncrement increment = extend_sprinkling(*domain, options, cloud.nodes, before.get());
      INFO("step " << step);
      CHECK(increment.touched.density > 0.8);
      CHECK(std::is_sorted(increment.removed.begin(), increment.removed.end()));
      // Nothing changes beyond two spacings of the increment, 3 mm wide at the front.
      const auto is_far = [&](const Vector3& x) {
        const auto frame = options.incision->front_frame(x, 1);
        return frame->distance > std::sqrt(3.0) * 2 * h + 0.012;
      };
      if (before) {
        for (int j : increment.removed) {
          CHECK_FALSE(is_far(cloud.nodes.positions[j]));
          CHECK(cloud.nodes.kinds[j] != NodeKind::lip);
        }
        for (const Vector3& x : increment.added.positions)
          CHECK_FALSE(is_far(x));
        most_changed = std::max(most_changed, increment.removed.size() + increment.added.positions.size());
      }
      cloud.apply(increment);
      before = options.incision;
      if (step % 7 == 0)
        check_grown(*domain, options, cloud.nodes);
    }
    const NodeCloud &grown = cloud.nodes, direct = sprinkle(*domain, options).nodes;
    check_grown(*domain, options, grown);
    CHECK(grown.size() == Approx(direct.size()).epsilon(0.15));
    CHECK(most_changed < 100);
    CHECK(cloud.left > 0.6 * uncut.size());
  }
}

TEST_CASE("Nothing happens where the cut has not grown, and bad increments are refused") {
  const auto domain = growing_block();
  SprinkleOptions options;
  options.spacing.fine = options.spacing.coarse = 0.01;
  options.incision = edge_cut(domain, 5);
  const NodeCloud nodes = sprinkle(*domain, options).nodes;
  const SprinkleIncrement none = extend_sprinkling(*domain, options, nodes, edge_cut(domain, 5).get());
  CHECK(none.removed.empty());
  CHECK(none.added.size() == 0);
  options.incision = nullptr;
  CHECK_THROWS_AS(extend_sprinkling(*domain, options, nodes, nullptr), InputError);
}

TEST_CASE("An increment found twice is the same to the bit") {
  const auto domain = growing_block();
  SprinkleOptions options;
  options.spacing.fine = options.spacing.coarse = 0.01;
  options.incision = edge_cut(domain, 5);
  const NodeCloud nodes = sprinkle(*domain, options).nodes;
  options.incision = edge_cut(domain, 7);
  const auto before = edge_cut(domain, 5);
  const SprinkleIncrement one = extend_sprinkling(*domain, options, nodes, before.get());
  const SprinkleIncrement two = extend_sprinkling(*domain, options, nodes, before.get());
  CHECK(one.removed == two.removed);
  CHECK(one.added.positions == two.added.positions);
  CHECK(one.added.normals == two.added.normals);
}

TEST_CASE("Sprinkling anew around a grown cut keeps the lips it had and all nodes away from it") {
  const auto domain = growing_block();
  SprinkleOptions options;
  options.spacing.fine = options.spacing.coarse = 0.009;
  options.incision = edge_cut(domain, 6);
  const Sprinkling first = sprinkle(*domain, options);
  const Sprinkling again = resprinkle(*domain, options, first.nodes);
  CHECK(again.nodes.positions == first.nodes.positions);
  CHECK(again.nodes.kinds == first.nodes.kinds);
  options.incision = edge_cut(domain, 9);
  const Sprinkling grown = resprinkle(*domain, options, first.nodes);
  check_grown(*domain, options, grown.nodes);
  std::vector<bool> kept(first.nodes.size(), false);
  for (int i = 0; i < grown.nodes.size(); ++i)
    if (const int from = grown.kept_from[i]; from >= 0) {
      kept[from] = true;
      CHECK(grown.nodes.positions[i] == first.nodes.positions[from]);
    }
  int lips_lost = 0, far_lost = 0;
  for (int j = 0; j < first.nodes.size(); ++j) {
    lips_lost += !kept[j] && first.nodes.kinds[j] == NodeKind::lip;
    far_lost += !kept[j] && options.incision->front_frame(first.nodes.positions[j], 1)->distance > 0.02;
  }
  CHECK(lips_lost == 0);
  CHECK(far_lost == 0);
}
