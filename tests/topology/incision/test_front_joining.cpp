#include "topology/incision/front_joining.hpp"

#include "topology/base/errors.hpp"
#include "topology/incision/cut_sheets.hpp"
#include "topology/incision/sheet_front.hpp"
#include "topology/organ/organs.hpp"
#include "topology/wound/wound.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::topology;

namespace {

std::shared_ptr<const Domain> joining_block() {
  return make_box_domain({-0.05, -0.04, -0.03}, {0.05, 0.04, 0.03}, 0.01);
}

/// Two cuts from opposite sides of the block, in planes `apart` m from each other, up to `gap` m from each other.
std::vector<SurfaceMesh> half_cuts(double gap, double apart, bool same_way_round = true) {
  const Vector3 normal = Vector3::UnitZ();
  const double reach = 0.06; // beyond both sides of the block
  return {make_rectangle_sheet(Vector3(-0.5 * (reach + gap), 0, 0), normal, Vector3::UnitX(), 0.1, reach, 0.004),
          make_rectangle_sheet(Vector3(0.5 * (reach + gap), 0, apart), same_way_round ? normal : Vector3(-normal),
                               Vector3::UnitX(), 0.1, reach, 0.0053)};
}

} // namespace

TEST_CASE("Two coplanar fronts that face each other join and part the body", "[front_growth]") {
  const auto domain = joining_block();
  const double gap = 0.004;
  for (const bool same_way_round : {true, false})
    for (const double apart : {0.0, 1e-9, 0.001}) {
      INFO("planes " << apart << " m apart, the same way round: " << same_way_round);
      const Incision incision(half_cuts(gap, apart, same_way_round), domain);
      REQUIRE(cut_surface(domain->surface(), incision.sheets()).pieces.size() == 1);
      const std::vector<FacingFronts> facing = facing_fronts(incision, 0.006);
      CHECK(facing.size() > 20);
      for (const FacingFronts& pair : facing)
        CHECK(pair.across.norm() == Approx(std::hypot(gap, apart)).epsilon(1e-3));
      const FrontGrowth growth = join_fronts(incision, 0.006);
      CHECK(growth.triangles > 20);
      REQUIRE(growth.sheets.size() == 2);
      for (const SurfaceMesh& sheet : growth.sheets)
        CHECK_NOTHROW(check_sheet(sheet, "joined"));
      const Incision joined(growth.sheets, domain);
      CHECK(joined.front_length() == 0);
      CHECK(joined.area() == Approx((0.1 - gap + std::hypot(gap, apart)) * 0.08).epsilon(1e-3));
      CHECK(joined.blocks({0.0003, 0.011, -0.01}, {0.0003, 0.011, 0.01}));
      const Wound wound = cut_surface(domain->surface(), growth.sheets);
      CHECK_FALSE(manifold_defect(wound.surface));
      CHECK(volume(wound.surface) == Approx(volume(domain->surface())).epsilon(1e-12));
      CHECK(wound.pieces.size() == 2);
    }
}

TEST_CASE("Fronts that are too far apart, turn their backs or have a sheet between them do not join",
          "[front_growth]") {
  const auto domain = joining_block();
  CHECK(join_fronts(Incision(half_cuts(0.004, 0), domain), 0.003).triangles == 0);
  // A disc: its own front runs away from itself.
  const Incision disc({make_disc_sheet(Vector3::Zero(), Vector3::UnitZ(), 0.003, 0.001)}, domain);
  CHECK(facing_fronts(disc, 0.02).empty());
  std::vector<SurfaceMesh> walled = half_cuts(0.004, 0);
  walled.push_back(make_rectangle_sheet(Vector3::Zero(), Vector3::UnitX(), Vector3::UnitZ(), 0.1, 0.01, 0.004));
  CHECK(facing_fronts(Incision(walled, domain), 0.006).empty());
  CHECK_THROWS_AS(join_fronts(disc, 0), InputError);
}

TEST_CASE("A front that faces another one in part joins there, and the end of the strip is front", "[front_growth]") {
  const auto domain = joining_block();
  std::vector<SurfaceMesh> sheets = half_cuts(0.004, 0);
  // Half as wide: from y = -0.04 beyond the middle.
  sheets[1] = make_rectangle_sheet(Vector3(0.032, -0.025, 0), Vector3::UnitZ(), Vector3::UnitX(), 0.05, 0.06, 0.0053);
  const Incision incision(sheets, domain);
  const FrontGrowth growth = join_fronts(incision, 0.006);
  CHECK(growth.triangles > 8);
  const Incision joined(growth.sheets, domain);
  CHECK(joined.front_length() < incision.front_length() - 0.06);
  const Wound wound = cut_surface(domain->surface(), growth.sheets);
  CHECK_FALSE(manifold_defect(wound.surface));
  CHECK(wound.pieces.size() == 1);
}
