// Sheets in the narrow gaps of a body's own surface.
#include "topology/incision/gap_walls.hpp"
#include "topology/organ/organs.hpp"

#include "experiments/support/slit_block.hpp"

#include <catch2/catch.hpp>
#include <random>

using namespace spherecut;
using namespace spherecut::topology;
using spherecut::experiments::SlitBlock;

namespace {

std::shared_ptr<const Incision> walls_of(const std::shared_ptr<const Domain>& domain, double h) {
  return gap_walls(domain, [h](const Vector3&) { return h; });
}

} // namespace

TEST_CASE("The two sides of a slit do not see each other, at any width below two spacings", "[gap_walls]") {
  constexpr double h = 0.005;
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> share(0, 1);
  for (const double slit : {1e-4, 5e-4, 1e-3, 2e-3, 6e-3}) {
    SlitBlock block;
    block.slit = slit;
    const auto walls = walls_of(make_organ_domain(block.surface()), h);
    REQUIRE(walls);
    CHECK(walls->cut_sheets() == 0);
    CHECK(walls->sheets().size() == 1);
    CHECK(walls->area() == 0);
    // A front along the bottom, but where that is wider than 0.6 spacings: there the wall ends half the slit's width
    // above it.
    const bool is_blunt = slit > 0.6 * h;
    const double end = is_blunt ? 0.5 * slit : 0; // m above the bottom
    CHECK(walls->front_length() == (is_blunt ? Approx(0) : Approx(block.depth).epsilon(0.02)));
    for (int trial = 0; trial < 300; ++trial) {
      const auto place = [&](double from, double to) {
        return Vector3(from + share(random) * (to - from), share(random) * block.depth,
                       block.base + 1.02 * end +
                           (0.001 + 0.999 * share(random)) * (block.height - block.base - 1.02 * end));
      };
      const Vector3 left = place(0, block.leg), right = place(block.leg + slit, 2 * block.leg + slit);
      const Vector3 also_left = place(0, block.leg), below(share(random) * (2 * block.leg + slit), 0.01, 0.001);
      CHECK(walls->blocks(left, right));
      CHECK_FALSE(walls->blocks(left, also_left));
      CHECK_FALSE(walls->blocks(Vector3(left.x(), left.y(), 0.99 * block.base), below));
    }
    const double below_end = block.base + 0.9 * end;
    if (is_blunt)
      CHECK_FALSE(walls->blocks({block.leg, 0.01, below_end}, {block.leg + slit, 0.01, below_end}));
    for (const double z : {block.base + 1e-3 + end, 0.03, block.height}) // along the outer faces, too
      for (const double y : {0.0, block.depth})
        CHECK(walls->blocks({block.leg, y, z}, {block.leg + slit, y, z}));
  }
}

TEST_CASE("A body without narrow gaps has no walls", "[gap_walls]") {
  CHECK(walls_of(make_box_domain(Vector3::Zero(), {0.06, 0.04, 0.04}, 0.005), 0.005) == nullptr);
  CHECK(walls_of(make_hemisphere_domain(0.03, 0.004), 0.004) == nullptr);
  CHECK(walls_of(make_organ_domain(SlitBlock::extruded(
                     {{0, 0, 0}, {0.05, 0, 0}, {0.05, 0, 0.02}, {0.02, 0, 0.02}, {0.02, 0, 0.05}, {0, 0, 0.05}},
                     {{0, 1, 2}, {0, 2, 3}, {0, 3, 4}, {0, 4, 5}}, 0.03)),
                 0.006) == nullptr); // an L
  SlitBlock wide;
  wide.slit = 0.011;
  CHECK(walls_of(make_organ_domain(wide.surface()), 0.005) == nullptr);
}

TEST_CASE("The liver has no narrow gaps at the spacings that it is used with", "[gap_walls]") {
  const auto liver = make_organ_domain(make_liver(20000));
  for (const double h : {0.004, 0.008, 0.016})
    CHECK(walls_of(liver, h) == nullptr);
}

TEST_CASE("A cut beside a gap keeps its numbers, area and front", "[gap_walls]") {
  const SlitBlock block;
  const auto domain = make_organ_domain(block.surface());
  const auto walls = walls_of(domain, 0.005);
  SurfaceMesh sheet;
  sheet.vertices = {{-0.01, -0.01, 0.03}, {0.01, -0.01, 0.03}, {0.01, 0.05, 0.03}, {-0.01, 0.05, 0.03}};
  sheet.triangles = {{0, 1, 2}, {0, 2, 3}};
  const auto cut = std::make_shared<const Incision>(std::vector{sheet}, domain, 7);
  const auto both = with_walls(cut, walls);
  CHECK(both->cut_sheets() == 1);
  CHECK(both->sheets().size() == 2);
  CHECK(both->revision() == 7);
  CHECK(both->area() == Approx(cut->area()).epsilon(1e-12));
  CHECK(both->front_length() == Approx(cut->front_length() + walls->front_length()).epsilon(1e-9));
  CHECK(both->blocks({0.005, 0.01, 0.02}, {0.005, 0.01, 0.04}));
  CHECK(both->blocks({0.015, 0.01, 0.04}, {0.025, 0.01, 0.04}));
  CHECK(with_walls(cut, nullptr) == cut);
  CHECK(with_walls(nullptr, walls) == walls);
  CHECK(with_walls(nullptr, nullptr) == nullptr);
}
