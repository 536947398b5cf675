// A grasper opens and closes, and holds a patch.
#include "src/tissue/grasping.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/src/tissue/tissue_parts.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;

namespace {

const std::string grasped_block = replaced(small_scenario, ball_tool, R"([tool]
shape = "grasper"
radius = 0.008
step = 0.5
grasp = 0.5
release = 2
[[tool.path]]
time = 0
position = [0, 0, 0.03]
[[tool.path]]
time = 3
position = [0, 0, 0.032]
)");

StepSample tool_at(double time, const Vector3& place) {
  topology::ToolPose pose;
  pose.point = place;
  return {time, pose, std::nullopt};
}

} // namespace

TEST_CASE(
    "A grasper closes and opens at its times or by a hand, and a piece that came off is not taken again at once") {
  const TissueParts parts(grasped_block);
  Grasping grasping(parts.state.scenario, *parts.state.organ.domain);
  using enum Grasping::Change;
  const auto change_at = [&](double time, std::optional<bool> grip) {
    return grasping.change_at(tool_at(time, {0, 0, 0.03}), grip);
  };
  CHECK(change_at(0.2, {}) == none);
  CHECK(change_at(0.2, true) == closes);
  CHECK(change_at(0.5, {}) == closes);
  grasping.take({});
  CHECK(grasping.holds());
  CHECK(change_at(1, {}) == none);
  CHECK(change_at(1, false) == opens);
  CHECK(change_at(2, {}) == opens);
  grasping.take_back(grasping.lose()); // the tear that would have taken it off is refused
  CHECK(grasping.holds());
  static_cast<void>(grasping.lose());
  CHECK(change_at(1, {}) == none);
  CHECK(change_at(1, false) == none); // open: from now on it may take hold again
  CHECK(change_at(1, true) == closes);
}

TEST_CASE("The patch of a grasper is what lies between its jaws, and moves as it does") {
  TissueParts parts(grasped_block);
  const double fine = parts.state.zone.fine();
  parts.updater.build(parts.state.model);
  const StepSample first = tool_at(0.5, {0, 0, 0.03}), second = tool_at(1, {0.001, 0, 0.0315});
  Grasp grasp = parts.grasping.reach_for({0, 0, 0.0301}, *first.tool, parts.state.model, fine);
  CHECK((grasp.place - Vector3(0, 0, 0.03)).norm() < 1e-9);
  const std::vector<int> nodes = parts.grasping.nodes_between(grasp, parts.state.model, fine);
  REQUIRE_FALSE(nodes.empty());
  for (const int node : nodes)
    CHECK((parts.state.model.sprinkling.nodes.positions[node] - grasp.place).norm() <= 0.008);
  CHECK(grasp.nodes.size() >= nodes.size());
  parts.contact.condense(nodes, parts.state.model);
  for (const Vector3& x : parts.state.model.patch.rest) {
    grasp.rest.push_back(x);
    grasp.displacement.emplace_back(0, 0, 0.0001);
  }
  parts.grasping.take(grasp);
  for (const Vector3& moved : parts.grasping.displacements(*second.tool, parts.state.model))
    CHECK((moved - Vector3(0.001, 0, 0.0016)).norm() < 1e-12);
  parts.contact.solve(second, parts.state.model);
  CHECK(parts.state.model.state->tool.tool_force.z() < 0); // the tissue pulls it back
}
