// Bodies made beside the steps: one at a time, and each given up or taken.
#include "src/tissue/aside_bodies.hpp"
#include "topology/base/errors.hpp"

#include <atomic>
#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;

namespace {

MadeAside with_nodes(int count) {
  MadeAside made;
  made.report.nodes = count;
  return made;
}

} // namespace

TEST_CASE("A body made beside the steps is taken once, with what it is for") {
  AsideBodies aside;
  CHECK_FALSE(aside.is_under_way());
  aside.follow({std::nullopt, 0.5, 12}, [] { return with_nodes(7); });
  CHECK(aside.follows_cut());
  CHECK(aside.proposing() == nullptr);
  auto [following, made] = aside.take_following();
  CHECK(following.time == 0.5);
  CHECK(following.triangles == 12);
  CHECK(made.get().report.nodes == 7);
  CHECK_FALSE(aside.is_under_way());
  aside.follow({topology::SurfaceContact{}}, [] { return with_nodes(1); });
  CHECK(aside.is_following());
  CHECK_FALSE(aside.follows_cut()); // it follows the tool
}

TEST_CASE("A proposed body arrives once it is waited for, and a failure is thrown to who takes it") {
  AsideBodies aside;
  aside.propose({3, 0.1, 0.002, 4}, []() -> MadeAside { throw NumericalError("no body"); });
  REQUIRE(aside.proposing() != nullptr);
  CHECK(aside.proposing()->poses == 3);
  CHECK_FALSE(aside.has_arrived());
  aside.let_arrive();
  CHECK(aside.has_arrived());
  CHECK_FALSE(aside.is_there()); // it has been let arrive
  auto [proposing, made] = aside.take_proposing();
  CHECK(proposing.triangles == 4);
  CHECK_THROWS_AS(made.get(), NumericalError);
  CHECK_FALSE(aside.is_under_way());
}

TEST_CASE("A body that was dropped is computed to its end before the next one begins") {
  AsideBodies aside;
  std::atomic<bool> may_end = false, has_ended = false, overlapped = false;
  aside.follow({}, [&] {
    may_end.wait(false);
    has_ended = true;
    return with_nodes(1);
  });
  aside.drop_following();
  CHECK_FALSE(aside.is_under_way());
  aside.propose({}, [&] {
    overlapped = !has_ended;
    return with_nodes(2);
  });
  CHECK_FALSE(aside.is_there());
  may_end = true;
  may_end.notify_all();
  auto [proposing, made] = aside.take_proposing();
  CHECK(made.get().report.nodes == 2);
  CHECK_FALSE(overlapped);
}
