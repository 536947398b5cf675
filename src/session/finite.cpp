// Steps of a session whose law is not linear: its body is one at finite strain, on nodes that stay.
#include "solvers/contact/bank_pairs.hpp"
#include "src/base/stage_timer.hpp"
#include "src/scenario/law_reader.hpp"
#include "src/session/session.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

constexpr double most_between_shares = 0.1; // of the fine spacing: what may lie in the tool between middles of shares

} // namespace

// Where the tool touches on its way, as far apart as the contact may leave the centre of a fine zone.
std::vector<Vector3> Session::places_of_contact() const {
  std::vector<Vector3> places{zone_contact_->point};
  const double pitch = scenario_.contact.follow_fraction * zone_.spacing.radius;
  for (const StepSample& sample : steps_) {
    if (!sample.tool)
      continue;
    const topology::SurfaceContact contact = query_.first_touch(scenario_.tool->shape, *sample.tool);
    const Vector3 place = centre_of(contact, *sample.tool).point;
    if (contact.depth > 0 && std::none_of(places.begin(), places.end(),
                                          [&](const Vector3& known) { return (known - place).norm() <= pitch; }))
      places.push_back(place);
  }
  return places;
}

void Session::make_finite() {
  interruption_point();
  const StageTimer timer(profile_.discretise);
  finite_ = std::make_unique<FiniteModel>(scenario_, organ_.domain, model_, touches());
  const solvers::SprinkleReport& report = model_.sprinkling.report;
  say_(fmt::format("{} nodes, {} of them on the surface, {} fixed; law {}", model_.sprinkling.nodes.size(),
                   report.surface_nodes + report.edge_nodes, finite_->held(), name_of(scenario_.law)));
}

FiniteStep Session::solve_finite(double time, const std::optional<topology::ToolPose>& pose) {
  const StageTimer timer(profile_.press);
  try {
    return finite_->solve(pose);
  } catch (const NumericalError& error) {
    throw NumericalError(fmt::format("t = {:g} s: {}. The rows up to then are kept. What a law cannot bear does that, "
                                     "or steps too long for it (tool.step), or nodes too coarse for the tool "
                                     "(nodes.fine_spacing)",
                                     time, error.what()));
  }
}

void Session::step_finite(const StepSample& sample, StepResult& result) {
  const bool begins = has_loads() || (touches() && result.contact.depth > 0);
  if (finite_ == nullptr && !begins) {
    free_pose_ = sample.tool;
    return;
  }
  if (finite_ == nullptr) {
    make_finite();
    if (touches() && free_pose_ && !has_loads()) // from there a step goes, should it have to be halved
      static_cast<void>(solve_finite(sample.time, free_pose_));
  }
  interruption_point();
  const FiniteStep step = solve_finite(sample.time, sample.tool);
  result.force = step.force;
  result.torque = step.torque;
  result.contact_radius = step.contact_radius;
  result.active_nodes = step.active_nodes;
  result.candidates = finite_->candidates();
  result.nodes = model_.sprinkling.nodes.size();
  result.iterations = step.iterations;
  result.residual = step.residual;
  result.largest_penetration = step.penetration;
  result.least_jacobian = step.least_jacobian;
  const StageTimer timer(profile_.evaluate);
  node_displacements_ = finite_->nodal_displacements();
  node_states_.clear();
  for (const Vector3& x : model_.sprinkling.nodes.positions) {
    node_states_.push_back(finite_->at(x));
    result.rotation_degrees =
        std::max(result.rotation_degrees, rotation_degrees(Matrix3::Identity() + node_states_.back().gradient));
  }
  watch_banks(result);
  if (!touches())
    return;
  judge_fineness(result);
  if (result.largest_penetration > most_between_shares * zone_.spacing.fine)
    warn("surface",
         fmt::format("the surface lies {:.2g} m in the tool between its nodes at t = {:g} s: {:.0f} % of the "
                     "fine spacing, allowed {:g} %; nodes.fine_spacing makes them finer. A sharp edge that "
                     "is drawn along the surface does that, too: its force is then too small",
                     result.largest_penetration, result.time, 100 * result.largest_penetration / zone_.spacing.fine,
                     100 * most_between_shares));
}

// Its own surface does not hold such a body apart.
void Session::watch_banks(StepResult& result) {
  const solvers::NodeCloud& nodes = model_.sprinkling.nodes;
  const solvers::BankPairs found = solvers::bank_pairs(nodes, node_displacements_, near_banks);
  for (std::size_t p = 0; p < found.pairs.size(); ++p) {
    const double depth = -found.openings[p];
    result.self_penetration = std::max(result.self_penetration, depth);
    const int node = found.pairs[p].minus;
    if (depth <= most_left_over * nodes.spacings[node])
      continue;
    const Vector3& place = nodes.positions[node];
    warn("passes", fmt::format("the organ's surface passes through itself by {:.2g} m at [{:.4g}, {:.4g}, {:.4g}] m, t "
                               "= {:g} s: with a law other than linear its parts do not push on one another",
                               depth, place.x(), place.y(), place.z(), result.time));
  }
}

} // namespace spherecut::app
