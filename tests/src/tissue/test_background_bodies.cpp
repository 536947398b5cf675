// Bodies made in the background: one at a time, and each given up or taken.
#include "src/tissue/background_bodies.hpp"
#include "topology/base/errors.hpp"

#include <atomic>
#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;

namespace {

BackgroundBody with_nodes(int count) {
  BackgroundBody made;
  made.report.nodes = count;
  return made;
}

} // namespace

TEST_CASE("A body made in the background is taken once, with what it is for") {
  BackgroundBodies background;
  CHECK_FALSE(background.is_under_way());
  background.follow({std::nullopt, 0.5, 12}, [] { return with_nodes(7); });
  CHECK(background.follows_cut());
  CHECK(background.proposing() == nullptr);
  auto [following, made] = background.take_following();
  CHECK(following.time == 0.5);
  CHECK(following.triangles == 12);
  CHECK(made.get().report.nodes == 7);
  CHECK_FALSE(background.is_under_way());
  background.follow({topology::SurfaceContact{}}, [] { return with_nodes(1); });
  CHECK(background.is_following());
  CHECK_FALSE(background.follows_cut()); // it follows the tool
}

TEST_CASE("A proposed body arrives once it is waited for, and a failure is thrown to who takes it") {
  BackgroundBodies background;
  background.propose({3, 0.1, 0.002, 4}, []() -> BackgroundBody { throw NumericalError("no body"); });
  REQUIRE(background.proposing() != nullptr);
  CHECK(background.proposing()->poses == 3);
  CHECK_FALSE(background.has_arrived());
  background.let_arrive();
  CHECK(background.has_arrived());
  CHECK_FALSE(background.is_there()); // it has been let arrive
  auto [proposing, made] = background.take_proposing();
  CHECK(proposing.triangles == 4);
  CHECK_THROWS_AS(made.get(), NumericalError);
  CHECK_FALSE(background.is_under_way());
}

TEST_CASE("A body that was dropped is computed to its end before the next one begins") {
  BackgroundBodies background;
  std::atomic<bool> may_end = false, has_ended = false, overlapped = false;
  background.follow({}, [&] {
    may_end.wait(false);
    has_ended = true;
    return with_nodes(1);
  });
  background.drop_following();
  CHECK_FALSE(background.is_under_way());
  background.propose({}, [&] {
    overlapped = !has_ended;
    return with_nodes(2);
  });
  CHECK_FALSE(background.is_there());
  may_end = true;
  may_end.notify_all();
  auto [proposing, made] = background.take_proposing();
  CHECK(made.get().report.nodes == 2);
  CHECK_FALSE(overlapped);
}
