// Wavy strokes of a scalpel through a body that moves between one increment and the next, as it does for a busy solver.
#include "src/model/incision_builder.hpp"
#include "src/tissue/cut_checks.hpp"
#include "topology/wound/splinters.hpp"

#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <random>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

constexpr double spacing = 0.006, edge = 0.5 * spacing; // m

const std::string scalpel = R"([blade]
edge = [[0, 0, 0], [0.010, 0, 0.007], [0.022, 0, 0.024]]
[[blade.path]]
time = 0
position = [-0.05, 0, 0.08]
[[blade.path]]
time = 1
position = [-0.05, 0, 0.07]
)";

// Eight spacings long, two high, in some hundred poses; the blade turns into its way as a hand turns it.
struct Stroke {
  std::mt19937 random;
  double waves, phase, depth, wobble;
  unsigned most_poses; // to an increment

  Stroke(unsigned seed, double most_wobble) : random(seed) {
    waves = between(1, 3.5);
    phase = between(0, 2 * std::numbers::pi);
    depth = between(0.004, 0.012);
    most_poses = 1 + random() % 30;
    wobble = between(0, 1) * most_wobble;
  }
  double between(double low, double high) {
    return low + (high - low) * (static_cast<double>(random()) / std::mt19937::max());
  }
  [[nodiscard]] Vector3 at(double t) const {
    const double turn = 2 * std::numbers::pi * waves;
    return {-0.03 + 8 * spacing * t, 2 * spacing * (std::sin(turn * t + phase) - std::sin(phase)), 0.06 - depth};
  }
  // Where material was at rest, as the body is in this increment.
  topology::RestMap body() {
    const auto vector = [&] { return Vector3(between(-1, 1), between(-1, 1), between(-1, 1)); };
    const Vector3 all = wobble * vector(), some = wobble * vector();
    const double wave = between(50, 400);
    return [=](const Vector3& x) -> Vector3 { return x + all + some * std::sin(wave * (x.x() + x.y())); };
  }
};

/// Draws a stroke; `look` sees the cut after every increment.
template <class Look>
void draw(Stroke stroke, IncisionBuilder& cut, const Look& look) {
  constexpr int poses = 250;
  double heading = 0, time = 0;
  unsigned left = 0;
  Vector3 last = stroke.at(0);
  for (int i = -10; i <= poses; ++i) {
    Vector3 x = stroke.at(std::max(0.0, static_cast<double>(i) / poses));
    x.z() += 0.002 * std::max(-i, 0);
    const Vector3 step = x - last;
    last = x;
    if (step.head<2>().norm() > 1e-6) {
      const double turn = std::remainder(std::atan2(step.y(), step.x()) - heading, 2 * std::numbers::pi);
      heading += std::abs(turn) < 1.9 ? turn * (1 - std::exp(-step.norm() / 0.01)) : 0;
    }
    const topology::BladePose pose{time += 0.01, x, Eigen::Quaterniond(Eigen::AngleAxisd(heading, Vector3::UnitZ()))};
    if (left > 0 && i < poses) {
      --left;
      cut.put_off(pose);
      continue;
    }
    left = static_cast<unsigned>(stroke.random()) % stroke.most_poses;
    if (cut.move_to(pose, stroke.body()).triangles > 0)
      look();
  }
}

} // namespace

TEST_CASE("A wavy stroke leaves no crumbs, however the body moves between its increments", "[cut]") {
  const auto domain = topology::make_box_domain({-0.08, -0.05, 0}, {0.08, 0.05, 0.06}, 0.008);
  const Scenario scenario = scenario_of(cut_block + scalpel);
  const auto [seed, wobble] =
      GENERATE(table<unsigned, double>({{56, 0}, {55, 2e-4}, {20, 6e-4}, {42, 6e-4}, {57, 6e-4}}));
  CAPTURE(seed, wobble);
  IncisionBuilder cut(scenario, domain, edge);
  draw(Stroke(seed, wobble), cut, [&] {
    const topology::Wound& wound = cut.wound();
    CHECK_FALSE(topology::manifold_defect(wound.surface).has_value());
    CHECK_NOTHROW(require_pieces(wound, {.fine = spacing, .coarse = spacing}));
    double volume = 0;
    for (const topology::WoundPiece& piece : wound.pieces)
      volume += piece.volume;
    CHECK(volume == Approx(topology::volume(domain->surface())).epsilon(1e-6));
  });
  CHECK(cut.wound().pieces.size() == 1);
  // There is something to leave out.
  CHECK(topology::cut_surface(domain->surface(), cut.incision()->sheets()).pieces.size() > 1);
}
