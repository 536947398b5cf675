// The edge of a blade and its way, without tissue that resists it.
#include "src/blade/course.hpp"
#include "src/scenario/schedule.hpp"
#include "tests/src/blade_text.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/src/tissue/tissue_parts.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

struct EdgeInBlock {
  TissueParts parts{replaced(cut_block, "poisson_ratio = 0.3", "poisson_ratio = 0.3\ntoughness = 12") +
                    blade({"[0.004, 0, 0.04]", "[0.004, 0, 0.02]"}, 0.04, "0.5")};
  BladeEdge edge{parts.state.scenario, parts.state.organ.domain, parts.state.zone.fine(),
                 [](const BodyModel&) { return [](const Vector3& x) { return x; }; }, parts.state.toughness};
};

topology::BladePose at(double time, double height) {
  return {time, {0.004, 0, height}, Eigen::Quaterniond::Identity()};
}

} // namespace

TEST_CASE("The front of a cut moves along a blade's way up to where so much of "
          "it is left") {
  const EdgeInBlock in;
  BladeCourse course;
  CHECK(course.left(in.edge) == 0);
  const std::vector<topology::BladePose> poses{at(0, 0.04), at(1, 0.036), at(2, 0.03)};
  course.lead_through({&poses.front(), 1});
  CHECK(course.at().position == poses.front().position);
  course.lead_through({&poses[1], 2});
  CHECK(course.left(in.edge) == Approx(0.01));
  CHECK(course.stops(in.edge) == std::vector<std::size_t>{1, 2});
  const auto cut = course.up_to(in.edge, 0, course.last(), 0.003);
  REQUIRE(cut.size() == 2);
  CHECK(cut.front().position == poses[1].position);
  CHECK((cut.back().position - Vector3(0.004, 0, 0.033)).norm() < 1e-12);
  course.move_front(cut.size());
  CHECK(course.left(in.edge) == Approx(0.003));
  CHECK(course.target().position == poses.back().position);
}

TEST_CASE("An edge meets the body where it is in it, with the toughness of "
          "what lies ahead") {
  EdgeInBlock in;
  in.parts.updater.build(in.parts.state.model);
  const BodyModel& body = in.parts.state.model;
  CHECK_FALSE(in.edge.inside(at(0, 0.031), body));
  CHECK(in.edge.inside(at(1, 0.029), body));
  CHECK_FALSE(in.edge.is_in_open_cut(at(1, 0.029), body)); // nothing is cut
  const BladePoses way{at(0, 0.034), at(1, 0.028)};
  const EdgeMeeting meeting = in.edge.meet(body, way, 0, {});
  REQUIRE_FALSE(meeting.pieces.empty());
  CHECK(meeting.area == 0);
  CHECK(in.edge.toughness(meeting) == Approx(12));
  CHECK(in.edge.needed(meeting, 3) == Approx((12 - 3) / in.edge.settings().sharpness));
  const VectorX motions = in.edge.motions(meeting, way.back()), advances = in.edge.advances(meeting, body, way.back());
  for (Eigen::Index c = 0; c < motions.size(); ++c) {
    CHECK(meeting.stands[static_cast<std::size_t>(c)] == EdgeStand::surface);
    CHECK(motions[c] == Approx(0.002).margin(1e-5)); // below the surface, which stays
    CHECK(advances[c] <= motions[c]);
  }
  CHECK(in.edge.pushes(meeting, body, way.back()));
  CHECK_FALSE(in.edge.pushes(meeting, body, at(2, 0.05)));
}
