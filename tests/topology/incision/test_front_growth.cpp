#include "topology/incision/front_growth.hpp"

#include "topology/base/errors.hpp"
#include "topology/incision/cut_sheets.hpp"
#include "topology/incision/sheet_front.hpp"
#include "topology/organ/organs.hpp"
#include "topology/wound/wound.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numbers>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

const Vector3 lower(-0.05, -0.04, -0.03), upper(0.05, 0.04, 0.03);
const Vector3 normal = Vector3(0.1, 0.15, 1).normalized();

std::shared_ptr<const Domain> growth_block() {
  return make_box_domain(lower, upper, 0.01);
}

bool continues(const SurfaceMesh& before, const SurfaceMesh& after) {
  return std::equal(before.vertices.begin(), before.vertices.end(), after.vertices.begin()) &&
         std::equal(before.triangles.begin(), before.triangles.end(), after.triangles.begin());
}

} // namespace

TEST_CASE("A straight front through a block moves as told and stays a sheet", "[front_growth]") {
  const auto domain = growth_block();
  // From the side x < 0 to the front at about x = 0.
  const Vector3 along = Vector3(1, 0.1, -0.1).normalized();
  const SurfaceMesh sheet = make_rectangle_sheet(Vector3(-0.04, 0.001, 0.002), normal, along, 0.12, 0.08, 0.004);
  auto incision = std::make_shared<Incision>(std::vector<SurfaceMesh>{sheet}, domain);
  const double area = incision->area(), length = incision->front_length();
  const double step = 0.01;
  for (const double angle : {0.0, 0.6}) {
    INFO("kink of " << angle);
    const FrontGrowth growth = grow_front(
        *incision,
        [&](const FrontFrame& f) -> Vector3 { return step * (std::cos(angle) * f.ahead + std::sin(angle) * f.normal); },
        0.004);
    REQUIRE(growth.sheets.size() == 1);
    CHECK(growth.triangles > 0);
    CHECK(continues(sheet, growth.sheets[0]));
    CHECK_NOTHROW(check_sheet(growth.sheets[0], "grown"));
    const Incision grown(growth.sheets, domain);
    CHECK(grown.area() - area == Approx(step * length).epsilon(0.03));
    CHECK(grown.front_length() == Approx(length).epsilon(0.03));
    // The surface around it is one closed wound of the organ's volume.
    const SurfaceMesh organ = domain->surface();
    const Wound wound = cut_surface(organ, growth.sheets);
    CHECK_FALSE(manifold_defect(wound.surface));
    CHECK(volume(wound.surface) == Approx(volume(organ)).epsilon(1e-12));
    CHECK(wound.pieces.size() == 1);
  }
}

TEST_CASE("A front that turns inwards goes on reaching through the surface", "[front_growth]") {
  // Its ends would sink into the body after two steps, and a ligament along the sides would stay.
  const auto domain = growth_block();
  const Vector3 up = (normal - normal.x() * Vector3::UnitX()).normalized(), sideways = up.cross(Vector3::UnitX());
  std::vector<SurfaceMesh> sheets{
      make_rectangle_sheet(Vector3(-0.04, 0.001, 0.002), up, Vector3::UnitX(), 0.084, 0.08, 0.004)};
  constexpr double step = 0.004;
  constexpr int steps = 8;
  for (int k = 0; k < steps; ++k) {
    const Incision incision(sheets, domain);
    sheets = grow_front(
                 incision,
                 [&](const FrontFrame& f) -> Vector3 {
                   const double inwards = f.point.dot(sideways) > 0 ? -0.4 : 0.4;
                   return step * (Vector3::UnitX() + inwards * sideways);
                 },
                 0.004)
                 .sheets;
    CHECK_NOTHROW(check_sheet(sheets[0], "grown"));
  }
  const Incision grown(sheets, domain);
  double left = 0, right = 0;
  for (const FrontSegment& segment : grown.front())
    for (const Vector3& x : {segment.from, segment.to}) {
      left = std::min(left, x.y());
      right = std::max(right, x.y());
      CHECK(x.x() == Approx(steps * step).epsilon(0.01)); // no part of it has stayed behind
    }
  CHECK(left == Approx(lower.y()).epsilon(1e-3));
  CHECK(right == Approx(upper.y()).epsilon(1e-3));
  CHECK_FALSE(manifold_defect(cut_surface(domain->surface(), sheets).surface));
}

TEST_CASE("A buried disc grows to a larger disc", "[front_growth]") {
  const auto domain = growth_block();
  const double radius = 0.01, step = 0.006;
  const Vector3 centre(0.002, -0.001, 0.003);
  const Incision incision({make_disc_sheet(centre, normal, radius, 0.002)}, domain);
  const FrontGrowth growth = grow_front(
      incision, [&](const FrontFrame& f) -> Vector3 { return step * f.ahead; }, 0.002);
  CHECK_NOTHROW(check_sheet(growth.sheets[0], "grown"));
  const Incision grown(growth.sheets, domain);
  const double wanted = std::numbers::pi * (radius + step) * (radius + step);
  CHECK(grown.area() == Approx(wanted).epsilon(0.01));
  CHECK(grown.area() - incision.area() == Approx(growth.area));
  for (const FrontSegment& segment : grown.front()) {
    CHECK((segment.from - centre).norm() == Approx(radius + step).epsilon(0.01));
    CHECK((segment.to - segment.from).norm() < 1.6 * 0.002);
    CHECK(std::abs((segment.from - centre).dot(normal)) < 1e-12);
  }
}

TEST_CASE("Part of a front moves, the rest stays", "[front_growth]") {
  const auto domain = growth_block();
  const Vector3 centre(0.002, -0.001, 0.003);
  const Incision incision({make_disc_sheet(centre, normal, 0.01, 0.002)}, domain);
  const FrontGrowth growth = grow_front(
      incision, [&](const FrontFrame& f) -> Vector3 { return f.ahead.x() > 0.5 ? 0.003 * f.ahead : Vector3(0, 0, 0); },
      0.002);
  CHECK_NOTHROW(check_sheet(growth.sheets[0], "grown"));
  const Incision grown(growth.sheets, domain);
  CHECK(grown.area() > 1.1 * incision.area());
  CHECK_FALSE(manifold_defect(cut_surface(domain->surface(), growth.sheets).surface));
  double nearest = 1, farthest = 0;
  for (const FrontSegment& segment : grown.front()) {
    nearest = std::min(nearest, (segment.from - centre).norm());
    farthest = std::max(farthest, (segment.from - centre).norm());
  }
  CHECK(nearest == Approx(0.01).epsilon(0.02));
  CHECK(farthest == Approx(0.013).epsilon(0.02));
  // Nothing moves at all: nothing is added.
  CHECK(grow_front(
            incision, [](const FrontFrame&) -> Vector3 { return Vector3::Zero(); }, 0.002)
            .triangles == 0);
}

TEST_CASE("A front that is told nonsense is refused", "[front_growth]") {
  const Incision incision({make_disc_sheet(Vector3(0, 0, 0), normal, 0.01, 0.002)}, growth_block());
  const auto nowhere = [](const FrontFrame&) -> Vector3 {
    return Vector3::Constant(std::numeric_limits<double>::quiet_NaN());
  };
  CHECK_THROWS_AS(grow_front(incision, nowhere, 0.002), InputError);
  CHECK_THROWS_AS(grow_front(
                      incision, [](const FrontFrame& f) -> Vector3 { return f.ahead; }, 0),
                  InputError);
}
