// The way of a blade through the steps.
#include "src/tissue/blade_track.hpp"
#include "tests/src/blade_text.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

constexpr double fine = 0.005;

StepSample at(double time, const Vector3& place) {
  return {time, std::nullopt, topology::BladePose{time, place, Eigen::Quaterniond::Identity()}};
}

} // namespace

TEST_CASE("A blade's way leads through the poses it has passed, and it rests a while after it last moved") {
  const Scenario scenario = scenario_of(cut_block + blade({"[0, 0, 0.04]", "[0, 0, 0.02]"}, 0.04, "0.5"));
  BladeTrack track(scenario);
  CHECK(track.rests());
  const StepSample first = at(0.5, {0, 0, 0.04}), second = at(1, {0.003, 0, 0.036});
  track.begin_step(first, {}, fine);
  CHECK_FALSE(track.last());
  CHECK_FALSE(track.rests());
  track.arrive(first);
  track.begin_step(second, {*at(0.7, {0.003, 0, 0.04}).blade}, fine);
  CHECK(track.way_to(*second.blade) == Approx(0.003 + 0.004));
  CHECK(track.moved_at(1));
  track.arrive(second);
  track.begin_step(at(1.05, second.blade->position), {}, fine);
  CHECK_FALSE(track.moved_at(1.05));
  CHECK_FALSE(track.rests());
  track.begin_step(at(1.2, second.blade->position), {}, fine);
  CHECK(track.rests());
  track.arrive({1.3, std::nullopt, std::nullopt}); // not on its way: it is where it was
  REQUIRE(track.last());
  CHECK(track.last()->position == second.blade->position);
}

TEST_CASE("A lifted blade is nowhere, but what it has put off is still to be cut up to where it was") {
  const Scenario scenario = scenario_of(cut_block + blade({"[0, 0, 0.04]", "[0, 0, 0.02]"}, 0.04, "0.5"));
  BladeTrack track(scenario);
  track.arrive(at(1, {0, 0, 0.03}));
  track.put_off(0.002);
  track.lift();
  CHECK(track.is_lifted());
  CHECK(track.is_hand_led());
  REQUIRE(track.take_last());
  CHECK_FALSE(track.last());
  track.put_down();
  track.body_follows();
  CHECK(track.put_off() == 0);
  track.arrive(at(2, {0, 0, 0.03}));
  track.lift();
  CHECK_FALSE(track.last());
  track.put_down();
  CHECK_FALSE(track.is_lifted());
  CHECK(track.is_hand_led()); // for good
}
