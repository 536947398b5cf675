// Where nodes are fine as tool and cut go on.
#include "src/tissue/fine_zone_tracker.hpp"

#include "experiments/support/slit_block.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "topology/organ/organs.hpp"

#include <algorithm>
#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

topology::SurfaceContact on_top(double x, double y) {
  topology::SurfaceContact contact;
  contact.point = {x, y, 0.03};
  contact.normal = Vector3::UnitZ();
  contact.depth = 0.001;
  return contact;
}

} // namespace

TEST_CASE("The fine zone follows a contact that has left its middle, to the same places from wherever that comes") {
  const Scenario scenario = scenario_of(small_scenario);
  const Organ organ = make_organ(scenario.organ);
  FineZoneTracker tracker(scenario, organ.domain);
  CHECK_FALSE(tracker.facing());
  tracker.begin_at(on_top(0, 0));
  CHECK(*tracker.facing() == Vector3::UnitZ());
  const double pitch = scenario.contact.follow_fraction * tracker.spacing().radius;
  CHECK_FALSE(tracker.must_follow(on_top(0.9 * pitch, 0)));
  CHECK(tracker.must_follow(on_top(1.1 * pitch, 0)));
  topology::SurfaceContact above = on_top(1.1 * pitch, 0);
  above.depth = -0.001;
  CHECK_FALSE(tracker.must_follow(above));
  CHECK(tracker.is_left_by(on_top(1.1 * tracker.spacing().radius, 0)));
  const Vector3 next = tracker.next_centre(on_top(1.1 * pitch, 0.05 * pitch)).point;
  CHECK((next - Vector3(pitch, 0, 0.03)).norm() < 1e-9);
  tracker.move_to(on_top(5 * pitch, 0.3 * pitch)); // lattice places stay about the first centre
  CHECK((tracker.next_centre(on_top(1.2 * pitch, -0.2 * pitch)).point - next).norm() < 1e-9);
  CHECK(tracker.spacing()(on_top(5 * pitch, 0.3 * pitch).point) == Approx(tracker.fine()));
}

TEST_CASE("Spacings are coarsened in those of the scenario, not in the last ones") {
  const Scenario scenario = scenario_of(small_scenario);
  const Organ organ = make_organ(scenario.organ);
  FineZoneTracker tracker(scenario, organ.domain);
  const double fine = tracker.fine(), coarse = tracker.spacing().coarse;
  tracker.coarsen(2);
  tracker.coarsen(1.5);
  CHECK(tracker.coarseness() == 1.5);
  CHECK(tracker.fine() == Approx(1.5 * fine));
  CHECK(tracker.spacing().coarse == Approx(1.5 * coarse));
  CHECK_THROWS_AS(tracker.coarsen(0), InputError);
  CHECK(tracker.fine() == Approx(1.5 * fine));
}

TEST_CASE("A zone that is led ahead of a front lasts until the front has left it, and a refused lead is undone") {
  const Scenario scenario = scenario_of(cut_block + disc_precut);
  const Organ organ = make_organ(scenario.organ);
  FineZoneTracker tracker(scenario, organ.domain);
  const IncisionBuilder cut(scenario, organ.domain, sheet_edge(tracker.zone()));
  tracker.lay_out({}, cut.incision(), nullptr);
  const FineZoneTracker::Mark before = tracker.mark();
  CHECK(tracker.lead_ahead(*cut.incision()) == "the fine zone had nothing of the way ahead");
  CHECK(tracker.lead_ahead(*cut.incision()).empty());
  tracker.go_back(before);
  CHECK(tracker.mark().segments == before.segments);
  CHECK(tracker.lead_ahead(*cut.incision()) == "the fine zone had nothing of the way ahead");
}

TEST_CASE("Gaps up to two spacings are found, and collocation says that it is too stiff beside wide ones") {
  Scenario scenario = scenario_of(small_scenario);
  scenario.nodes.count = 0;
  scenario.nodes.coarse_spacing = scenario.nodes.fine_spacing = 0.005;
  for (const double slit : {0.001, 0.006, 0.009, 0.011}) {
    CAPTURE(slit);
    experiments::SlitBlock block;
    block.slit = slit;
    const auto domain = topology::make_organ_domain(block.surface());
    for (const solvers::Method method : {solvers::Method::galerkin, solvers::Method::collocation}) {
      scenario.method.method = method;
      FineZoneTracker tracker(scenario, domain);
      CHECK(tracker.find_gaps() == (slit < 0.01));
      SessionLog log([](const std::string&) {});
      tracker.judge_walls(log);
      const bool is_told = std::any_of(log.warnings().begin(), log.warnings().end(), [&](const std::string& text) {
        return text.find("a gap of " + std::string(slit < 0.007 ? "6" : "9") + " mm") == 0;
      });
      CHECK(is_told == (method == solvers::Method::collocation && slit > 0.0025 && slit < 0.01));
    }
  }
}
