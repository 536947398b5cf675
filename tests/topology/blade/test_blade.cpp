#include "topology/blade/abutting_strip.hpp"
#include "topology/blade/blade.hpp"

#include "topology/base/errors.hpp"
#include "topology/incision/cut_sheets.hpp"
#include "topology/incision/sheet_front.hpp"
#include "topology/organ/organs.hpp"
#include "topology/wound/wound.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

constexpr double edge = 0.005;

/// Block 0.1 x 0.1 x 0.05 m, top at z = 0.05.
std::shared_ptr<const Domain> block() {
  return make_box_domain(Vector3(0, 0, 0), Vector3(0.1, 0.1, 0.05), 0.02);
}

/// Straight edge 0.06 m long that hangs down from the pose along -z.
Blade scalpel() {
  return {{Vector3(0, 0, 0.06), Vector3(0, 0, 0)}, 1e-4};
}

SweepOptions options() {
  SweepOptions result;
  result.edge = edge;
  return result;
}

BladePose at(double time, double x, double y, double z) {
  BladePose pose;
  pose.time = time;
  pose.position = Vector3(x, y, z);
  return pose;
}

double total_area(const std::vector<SurfaceMesh>& sheets) {
  double sum = 0;
  for (const SurfaceMesh& sheet : sheets)
    sum += area(sheet);
  return sum;
}

void require_sheets(const BladeSweep& sweep) {
  for (const SurfaceMesh& sheet : sweep.sheets())
    REQUIRE_NOTHROW(check_sheet(sheet, "swept sheet"));
  REQUIRE_NOTHROW(sweep.incision());
}

} // namespace

TEST_CASE("A straight slice has the area and the front it should", "[blade]") {
  BladeSweep sweep(scalpel(), block(), options());
  CHECK(sweep.move_to(at(0, -0.003, 0.04, 0.02)).refused == "the blade was only placed");
  const SweepResult result = sweep.move_to(at(1, 0.06, 0.04, 0.02));
  CHECK(result.refused.empty());
  CHECK(result.area == Approx(0.06 * 0.03).epsilon(1e-4));
  REQUIRE(sweep.sheets().size() == 1);
  CHECK(result.triangles == static_cast<int>(sweep.sheets()[0].triangles.size()));
  REQUIRE(result.added.size() == 1);
  CHECK(result.added[0].count == result.triangles);
  CHECK(sweep.revision() == 1);
  require_sheets(sweep);
  const auto incision = sweep.incision();
  CHECK(incision->revision() == 1);
  CHECK(incision->area() == Approx(0.06 * 0.03).epsilon(1e-4));
  CHECK(incision->front_length() == Approx(0.06 + 0.03).epsilon(1e-4));
  CHECK(incision->blocks(Vector3(0.03, 0.039, 0.03), Vector3(0.03, 0.041, 0.03)));
  CHECK_FALSE(incision->blocks(Vector3(0.061, 0.039, 0.03), Vector3(0.061, 0.041, 0.03)));
  // + side: edge direction x motion = -z cross x = -y.
  CHECK(incision->closest(Vector3(0.03, 0.03, 0.03), 1)->normal.isApprox(-Vector3::UnitY(), 1e-9));
  // Trimmed above the surface, with an overhang.
  double top = 0;
  const SurfaceMesh swept = sweep.sheets()[0];
  for (const Vector3& x : swept.vertices)
    top = std::max(top, x.z());
  CHECK(top > 0.05 + 0.5 * edge);
  CHECK(top < 0.05 + 2.1 * edge);
}

TEST_CASE("Twenty increments cut the same sheet as one motion", "[blade]") {
  BladeSweep once(scalpel(), block(), options()), stepwise(scalpel(), block(), options());
  once.move_to(at(0, -0.01, 0.04, 0.02));
  stepwise.move_to(at(0, -0.01, 0.04, 0.02));
  const double whole = once.move_to(at(1, 0.09, 0.045, 0.02)).area;
  double sum = 0;
  std::vector<SurfaceMesh> before;
  for (int k = 1; k <= 20; ++k) {
    const SweepResult result = stepwise.move_to(at(k, -0.01 + 0.1 * k / 20, 0.04 + 0.005 * k / 20, 0.02));
    sum += result.area;
    const auto sheets = stepwise.sheets();
    if (sheets.empty())
      continue; // still outside
    REQUIRE(sheets.size() == 1);
    if (!before.empty()) { // append-only
      for (std::size_t v = 0; v < before[0].vertices.size(); ++v)
        REQUIRE(sheets[0].vertices[v] == before[0].vertices[v]);
      for (std::size_t t = 0; t < before[0].triangles.size(); ++t)
        REQUIRE(sheets[0].triangles[t] == before[0].triangles[t]);
      CHECK(result.added[0].first == static_cast<int>(before[0].triangles.size()));
    }
    before = sheets;
  }
  CHECK(sum == Approx(whole).epsilon(1e-4));
  CHECK(stepwise.incision()->front_length() == Approx(once.incision()->front_length()).epsilon(1e-9));
  // The direct motion has 21 rows (0.1001 m), the increments 20: another triangulation of the same plane.
  for (const Vector3& x : before[0].vertices)
    if (block()->signed_distance(x) < 0)
      CHECK(once.incision()->closest(x, 0.1)->distance < 1e-12);
  // With rows at the same places the triangles are the same.
  BladeSweep aligned(scalpel(), block(), options()), halves(scalpel(), block(), options());
  aligned.move_to(at(0, 0.01, 0.04, 0.02));
  halves.move_to(at(0, 0.01, 0.04, 0.02));
  aligned.move_to(at(1, 0.05, 0.04, 0.02));
  for (int k = 1; k <= 8; ++k)
    halves.move_to(at(k, 0.01 + 0.005 * k, 0.04, 0.02));
  CHECK(aligned.sheets()[0].triangles == halves.sheets()[0].triangles);
  for (std::size_t v = 0; v < aligned.sheets()[0].vertices.size(); ++v)
    CHECK(aligned.sheets()[0].vertices[v].isApprox(halves.sheets()[0].vertices[v], 1e-12));
}

TEST_CASE("A cut through the whole block has no front left", "[blade]") {
  BladeSweep sweep({{Vector3(0, 0, 0.06), Vector3(0, 0, -0.01)}, 1e-4}, block(), options());
  sweep.move_to(at(0, -0.012, 0.04, 0));
  for (int k = 1; k <= 30; ++k)
    sweep.move_to(at(k, -0.012 + 0.004 * k, 0.04 + 0.003 * std::sin(0.3 * k), 0));
  require_sheets(sweep);
  CHECK(sweep.sheets().size() == 1);
  CHECK(sweep.incision()->front().empty());
}

TEST_CASE("A gentle bend goes on in the sheet, a sharp turn starts a new one that abuts", "[blade]") {
  for (const double degrees : {30.0, 50.0, 75.0, 120.0}) {
    BladeSweep sweep(scalpel(), block(), options());
    sweep.move_to(at(0, 0.02, 0.04, 0.02));
    sweep.move_to(at(1, 0.05, 0.04, 0.02));
    const double angle = degrees * M_PI / 180;
    const SweepResult result = sweep.move_to(at(2, 0.05 + 0.03 * std::cos(angle), 0.04 + 0.03 * std::sin(angle), 0.02));
    CHECK(result.area == Approx(0.03 * 0.03).epsilon(1e-4));
    require_sheets(sweep);
    CHECK(sweep.sheets().size() == (degrees < 60 ? 1 : 2));
    // The two ends and the lower border: no front where the parts meet.
    CHECK(sweep.incision()->front_length() == Approx(2 * 0.03 + 0.06).epsilon(1e-5));
    CHECK(sweep.incision()->blocks(Vector3(0.05, 0.03, 0.03), Vector3(0.05, 0.05, 0.03)));
  }
}

TEST_CASE("Leaving the body and entering elsewhere starts a new sheet", "[blade]") {
  BladeSweep sweep(scalpel(), block(), options());
  sweep.move_to(at(0, -0.02, 0.03, 0.02));
  sweep.move_to(at(1, 0.02, 0.03, 0.02));
  CHECK(sweep.move_to(at(2, 0.02, 0.03, 0.2)).triangles == 0); // along itself
  CHECK(sweep.move_to(at(3, 0.05, 0.06, 0.2)).refused == "the blade moved outside the body");
  sweep.move_to(at(4, 0.05, 0.06, 0.02));
  const SweepResult again = sweep.move_to(at(5, 0.07, 0.06, 0.02));
  CHECK(again.area == Approx(0.02 * 0.03).epsilon(1e-4));
  require_sheets(sweep);
  CHECK(sweep.sheets().size() == 2);
  CHECK(sweep.incision()->front_length() == Approx(0.02 + 0.03 + 0.02 + 2 * 0.03).epsilon(1e-5));
}

TEST_CASE("No motion, motion along the edge and too small a motion add nothing and say so", "[blade]") {
  BladeSweep sweep(scalpel(), block(), options());
  sweep.move_to(at(0, 0.02, 0.03, 0.02));
  sweep.move_to(at(1, 0.04, 0.03, 0.02));
  const auto incision = sweep.incision();
  CHECK(sweep.move_to(at(2, 0.04, 0.03, 0.02)).refused == "the blade did not move");
  CHECK(sweep.move_to(at(3, 0.04, 0.03, 0.01)).refused == "the blade moved along its edge");
  CHECK(sweep.move_to(at(4, 0.04, 0.03, 0.02)).refused == "the blade moved along its edge");
  CHECK(sweep.revision() == 1);
  CHECK(sweep.incision() == incision);
  // Ten steps of a hundredth of an edge come together to one of a tenth.
  BladeSweep slow(scalpel(), block(), options());
  slow.move_to(at(0, 0.02, 0.03, 0.02));
  double sum = 0;
  for (int k = 1; k <= 10; ++k)
    sum += slow.move_to(at(k, 0.02 + k * 0.01 * edge, 0.03, 0.02)).area;
  CHECK(sum == Approx(0.1 * edge * 0.03).epsilon(1e-4));
  require_sheets(slow);
}

TEST_CASE("After sliding along itself the edge cuts on from where it is, without leaving tissue", "[blade]") {
  BladeSweep sweep(scalpel(), block(), options());
  sweep.move_to(at(0, 0.02, 0.03, 0.02));
  sweep.move_to(at(1, 0.04, 0.03, 0.02));
  sweep.move_to(at(2, 0.04, 0.03, 0.0125));
  const SweepResult result = sweep.move_to(at(3, 0.06, 0.03, 0.0125));
  CHECK(result.area == Approx(0.02 * 0.0375).epsilon(1e-4));
  require_sheets(sweep);
  // The step between the depths stays front, the joint above it does not.
  CHECK(sweep.incision()->front_length() == Approx(0.03 + 0.02 + 0.0075 + 0.02 + 0.0375).epsilon(1e-4));
  for (double z = 0.0201; z < 0.05; z += 0.0007)
    CHECK(sweep.incision()->blocks(Vector3(0.04, 0.02, z), Vector3(0.04, 0.04, z)));
}

TEST_CASE("Cutting again in place adds nothing, going on from there extends the cut", "[blade]") {
  BladeSweep sweep(scalpel(), block(), options());
  sweep.move_to(at(0, -0.01, 0.03, 0.02));
  sweep.move_to(at(1, 0.041, 0.03, 0.02));
  const double once = total_area(sweep.sheets());
  CHECK(sweep.move_to(at(2, -0.01, 0.03, 0.02)).triangles == 0);     // back through its own cut
  CHECK(sweep.move_to(at(3, 0.0333, 0.03003, 0.02)).triangles == 0); // in again, within a quarter of an edge
  CHECK(total_area(sweep.sheets()) == once);
  const SweepResult on = sweep.move_to(at(4, 0.063, 0.03003, 0.02));
  CHECK(on.area == Approx((0.063 - 0.041) * 0.03).epsilon(1e-3));
  require_sheets(sweep);
  CHECK(sweep.incision()->front_length() == Approx(0.063 + 0.03).epsilon(1e-3));
  // A deeper cut along the same line adds the strip below and what lies ahead.
  BladeSweep deeper(scalpel(), block(), options());
  deeper.move_to(at(0, -0.01, 0.03, 0.02));
  deeper.move_to(at(1, 0.11, 0.03, 0.02));
  deeper.move_to(at(2, 0.2, 0.03, 0.02));
  deeper.move_to(at(3, 0.2, 0.03, 0.005));
  const SweepResult below = deeper.move_to(at(4, -0.01, 0.03, 0.005));
  CHECK(below.area > 0.1 * 0.015 * 0.99);
  CHECK(below.area < 0.1 * (0.015 + 2 * edge));
  require_sheets(deeper);
}

TEST_CASE("A blade that comes back beside its own cut by a little cuts nothing, and abuts on it where it goes on") {
  // An edge askew to its way and to the old rows, in steps that end anywhere.
  const Blade askew{{Vector3(0, 0, 0), Vector3(0.02, 0, 0.06)}, 1e-4};
  for (const double lower : {0.0003, 0.0011, -0.0007}) {
    BladeSweep sweep(askew, block(), options());
    int time = 0;
    const auto go = [&](double to_x, double z, double step) {
      const double from_x = sweep.edge_at_rest().empty() ? to_x : sweep.edge_at_rest().front().x();
      const int parts = std::max(1, static_cast<int>(std::ceil(std::abs(to_x - from_x) / step)));
      double area = 0;
      for (int k = 1; k <= parts; ++k)
        area += sweep.move_to(at(++time, from_x + (to_x - from_x) * k / parts, 0.03, z)).area;
      return area;
    };
    sweep.move_to(at(0, -0.025, 0.03, 0.02));
    go(0.041, 0.02, 0.0013);
    const double front = sweep.incision()->front_length(), once = sweep.incision()->area();
    CHECK(go(0.0, 0.02 - lower, 0.0017) < 0.01 * once);
    CHECK(go(0.03, 0.02 - lower, 0.0017) < 0.01 * once);
    go(0.043, 0.02 - lower, 0.0019);
    go(0.0633, 0.02 - lower, 0.0019);
    require_sheets(sweep);
    INFO("lower by " << lower << ", sheets: " << sweep.sheets().size());
    CHECK(sweep.incision()->front_length() < front + 0.0633 - 0.041 + 4 * std::abs(lower) + 0.5 * edge);
    CHECK(sweep.incision()->area() == Approx(0.0633 * 0.03 + 1.5e-4).epsilon(0.04));
    for (double x = 0.03; x < 0.065; x += 0.0007)
      for (double z = 0.0215; z < 0.05; z += 0.0007)
        if (x < 0.0633 + (z - 0.02) / 3 - 0.001)
          REQUIRE(sweep.incision()->blocks(Vector3(x, 0.02, z), Vector3(x, 0.04, z)));
  }
}

TEST_CASE("A deeper cut beside its own abuts on it") {
  BladeSweep sweep(scalpel(), block(), options());
  sweep.move_to(at(0, -0.01, 0.03, 0.0213));
  sweep.move_to(at(1, 0.0607, 0.03, 0.0213));
  sweep.move_to(at(2, 0.0607, 0.03, 0.0171)); // along itself
  int time = 3;
  double area = 0;
  for (double x = 0.0589; x > 0.011; x -= 0.0019, ++time)
    area += sweep.move_to(at(time, x, 0.03, 0.0171)).area;
  require_sheets(sweep);
  const double way = 0.0607 - sweep.edge_at_rest().front().x();
  CHECK(area == Approx(way * 0.0042).epsilon(0.05));
  CHECK(sweep.incision()->front_length() == Approx(0.0607 + 0.05 - 0.0171 + 0.0042).margin(edge));
  for (double x = 0.0601; x > 0.0607 - way + 0.75 * edge; x -= 0.0007)
    for (double z = 0.0175; z < 0.05; z += 0.0007)
      REQUIRE(sweep.incision()->blocks(Vector3(x, 0.02, z), Vector3(x, 0.04, z)));
}

TEST_CASE("A blade cuts nothing where a sheet is already, and goes on from the border of that") {
  // Half of the block is cut across at z = 0.02; the edge comes in there along y, on the sheet or beside it by less
  // than an edge, and goes on by 0.03 m.
  for (const double beside : {0.0, 0.0004, -0.0011, 0.0026, -0.0043})
    for (const double start : {-0.0123, -0.0117, -0.0101}) {
      BladeSweep sweep({{Vector3(0, -0.06, 0), Vector3(0, 0.06, 0)}, 1e-4}, block(), options());
      sweep.add(make_rectangle_sheet(Vector3(0, 0.05, 0.02), Vector3::UnitZ(), Vector3::UnitX(), 0.2, 0.1, edge));
      const RestMap onto_sheet = [&](const Vector3& x) -> Vector3 { // a face that is drawn aside up to the front
        return x.x() < 0.05 ? Vector3(x.x(), x.y(), 0.02) : x;
      };
      double area = 0;
      for (int k = 0; k < 32; ++k) {
        const SweepResult swept = sweep.move_to(at(k, start + 0.003 * k, 0.05, 0.02 + beside), onto_sheet);
        if (start + 0.003 * k < 0.05 - edge)
          CHECK(swept.triangles == 0);
        area += swept.area;
      }
      INFO(beside << " m beside the sheet, from " << start);
      require_sheets(sweep);
      const double end = start + 0.003 * 31;
      CHECK(area == Approx((end - 0.05) * 0.1).margin(0.1 * (1.1 * std::abs(beside) + 1e-3 * edge)));
      CHECK(sweep.incision()->front_length() == Approx(0.1).epsilon(1e-3));
      for (double x = 0.001; x < end - 0.001; x += 0.0007)
        REQUIRE(sweep.incision()->blocks(Vector3(x, 0.0501, 0.01), Vector3(x, 0.0501, 0.03)));
    }
}

TEST_CASE("A path that crosses its own sheet goes on in a new sheet", "[blade]") {
  BladeSweep sweep(scalpel(), block(), options());
  sweep.move_to(at(0, 0.03, 0.03, 0.02));
  // A loop in steps that turn by less than the limit, then straight across the first part.
  sweep.move_to(at(1, 0.07, 0.03, 0.02));
  int time = 2;
  for (double angle = -90; angle <= 180; angle += 30, ++time)
    sweep.move_to(
        at(time, 0.07 + 0.015 * std::cos(angle * M_PI / 180), 0.045 + 0.015 * std::sin(angle * M_PI / 180), 0.02));
  CHECK(sweep.sheets().size() == 1);
  const SweepResult across = sweep.move_to(at(time, 0.055, 0.012, 0.02));
  CHECK(across.area == Approx((0.045 - 0.012) * 0.03).epsilon(1e-4));
  CHECK(sweep.sheets().size() == 2);
  require_sheets(sweep);
  CHECK(sweep.incision()->blocks(Vector3(0.054, 0.02, 0.03), Vector3(0.056, 0.02, 0.03)));
}

TEST_CASE("A blade that turns about its middle, its end or a distant axis sweeps sound sheets", "[blade]") {
  const auto turned = [&](double time, const Vector3& about, double angle) {
    BladePose pose;
    pose.time = time;
    pose.orientation = Eigen::AngleAxisd(angle, Vector3::UnitY());
    pose.position = about;
    return pose;
  };
  for (const double end : {-0.005, 0.0, 0.005, 0.015}) { // place of the axis along the edge
    BladeSweep sweep({{Vector3(end - 0.015, 0, 0), Vector3(end, 0, 0)}, 1e-4}, block(), options());
    double sum = 0;
    for (int k = 0; k <= 12; ++k)
      sum += sweep.move_to(turned(k, Vector3(0.05, 0.05, 0.025), 0.1 * k)).area;
    require_sheets(sweep);
    const double outer = std::max(std::abs(end), std::abs(end - 0.015)),
                 inner = std::min(std::abs(end), std::abs(end - 0.015));
    const bool inside = end > 0 && end < 0.015;
    const double expected = 0.5 * 1.2 * (inside ? outer * outer + inner * inner : outer * outer - inner * inner);
    CHECK(sum == Approx(expected).epsilon(0.02));
    CHECK(sweep.sheets().size() == (inside ? 2 : 1));
  }
  // All the way round about its end: a disc that meets itself.
  BladeSweep disc({{Vector3(0, 0, 0), Vector3(0.02, 0, 0)}, 1e-4}, block(), options());
  for (int k = 0; k <= 40; ++k)
    disc.move_to(turned(k, Vector3(0.05, 0.05, 0.025), 2 * M_PI * k / 32));
  require_sheets(disc);
  CHECK(total_area(disc.sheets()) == Approx(M_PI * 0.02 * 0.02).epsilon(0.05));
  CHECK(disc.incision()->blocks(Vector3(0.0599, 0.049, 0.025), Vector3(0.0599, 0.051, 0.025)));
}

TEST_CASE("A curved path has the area of the swept surface", "[blade]") {
  BladeSweep sweep(scalpel(), block(), options());
  const double radius = 0.03;
  for (int k = 0; k <= 30; ++k) {
    const double angle = M_PI * k / 30;
    sweep.move_to(at(k, 0.05 - radius * std::cos(angle), 0.05 + radius * std::sin(angle), 0.02));
  }
  require_sheets(sweep);
  CHECK(sweep.sheets().size() == 1);
  CHECK(sweep.incision()->area() == Approx(M_PI * radius * 0.03).epsilon(2e-3));
}

TEST_CASE("A cut made in deformed tissue lies where the material was", "[blade]") {
  // u(X): the block sheared and stretched; invertible with a gradient well above what a plain fixed point stands.
  const auto displacement = [](const Vector3& x) {
    return Vector3(0.6 * x.y() + 0.3 * x.x(), 0.002 * std::sin(40 * x.x()), 1.2 * x.z());
  };
  const RestMap to_rest = [&](const Vector3& x) { return rest_position(x, displacement, 1e-12).position; };
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-0.1, 0.1);
  for (int i = 0; i < 500; ++i) {
    const Vector3 x = Vector3::NullaryExpr([&] { return uniform(random); });
    const Vector3 rest = rest_position(x, displacement, 1e-12).position;
    CHECK((rest + displacement(rest) - x).norm() < 1e-12);
  }
  BladeSweep sweep(scalpel(), block(), options());
  const auto now = [&](double time, const Vector3& rest_tip) {
    BladePose pose;
    pose.time = time;
    pose.position = rest_tip + displacement(rest_tip);
    return pose;
  };
  sweep.move_to(now(0, Vector3(-0.01, 0.04, 0.02)), to_rest);
  sweep.move_to(now(1, Vector3(0.06, 0.04, 0.02)), to_rest);
  require_sheets(sweep);
  for (const SurfaceMesh& sheet : sweep.sheets())
    for (const Vector3& x : sheet.vertices) { // on the blade's path: deformed y of the straight line
      const Vector3 deformed = x + displacement(x);
      const Vector3 a = now(0, Vector3(-0.01, 0.04, 0.02)).position, b = now(1, Vector3(0.06, 0.04, 0.02)).position;
      const double s = (deformed.x() - a.x()) / (b.x() - a.x());
      CHECK(deformed.y() == Approx(a.y() + s * (b.y() - a.y())).margin(1e-9));
    }
  int evaluations = 0;
  CHECK_THROWS_AS(rest_position(
                      Vector3(1, 0, 0),
                      [&](const Vector3& x) {
                        ++evaluations;
                        return Vector3(-x);
                      },
                      1e-9),
                  NumericalError);
  CHECK(evaluations < 30); // none lowers the residual
}

TEST_CASE("Where the displacement jumps a place at rest is found to the coarse tolerance or not at all", "[blade]") {
  // Faces that have parted by 2 mm: nothing is now between them.
  const auto displacement = [](const Vector3& x) { return Vector3(x.x() < 0 ? -0.001 : 0.001, 0, 0); };
  const Vector3 between(0.0005, 0.002, 0.003), beyond(0.004, 0.002, 0.003);
  const RestPlace coarse = rest_position(between, displacement, 1e-6, 0.0015);
  CHECK_FALSE(coarse.exact);
  CHECK((coarse.position + displacement(coarse.position) - between).norm() <= 0.0015);
  CHECK_THROWS_AS(rest_position(between, displacement, 1e-6, 1e-5), NumericalError);
  const RestPlace exact = rest_position(beyond, displacement, 1e-6, 0.0015);
  CHECK(exact.exact);
  CHECK((exact.position - Vector3(0.003, 0.002, 0.003)).norm() < 1e-6);
}

TEST_CASE("Tissue that moves while the blade cuts does not tear the sheet", "[blade]") {
  BladeSweep sweep(scalpel(), block(), options());
  double drag = 0;
  const RestMap to_rest = [&](const Vector3& x) { return Vector3(x - Vector3(0, drag, 0)); };
  sweep.move_to(at(0, -0.01, 0.04, 0.02), to_rest);
  for (int k = 1; k <= 10; ++k) {
    drag = 0.0005 * k;
    sweep.move_to(at(k, -0.01 + 0.007 * k, 0.04, 0.02), to_rest);
  }
  require_sheets(sweep);
  REQUIRE(sweep.sheets().size() == 1);
  const double slant = std::hypot(0.007, 0.0005) / 0.007;
  CHECK(sweep.incision()->area() == Approx(0.06 * slant * 0.03).epsilon(1e-3));
}

TEST_CASE("Bad blades and poses are refused and change nothing", "[blade]") {
  const auto body = block();
  CHECK_THROWS_WITH(BladeSweep({{Vector3(0, 0, 0)}, 1e-4}, body), Catch::Contains("at least 2"));
  CHECK_THROWS_WITH(BladeSweep({{}, 1e-4}, body), Catch::Contains("0 points"));
  CHECK_THROWS_WITH(BladeSweep({{Vector3(0, 0, 0), Vector3(0, NAN, 0)}, 1e-4}, body), Catch::Contains("point 1"));
  CHECK_THROWS_WITH(BladeSweep({{Vector3(0, 0, 0), Vector3(0, 0, 0)}, 1e-4}, body), Catch::Contains("coincide"));
  CHECK_THROWS_WITH(BladeSweep({scalpel().edge, 0}, body), Catch::Contains("edge radius = 0"));
  CHECK_THROWS_AS(BladeSweep(scalpel(), nullptr), InputError);
  SweepOptions bad = options();
  bad.edge = 0;
  CHECK_THROWS_WITH(BladeSweep(scalpel(), body, bad), Catch::Contains("edge = 0"));

  SweepOptions few = options();
  few.most_triangles = 500;
  BladeSweep sweep(scalpel(), body, few);
  sweep.move_to(at(1, 0.02, 0.03, 0.02));
  sweep.move_to(at(2, 0.04, 0.03, 0.02));
  const auto before = sweep.sheets();
  BladePose pose = at(3, 0.05, 0.03, 0.02);
  pose.position.x() = NAN;
  CHECK_THROWS_WITH(sweep.move_to(pose), Catch::Contains("not finite"));
  pose = at(3, 0.05, 0.03, 0.02);
  pose.orientation.coeffs().setZero();
  CHECK_THROWS_WITH(sweep.move_to(pose), Catch::Contains("orientation is zero"));
  CHECK_THROWS_WITH(sweep.move_to(at(1.5, 0.05, 0.03, 0.02)), Catch::Contains("does not come after"));
  CHECK_THROWS_WITH(sweep.move_to(at(2, 0.05, 0.03, 0.02)), Catch::Contains("does not come after"));
  CHECK_THROWS_WITH(sweep.move_to(at(3, 90, 0.03, 0.02)), Catch::Contains("at most 500"));
  CHECK_THROWS_AS(sweep.move_to(at(3, 0.05, 0.03, 0.02), [](const Vector3&) { return Vector3(NAN, 0, 0); }),
                  NumericalError);
  CHECK(sweep.revision() == 1);
  CHECK(sweep.sheets()[0].vertices == before[0].vertices);
  CHECK(sweep.move_to(at(3, 0.05, 0.03, 0.02)).area == Approx(0.01 * 0.03)); // goes on as if nothing had been
}

TEST_CASE("Random blades on any organ leave sound sheets", "[blade]") {
  std::mt19937_64 random(3);
  const auto uniform = [&](double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); };
  const auto vector = [&] { return Vector3::NullaryExpr([&] { return uniform(-1, 1); }).eval(); };
  int cut = 0;
  for (const auto& body : {block(), make_hemisphere_domain(0.05, 0.01), make_cylinder_domain(0.04, 0.06, 0.01)})
    for (int trial = 0; trial < 60; ++trial) {
      Blade blade;
      Vector3 x = 0.03 * vector();
      const int points = 2 + static_cast<int>(random() % 4);
      for (int i = 0; i < points; ++i, x += 0.02 * vector())
        blade.edge.push_back(x);
      BladeSweep sweep(blade, body, options());
      BladePose pose;
      pose.position = body->bounds().centre() + 0.05 * vector();
      pose.orientation = Eigen::Quaterniond(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
      double swept = 0;
      for (int step = 0; step < 12; ++step) {
        pose.time = step;
        const SweepResult result = sweep.move_to(pose);
        REQUIRE(std::isfinite(result.area));
        REQUIRE(result.refused.empty() == (result.triangles > 0));
        swept += result.area;
        const Vector3 motion = 0.02 * vector();
        switch (random() % 5) {
        case 0: // back to the centre
          pose.position = body->bounds().centre();
          break;
        case 1: // along the first piece of the edge
          pose.position += pose.orientation.normalized() * (blade.edge[1] - blade.edge[0]);
          break;
        case 2: // turn about the origin of the blade
          pose.orientation = Eigen::AngleAxisd(uniform(-1, 1), vector().normalized()) * pose.orientation.normalized();
          break;
        default:
          pose.position += motion;
        }
      }
      require_sheets(sweep);
      if (swept > 0)
        ++cut;
      CHECK(sweep.incision()->area() == Approx(swept).epsilon(0.05).margin(1e-6));
    }
  CHECK(cut > 120);
}

TEST_CASE("A strip of an edge that moves nearly along itself does not fold", "[blade]") {
  // An edge that bends, moved by a fortieth of the distance of its points: the triangle over the bend is the best in
  // shape, but lies in what was cut before.
  const std::vector<StripPoint> lower = {{{-0.00950287, -0.00725336, 0.04992}},
                                         {{-0.00554771, -0.00741707, 0.0513984}},
                                         {{-0.00158358, -0.0075728, 0.0528147}},
                                         {{0.00173779, -0.00774894, 0.0554298}}};
  const std::vector<StripPoint> upper = {{{-0.00950287, -0.00725336, 0.04992}},
                                         {{-0.00561995, -0.00740237, 0.051344}},
                                         {{-0.00163972, -0.00754388, 0.0527223}},
                                         {{0.00171227, -0.00770477, 0.0553033}}};
  const std::optional<Strip> strip = strip_between(lower, upper, 0);
  REQUIRE(strip);
  CHECK(strip->triangles.size() == 5);
  std::vector<Vector3> normals;
  for (const std::array<Vector3, 3>& x : strip->corners)
    normals.push_back((x[1] - x[0]).cross(x[2] - x[0]).normalized());
  for (const Vector3& normal : normals)
    CHECK(normal.dot(normals.front()) > 0);
}

TEST_CASE("A cut out of the middle of an earlier one begins on it, however slowly the blade goes", "[blade]") {
  const double edge = 0.004, step = GENERATE(1e-4, 2e-4, 3.9e-4, 1e-3, 4e-3);
  const SurfaceMesh organ = make_block({-0.03, -0.03, 0}, {0.03, 0.03, 0.03}, 0.01);
  const auto block = make_box_domain({-0.03, -0.03, 0}, {0.03, 0.03, 0.03}, 0.02);
  BladeSweep sweep({{{0, 0, -0.005}, {0, 0, 0.035}}, 1e-4}, block, {.edge = edge});
  double time = 0;
  const auto go = [&](double x, double y) {
    BladePose pose;
    pose.time = time++;
    pose.position = {x, y, 0};
    sweep.move_to(pose);
  };
  for (int k = -20; k <= 20; ++k) // in two
    go(0, 0.002 * k);
  for (int k = 20; k >= 0; --k) // back to the middle
    go(0, 0.002 * k + 0.0003);
  for (int k = 1; k * step < 0.038; ++k) // one half in two
    go(k * step, 0.0003);
  go(0.038, 0.0003);
  const Wound wound = cut_surface(organ, sweep.sheets());
  CHECK(wound.pieces.size() == 3);
  CHECK(sweep.incision()->area() == Approx(0.06 * 0.03 + 0.03 * 0.03).epsilon(1e-3));
}
