#include "src/session/step_report.hpp"

#include "solvers/contact/bank_pairs.hpp"
#include "solvers/contact/tangential_force.hpp"
#include "solvers/elasticity/rotation.hpp"
#include "src/base/stage_timer.hpp"
#include "src/model/finite_model.hpp"
#include "src/tissue/cut_checks.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::app {
namespace {

constexpr double stretched_rotation = 10;   // degrees, beyond which linear elasticity is being stretched
constexpr double at_front = 0.45;           // fine spacings: no lip node is so near to a front, half a spacing off
constexpr double most_open_work = 0.25;     // of a blade, that its account may leave open
constexpr int few_in_contact = 3;           // nodes
constexpr double deep_press = 0.25;         // of the tip radius
constexpr double most_between_shares = 0.1; // of the fine spacing: what may lie in the tool between middles of shares

} // namespace

void StepReport::tell_linear(ResistedBlade* blade, StepResult& result) {
  const StageTimer timer(state_.profile.evaluate);
  const std::optional<SurfaceWatch::Depths>& penetration = contact_.penetration();
  solvers::ContactState tool = state_.model.state->tool;
  if (blade != nullptr)
    blade->load_grasper(tool, result.pose);
  result.force = tool.tool_force;
  result.torque = tool.tool_torque;
  result.tangential = solvers::tangential_force(state_.model.patch, tool,
                                                grasping_.holds() ? solvers::ContactCondition::bonded
                                                                  : state_.scenario.contact.condition);
  result.contact_radius = tool.contact_radius;
  result.active_nodes = tool.active_nodes;
  result.candidates = static_cast<int>(state_.model.patch.nodes.size());
  result.nodes = state_.model.sprinkling.nodes.size();
  result.iterations = tool.iterations;
  result.converged = tool.converged;
  result.largest_penetration = penetration ? penetration->deepest : tool.largest_penetration;
  state_.displacements = contact_.displacements(state_.model);
  if (result.has_grown() || !state_.options.force_only)
    result.residual = residual(state_.model);
  if (blade != nullptr)
    blade->load_body();
  if (!result.force.allFinite())
    throw NumericalError(fmt::format("the tool force at t = {:g} s is not finite; residual {:.1e}, condition estimate "
                                     "{:.1e}",
                                     result.time, result.residual, state_.model.body->report().condition_estimate));
  state_.node_states.clear();
  if (!state_.options.force_only)
    tell_nodes(result);
  result.self_penetration = state_.model.passed_through.depth;
  judge_contact(result);
  judge_fineness(result);
  if (!state_.model.state->lips.converged)
    state_.log.warn("lips", fmt::format("the contact of the lips did not converge at t = {:g} s", result.time));
}

void StepReport::tell_nodes(StepResult& result) {
  double farthest = 0; // m, that a node moves
  Vector3 place = Vector3::Zero();
  for (const Vector3& x : state_.model.sprinkling.nodes.positions) {
    state_.node_states.push_back(state_.model.body->at(x, state_.model.field));
    const Matrix3& gradient = state_.node_states.back().gradient;
    const Matrix3 skew = 0.5 * (gradient - gradient.transpose());
    const double angle = Vector3(skew(2, 1), skew(0, 2), skew(1, 0)).norm() * 180 / std::numbers::pi;
    if (!is_at_front(x))
      result.rotation_degrees = std::max(result.rotation_degrees, angle);
    if (const double moved = state_.node_states.back().displacement.norm();
        !std::isnan(farthest) && !(moved <= farthest)) {
      farthest = moved;
      place = x;
    }
  }
  if (const double size = state_.organ.domain->bounds().extent().norm(); !(farthest <= size))
    state_.log.warn(
        "astray",
        fmt::format("tissue at [{:.4g}, {:.4g}, {:.4g}] m moves by {:.3g} m at t = {:g} s, farther than the organ's "
                    "size of {:.3g} m: it hangs by next to nothing, or its loads are far too large; what is computed "
                    "of it is of no use",
                    place.x(), place.y(), place.z(), farthest, result.time, size));
  if (result.rotation_degrees > stretched_rotation)
    state_.log.warn(
        "rotation",
        fmt::format("tissue rotates by {:.0f} degrees at t = {:g} s (over {:g}): linear elasticity is being "
                    "stretched",
                    result.rotation_degrees, result.time, stretched_rotation));
}

// The rotation there grows without bound towards the front: it would be that of the place where a node happens to be.
bool StepReport::is_at_front(const Vector3& x) const {
  return state_.model.incision != nullptr &&
         state_.model.incision->front_frame(x, at_front * state_.zone.fine()).has_value();
}

void StepReport::tell_finite(ResistedBlade* blade, StepResult& result) {
  if (blade != nullptr)
    blade->load_body();
  const FiniteStep& step = state_.model.finite->last();
  result.force = step.force;
  result.torque = step.torque;
  result.tangential = step.tangential;
  result.contact_radius = step.contact_radius;
  result.active_nodes = step.active_nodes;
  result.candidates = state_.model.finite->candidates();
  result.nodes = state_.model.sprinkling.nodes.size();
  result.iterations = step.iterations;
  result.residual = step.residual;
  result.largest_penetration = step.penetration;
  result.least_jacobian = step.least_jacobian;
  const StageTimer timer(state_.profile.evaluate);
  state_.displacements = state_.model.finite->nodal_displacements();
  state_.node_states.clear();
  if (!state_.options.force_only)
    for (const Vector3& x : state_.model.sprinkling.nodes.positions) {
      state_.node_states.push_back(state_.model.at(x));
      if (!is_at_front(x))
        result.rotation_degrees =
            std::max(result.rotation_degrees,
                     solvers::rotation_degrees(Matrix3::Identity() + state_.node_states.back().gradient));
    }
  judge_banks(result);
  if (result.least_jacobian < least_sound_jacobian)
    state_.log.warn(
        "volume", fmt::format("the least volume ratio is {:.2g} at t = {:g} s (sound from {:g} on): tissue is pressed "
                              "flat between nodes too coarse for its strain, and forces and stresses there are not "
                              "to be trusted; finer nodes (nodes.fine_spacing, cut.front_spacing), a larger "
                              "material.poisson_ratio or less load do",
                              result.least_jacobian, result.time, least_sound_jacobian));
  if (!state_.touch)
    return;
  judge_fineness(result);
  if (result.largest_penetration > most_between_shares * state_.zone.fine())
    state_.log.warn(
        "surface", fmt::format("the surface lies {:.2g} m in the tool between its nodes at t = {:g} s: {:.0f} % of the "
                               "fine spacing, allowed {:g} %; nodes.fine_spacing makes them finer. A sharp edge that "
                               "is drawn along the surface does that, too: its force is then too small",
                               result.largest_penetration, result.time,
                               100 * result.largest_penetration / state_.zone.fine(), 100 * most_between_shares));
}

void StepReport::judge_contact(const StepResult& result) {
  const std::optional<SurfaceWatch::Depths>& penetration = contact_.penetration();
  if (!result.converged)
    state_.log.warn("contact", fmt::format("the contact did not converge at t = {:g} s: {:.2g} m of penetration left",
                                           result.time, result.largest_penetration));
  if (penetration && penetration->deepest > most_left_over * penetration->spacing)
    state_.log.warn(
        penetration->pushed ? "surface" : "held surface",
        fmt::format("the surface lies {:.2g} m in the tool at [{:.4g}, {:.4g}, {:.4g}] m, t = {:g} s: {:.0f} % of the "
                    "nodes' spacing there, allowed {:g} %; {}",
                    penetration->deepest, penetration->place.x(), penetration->place.y(), penetration->place.z(),
                    result.time, 100 * penetration->deepest / penetration->spacing, 100 * most_left_over,
                    penetration->pushed ? "finer nodes at the contact follow the tool"
                                        : "a fixed region holds it there against the tool, whose force is too small"));
  if (const BodyModel::PassedThrough& passed = state_.model.passed_through;
      passed.depth > most_left_over * passed.spacing) {
    const bool is_open = state_.scenario.cut.lips == solvers::LipCondition::open;
    state_.log.warn(
        is_open ? "passes open" : "passes",
        fmt::format("the organ's surface passes through itself by {:.2g} m at [{:.4g}, {:.4g}, {:.4g}] m, t = {:g} s: "
                    "{}",
                    passed.depth, passed.place.x(), passed.place.y(), passed.place.z(), result.time,
                    is_open ? "cut.lips = \"open\" leaves the contact of its parts out"
                            : "its parts push on one another from node to node, and the nodes do not tell it finer"));
  }
}

// Where that deep a tip touches one or two nodes, its force is that of these nodes' places.
void StepReport::judge_fineness(const StepResult& result) {
  const double depth = state_.touch ? depth_of_press(result.contact) : 0;
  if (state_.touch && !state_.scenario.tool->grasp && result.active_nodes < few_in_contact &&
      (result.active_nodes > 0 || state_.model.incision == nullptr) &&
      depth > deep_press * topology::tip_radius(state_.scenario.tool->shape))
    state_.log.warn(
        "coarse", fmt::format("the tool is {:.2g} m deep at t = {:g} s and touches {} of the surface's nodes: {:.2g} m "
                              "between nodes are too coarse for a tip of {:.2g} m; nodes.fine_spacing or nodes.count "
                              "make them finer",
                              depth, result.time, result.active_nodes, state_.zone.fine(),
                              topology::tip_radius(state_.scenario.tool->shape)));
}

// Below where the surface would be without the tool, m: loads and pretension may have drawn it away.
double StepReport::depth_of_press(const topology::SurfaceContact& contact) const {
  const std::vector<Vector3>& rest = state_.model.patch.rest;
  if (rest.empty())
    return contact.depth;
  const auto nearest = std::min_element(rest.begin(), rest.end(), [&](const Vector3& a, const Vector3& b) {
    return (a - contact.point).squaredNorm() < (b - contact.point).squaredNorm();
  });
  return contact.depth +
         contact.normal.dot(state_.model.patch.base_displacement.segment<3>(3 * (nearest - rest.begin())));
}

// Its own surface does not hold such a body apart.
void StepReport::judge_banks(StepResult& result) {
  const solvers::NodeCloud& nodes = state_.model.sprinkling.nodes;
  const solvers::BankPairs found = solvers::bank_pairs(nodes, state_.displacements, near_banks);
  for (std::size_t p = 0; p < found.pairs.size(); ++p) {
    const double depth = -found.openings[p];
    result.self_penetration = std::max(result.self_penetration, depth);
    const int node = found.pairs[p].minus;
    if (depth <= most_left_over * nodes.spacings[node])
      continue;
    const Vector3& place = nodes.positions[node];
    state_.log.warn(
        "passes", fmt::format("the organ's surface passes through itself by {:.2g} m at [{:.4g}, {:.4g}, {:.4g}] m, t "
                              "= {:g} s: with a law other than linear its parts do not push on one another",
                              depth, place.x(), place.y(), place.z(), result.time));
  }
}

void StepReport::tell_cut(const ResistedBlade* blade, CutReport& report) {
  const topology::Wound& wound = *state_.wound();
  if (blade != nullptr)
    report.blade = blade->force().report();
  if (const solvers::BladeLedger& ledger = report.blade.ledger;
      ledger.surface > 0 && ledger.imbalance() > most_open_work)
    state_.log.warn(
        "blade account",
        fmt::format("the account of the blade leaves {:.0f} % of its work open: its force and what it cuts are "
                    "no better than that. Faces of the cut that a tool or the loads press together before the "
                    "edge may do that",
                    100 * ledger.imbalance()));
  if (state_.model.incision != nullptr) {
    report.area = state_.model.incision->area();
    report.front_length = state_.model.incision->front_length();
    report.sheets = static_cast<int>(state_.model.incision->sheets().size());
  }
  for (const topology::WoundPiece& piece : wound.pieces)
    report.volumes.push_back(piece.volume);
  report.pieces = static_cast<int>(report.volumes.size());
  std::sort(report.volumes.rbegin(), report.volumes.rend());
  report.unheld = static_cast<int>(unheld_pieces(wound, state_.scenario.fixed).size());
  report.nodes = state_.model.sprinkling.nodes.size();
  report.lip_pairs = static_cast<int>(state_.model.pairs.size());
  if (state_.model.finite != nullptr && state_.model.solved()) {
    tell_opening(wound, report);
    report.closed_pairs = state_.model.finite->last().closed_pairs;
  } else if (state_.model.state) {
    tell_opening(wound, report);
    for (std::size_t p = 0; p < std::min(state_.model.pairs.size(), state_.model.state->lips.closed.size()); ++p)
      report.closed_pairs += state_.model.state->lips.closed[p];
    report.lips_converged = state_.model.state->lips.converged;
  }
  if (!state_.options.force_only)
    report.surface_hash = topology::surface_hash(wound.surface);
}

// Lips in contact are held together in the mean over their shares; where they are apart, the distance is that of the
// surface, or, where no picture is made of it, of the nodes on it.
void StepReport::tell_opening(const topology::Wound& wound, CutReport& report) {
  constexpr double touching = 1e-9; // m, as finely as the contact of the lips is solved
  double apart = 0;
  for (const double mean : normal_openings(state_.model))
    apart = std::max(apart, mean);
  const auto tell = [&](double largest) { report.opening = apart > touching && largest > touching ? largest : apart; };
  if (!state_.options.force_only) {
    const Opening opening = opening_of(wound, state_.model);
    report.opening_volume = opening.volume;
    tell(opening.largest);
    return;
  }
  const VectorX& moved = contact_.displacements(state_.model);
  double largest = 0;
  for (const solvers::LipPair& pair : state_.model.pairs)
    largest = std::max(largest, pair.normal.dot(moved.segment<3>(3 * static_cast<Eigen::Index>(pair.plus)) -
                                                moved.segment<3>(3 * static_cast<Eigen::Index>(pair.minus))));
  tell(largest);
}

} // namespace spherecut::app
