#include "src/session/foresight.hpp"

#include "src/scenario/law_reader.hpp"
#include "src/tissue/grasping.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Of the largest eigenvalue of what is held in rigid motions: below it a motion is free, as of nodes on one line.
constexpr double free_motion = 1e-12;

/// Throws where the nodes that are held leave the body a rigid motion.
void require_still(const SessionState& state) {
  const std::vector<Vector3>& places = state.model.sprinkling.nodes.positions;
  const std::vector<solvers::Prescribed> held =
      fixed_nodes(state.scenario, *state.organ.domain, state.model.sprinkling.nodes);
  const BoundingBox box = state.organ.domain->bounds();
  const double size = box.extent().norm();
  Matrix6 all = Matrix6::Zero();
  for (const solvers::Prescribed& entry : held) {
    const Vector3 from_middle = (places[static_cast<std::size_t>(entry.node)] - box.centre()) / size;
    for (int axis = 0; axis < 3; ++axis) {
      if (!entry.components[static_cast<std::size_t>(axis)])
        continue;
      Vector6 row; // along the axis by unit shifts and turns
      row << Vector3::Unit(axis), from_middle.cross(Vector3::Unit(axis));
      all += row * row.transpose();
    }
  }
  const Eigen::SelfAdjointEigenSolver<Matrix6> motions(all);
  int free = 0;
  while (free < 6 && motions.eigenvalues()[free] <= free_motion * motions.eigenvalues()[5])
    ++free;
  if (free == 0)
    return;
  const int count = held_nodes(held);
  throw InputError(fmt::format("{}:{}: fixed: {} node{} held leave{} the organ {} of 6 rigid motions; allowed: none. "
                               "Regions that hold three places off one line do, or a part of its surface",
                               state.scenario.file.string(), state.scenario.fixed.front().line, count,
                               count == 1 ? "" : "s", count == 1 ? "s" : "", free));
}

/// Throws where the first touch, or the jaws of a grasper, are on held surface alone.
void require_reach(const SessionState& state) {
  const Scenario& scenario = state.scenario;
  const bool is_at_rest = !has_loads(scenario) && !has_cuts(scenario);
  if (scenario.tool->grasp && !is_at_rest) // where it closes is known once they have moved the surface
    return;
  try {
    if (scenario.tool->grasp) {
      const Grasping grasping(scenario, *state.organ.domain);
      const topology::ToolPose& pose = state.touch->pose;
      const Grasp grasp = grasping.reach_for(pose.point, pose, state.model, state.zone.fine());
      static_cast<void>(grasping.nodes_between(grasp, state.model, state.zone.fine()));
    } else if (!is_nonlinear(scenario.law)) { // at finite strain all of the surface may be touched
      static_cast<void>(touchable_nodes(scenario, *state.organ.domain, state.model.sprinkling.nodes,
                                        *state.zone.centre(), state.zone.zone().candidate_radius));
    }
  } catch (const InputError& error) {
    throw InputError(fmt::format("{}:{}: {}", scenario.file.string(), scenario.tool->line, error.what()));
  }
}

} // namespace

void require_first_steps(const SessionState& state) {
  require_still(state);
  if (state.touch && state.leader == Leader::path)
    require_reach(state);
}

} // namespace spherecut::app
