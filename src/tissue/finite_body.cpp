#include "src/tissue/finite_body.hpp"

#include "src/base/stage_timer.hpp"
#include "src/scenario/law_reader.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <fmt/format.h>

namespace spherecut::app {

void make_finite(SessionState& state, BodyModel& model, const BodyModel* before) {
  interruption_point();
  const StageTimer timer(state.profile.discretise);
  model.pairs = solvers::lip_pairs(model.sprinkling.nodes);
  if (before != nullptr)
    model.lineage = before->lineage;
  model.finite = std::make_shared<FiniteModel>(state.scenario, state.organ.domain, model, state.touch.has_value(),
                                               state.leader == Leader::path ? Patience::of_a_run : Patience::of_a_hand);
  model.lineage = model.finite->lineage();
  if (before != nullptr && before->solved())
    model.finite->go_on_from(*before);
  if (before != nullptr && !before->pairs.empty()) // what an increment changes is told in cuts.csv
    return;
  const solvers::SprinkleReport& report = model.sprinkling.report;
  state.log.say(fmt::format("{} nodes, {} of them on the surface, {} on the faces of the cut, {} fixed; law {}",
                            model.sprinkling.nodes.size(), report.surface_nodes + report.edge_nodes,
                            2 * model.pairs.size(), model.finite->held(), name_of(state.scenario.law)));
}

void make_finite_apart(const Scenario& scenario, const std::shared_ptr<const topology::Domain>& domain,
                       const std::vector<int>& wanted, BodyModel& model) {
  model.pairs = solvers::lip_pairs(model.sprinkling.nodes);
  model.finite = std::make_shared<FiniteModel>(scenario, domain, model, scenario.tool.has_value(), Patience::of_a_hand);
  model.lineage = model.finite->lineage();
  if (!wanted.empty())
    model.finite->prepare_to_condense(wanted);
}

void take_over_finite(const BodyModel& before, BodyModel& next, SessionProfile& profile) {
  if (next.finite == nullptr || before.finite == nullptr || !before.solved())
    return;
  next.finite->go_on_from(before);
  solve_finite(before.finite->time(), before.finite->pose(), next, profile);
}

// Where the way from the last state does not lead to equilibrium, the one from rest may.
void solve_finite(double time, const std::optional<topology::ToolPose>& pose, BodyModel& model,
                  SessionProfile& profile) {
  const StageTimer timer(profile.press);
  try {
    model.finite->solve(time, pose);
  } catch (const NumericalError&) {
    if (model.finite->coefficients().isZero(0) || !model.finite->may_begin_anew()) // it has begun there
      throw;
    model.finite->solve_from_rest(time, pose);
  }
  model.field.coefficients = model.finite->coefficients();
}

} // namespace spherecut::app
