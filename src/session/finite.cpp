// Steps of a session whose law is not linear: its body is one at finite strain, on nodes that stay until a blade cuts.
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

void Session::make_finite(BodyModel& model, const BodyModel* before) {
  interruption_point();
  const StageTimer timer(profile_.discretise);
  model.pairs = solvers::lip_pairs(model.sprinkling.nodes);
  model.finite = std::make_shared<FiniteModel>(scenario_, organ_.domain, model, touches());
  if (before != nullptr && before->solved())
    model.finite->go_on_from(*before);
  if (before != nullptr && !before->pairs.empty()) // what an increment changes is told in cuts.csv
    return;
  const solvers::SprinkleReport& report = model.sprinkling.report;
  say_(fmt::format("{} nodes, {} of them on the surface, {} on the faces of the cut, {} fixed; law {}",
                   model.sprinkling.nodes.size(), report.surface_nodes + report.edge_nodes, 2 * model.pairs.size(),
                   model.finite->held(), name_of(scenario_.law)));
}

// Where the way from the last state does not lead to equilibrium, the one from rest may.
void Session::solve_finite(double time, const std::optional<topology::ToolPose>& pose, BodyModel& model) {
  const StageTimer timer(profile_.press);
  try {
    model.finite->solve(time, pose);
  } catch (const NumericalError&) {
    if (model.finite->coefficients().isZero(0)) // it has begun there
      throw;
    model.finite->begin_anew();
    model.finite->solve(time, pose);
  }
  model.field.coefficients = model.finite->coefficients();
}

// A body on the nodes of the new cut, which goes on from where the one before has come to.
void Session::build_finite_cut(BodyModel& next, BodyUpdate& report) {
  report.update = SystemUpdate::rebuilt;
  report.update_reason = "the law is not linear";
  {
    const StageTimer timer(report.seconds.sprinkling);
    sprinkle(&model_.sprinkling.nodes, next);
  }
  const StageTimer timer(report.seconds.assembly);
  make_finite(next, &model_);
  report.nodes = next.sprinkling.nodes.size();
  const std::vector<int>& from = next.sprinkling.kept_from;
  report.kept_nodes = static_cast<int>(std::count_if(from.begin(), from.end(), [](int i) { return i >= 0; }));
}

void Session::step_finite(const StepSample& sample, StepResult& result) {
  if (cuts())
    result.cut = CutReport{};
  const bool was_cut = incisions_ != nullptr && move_blade(sample, *result.cut);
  if (sample.blade)
    last_blade_ = sample.blade;
  const bool begins = has_loads() || (touches() && result.contact.depth > 0) || model_.incision != nullptr;
  if (model_.finite == nullptr && !begins) {
    free_pose_ = sample.tool;
    free_time_ = sample.time;
    return;
  }
  interruption_point();
  try {
    if (model_.finite == nullptr) {
      make_finite(model_);
      if (touches() && free_pose_ && !has_loads()) // from there a step goes, should it have to be halved
        solve_finite(free_time_, free_pose_, model_);
    }
    if (!was_cut)
      solve_finite(sample.time, sample.tool, model_);
  } catch (const NumericalError& error) {
    throw NumericalError(fmt::format("t = {:g} s: {}. The rows up to then are kept. What a law cannot bear does that, "
                                     "or steps too long for it (tool.step), or nodes too coarse for the tool "
                                     "(nodes.fine_spacing)",
                                     sample.time, error.what()));
  }
  const FiniteStep& step = model_.finite->last();
  result.force = step.force;
  result.torque = step.torque;
  result.contact_radius = step.contact_radius;
  result.active_nodes = step.active_nodes;
  result.candidates = model_.finite->candidates();
  result.nodes = model_.sprinkling.nodes.size();
  result.iterations = step.iterations;
  result.residual = step.residual;
  result.largest_penetration = step.penetration;
  result.least_jacobian = step.least_jacobian;
  const StageTimer timer(profile_.evaluate);
  node_displacements_ = model_.finite->nodal_displacements();
  node_states_.clear();
  for (const Vector3& x : model_.sprinkling.nodes.positions) {
    node_states_.push_back(model_.at(x));
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
