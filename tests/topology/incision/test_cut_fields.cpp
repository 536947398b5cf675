#include "topology/incision/cut_fields.hpp"

#include "topology/base/errors.hpp"
#include "topology/blade/blade.hpp"
#include "topology/incision/cut_sheets.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

std::shared_ptr<const Domain> voxel_block() {
  return make_box_domain(Vector3(0, 0, 0), Vector3(0.1, 0.1, 0.05), 0.02);
}

std::vector<CutVoxel> from_scratch(const std::shared_ptr<const Incision>& incision, double voxel) {
  CutFields fields(voxel);
  fields.update(incision);
  return fields.voxels();
}

/// Number of voxels that differ.
std::size_t differing(const std::vector<CutVoxel>& a, const std::vector<CutVoxel>& b) {
  if (a.size() != b.size())
    return std::max(a.size(), b.size());
  return static_cast<std::size_t>(std::count_if(
      a.begin(), a.end(), [&, i = std::size_t{0}](const CutVoxel& voxel) mutable { return !(voxel == b[i++]); }));
}

} // namespace

TEST_CASE("The cut's fields hold the distance to the sheet and the place relative to its front", "[cut_fields]") {
  const Vector3 centre(0.048, 0.052, 0.026), normal = Vector3(0.2, 0.3, 1).normalized();
  const double radius = 0.02, voxel = 0.001;
  const auto incision =
      std::make_shared<const Incision>(std::vector{make_disc_sheet(centre, normal, radius, 0.002)}, voxel_block());
  CutFields fields(voxel);
  fields.update(incision);
  const auto voxels = fields.voxels();
  std::size_t behind = 0, ahead = 0;
  for (const CutVoxel& v : voxels) {
    const Vector3 x = voxel * Vector3(v.index[0], v.index[1], v.index[2]);
    const double height = (x - centre).dot(normal);
    const double rho = ((x - centre) - height * normal).norm();
    // Exact for the disc, up to the sagitta of the polygon, 0.027 mm.
    CHECK(v.distance == Approx(std::hypot(height, std::max(0.0, rho - radius))).margin(3e-5));
    CHECK(v.distance < fields.band());
    if (std::hypot(height, rho - radius) < fields.band() - 3e-5)
      CHECK(v.ahead == Approx(rho - radius).margin(3e-5));
    else if (std::hypot(height, rho - radius) > fields.band() + 3e-5)
      CHECK(v.ahead == -static_cast<float>(fields.band()));
    (rho > radius ? ahead : behind) += 1;
  }
  // As many voxels as fill the band.
  const double volume = 6 * voxel * M_PI * radius * radius + 2 * M_PI * radius * M_PI / 2 * 9 * voxel * voxel;
  CHECK(static_cast<double>(voxels.size()) * std::pow(voxel, 3) == Approx(volume).epsilon(0.05));
  CHECK(ahead > 1000);
  CHECK(behind > 5000);
  CHECK(fields.distance(centre + 0.0011 * normal) == Approx(0.0011).margin(1e-6));
  CHECK(fields.distance(centre + 0.02 * normal) == fields.band());
  CHECK(fields.ahead(centre) == Approx(-fields.band()));
  CHECK(fields.memory_bytes() > voxels.size() * 2 * sizeof(float));
}

TEST_CASE("Fields updated increment by increment are those built from scratch, bit for bit", "[cut_fields]") {
  SweepOptions options;
  options.edge = 0.002;
  BladeSweep sweep({{Vector3(0, 0, 0.06), Vector3(0, 0, 0.03), Vector3(0.004, 0, 0)}, 1e-4}, voxel_block(), options);
  CutFields fields(0.001);
  BladePose pose;
  int compared = 0;
  for (int k = 0; k < 50; ++k) {
    pose.time = k;
    if (k < 25) // a bend, from outside
      pose.position = Vector3(-0.004 + 0.002 * k, 0.03 + 0.006 * std::sin(0.1 * k), 0.02);
    else if (k < 28) // a sharp turn
      pose.position += Vector3(0, 0.003, 0);
    else if (k == 28) // out
      pose.position += Vector3(0, 0, 0.07);
    else if (k < 32) // in, elsewhere
      pose.position = Vector3(0.02, 0.02, 0.02 + 0.02 * (31 - k));
    else // across the first part
      pose.position += Vector3(0.0005, 0.002, 0);
    if (sweep.move_to(pose).triangles == 0)
      continue;
    fields.update(sweep.incision());
    if (k % 3 == 0 || k > 44) {
      REQUIRE(differing(fields.voxels(), from_scratch(sweep.incision(), 0.001)) == 0);
      ++compared;
    }
  }
  CHECK(sweep.sheets().size() >= 3);
  CHECK(compared > 12);
  // Another cut altogether.
  const auto other = std::make_shared<const Incision>(
      std::vector{make_disc_sheet(Vector3(0.05, 0.05, 0.02), Vector3(1, 1, 0), 0.01, 0.002)}, voxel_block());
  fields.update(other);
  CHECK(differing(fields.voxels(), from_scratch(other, 0.001)) == 0);
}

TEST_CASE("Sheets that start, turn and cross anywhere leave the same fields however they came", "[cut_fields]") {
  std::mt19937_64 random(5);
  const auto uniform = [&](double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); };
  SweepOptions options;
  options.edge = 0.005;
  int sheets = 0;
  for (int trial = 0; trial < 25; ++trial) {
    BladeSweep sweep({{Vector3(0, 0, 0.02), Vector3(0, 0.004, 0), Vector3(0.01, 0, -0.02)}, 1e-4}, voxel_block(),
                     options);
    CutFields fields(0.002);
    BladePose pose;
    for (int k = 0; k < 14; ++k) {
      pose.time = k;
      // Every third blade moves by whole voxels along the axes, where distances and ties are exact.
      const auto step = [&] { return trial % 3 == 0 ? 0.002 * std::round(uniform(-6, 6)) : uniform(-0.015, 0.015); };
      pose.position =
          k % 5 == 0 ? Vector3(0.05, 0.05, 0.024) : Vector3(pose.position + Vector3(step(), step(), step()));
      if (trial % 3 != 0 && k % 4 == 3)
        pose.orientation =
            Eigen::AngleAxisd(uniform(-1, 1), Vector3(step(), step(), 0.01).normalized()) * pose.orientation;
      if (sweep.move_to(pose).triangles > 0)
        fields.update(sweep.incision());
    }
    sheets += static_cast<int>(sweep.sheets().size());
    REQUIRE(differing(fields.voxels(), from_scratch(sweep.incision(), 0.002)) == 0);
  }
  CHECK(sheets > 100);
}

TEST_CASE("Cut fields refuse voxels that make no sense", "[cut_fields]") {
  CHECK_THROWS_WITH(CutFields(0), Catch::Contains("voxel size = 0"));
  CHECK_THROWS_WITH(CutFields(NAN), Catch::Contains("voxel size"));
  CHECK_THROWS_WITH(CutFields(0.001, 0.5), Catch::Contains("band = 0.5"));
  CutFields fields(1e-7);
  CHECK_THROWS_AS(fields.update(nullptr), InputError);
  const auto incision = std::make_shared<const Incision>(
      std::vector{make_disc_sheet(Vector3(0.05, 0.05, 0.02), Vector3(1, 1, 0), 0.01, 0.002)}, voxel_block());
  CHECK_THROWS_WITH(fields.update(incision), Catch::Contains("GB"));
  CHECK(fields.voxels().empty());
}
