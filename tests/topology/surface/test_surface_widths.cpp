// Thickness of walls and width of gaps, measured by rays from the surface.
#include "experiments/support/slit_block.hpp"
#include "topology/organ/organs.hpp"
#include "topology/surface/widths.hpp"

#include <algorithm>
#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

/// A U: two legs of 8 mm that face each other across a slit, on a base.
SurfaceMesh legs(double slit) {
  experiments::SlitBlock block;
  block.leg = 0.008;
  block.slit = slit;
  block.depth = 0.02;
  block.height = 0.03;
  return block.surface();
}

double least_of(const std::vector<WidthSample>& samples) {
  double least = 1;
  for (const WidthSample& sample : samples)
    least = std::min(least, sample.is_parallel ? sample.width : 1);
  return least;
}

} // namespace

TEST_CASE("A plate is as thick as it is, a slit as wide", "[surface_widths]") {
  const SurfaceWidths plate = surface_widths(make_block(Vector3(0.1, 0.003, 0.08), 0.004), 0.004, 0.05);
  CHECK(least_of(plate.walls) == Approx(0.003));
  CHECK(plate.gaps.empty());
  double area = 0;
  for (const WidthSample& sample : plate.walls)
    area += sample.area;
  CHECK(area == Approx(2 * (0.1 * 0.08 + 0.003 * 0.18)).epsilon(0.05));
  for (const double slit : {1e-4, 1e-3, 6e-3}) {
    const SurfaceMesh mesh = legs(slit);
    REQUIRE(volume(mesh) == Approx(0.02 * ((0.016 + slit) * 0.03 - slit * 0.02)));
    const SurfaceWidths widths = surface_widths(mesh, 0.002, 0.02);
    CHECK(least_of(widths.gaps) == Approx(slit));
    CHECK(least_of(widths.walls) == Approx(0.008));
  }
}

TEST_CASE("A margin that tapers is no thin wall, a plate is", "[surface_widths]") {
  SurfaceMesh wedge = make_block(Vector3(0.1, 0.1, 0.04), 0.005);
  for (Vector3& v : wedge.vertices)
    v.z() *= (0.052 - v.x()) / 0.1; // from 40 mm down to 1 mm
  const SurfaceWidths tapered = surface_widths(wedge, 0.004, 0.05);
  CHECK(least_of(tapered.walls) < 0.002);
  CHECK(thin_samples(tapered.walls, 0.01).empty());
  const SurfaceWidths plate = surface_widths(make_block(Vector3(0.1, 0.1, 0.004), 0.005), 0.004, 0.05);
  CHECK(thin_samples(plate.walls, 0.01).size() > 0.7 * static_cast<double>(plate.walls.size()));
  CHECK(thin_samples(plate.walls, 0.0039).empty());
}
