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
  model.finite = std::make_shared<FiniteModel>(state.scenario, state.organ.domain, model, state.touch.has_value());
  if (before != nullptr && before->solved())
    model.finite->go_on_from(*before);
  if (before != nullptr && !before->pairs.empty()) // what an increment changes is told in cuts.csv
    return;
  const solvers::SprinkleReport& report = model.sprinkling.report;
  state.log.say(fmt::format("{} nodes, {} of them on the surface, {} on the faces of the cut, {} fixed; law {}",
                            model.sprinkling.nodes.size(), report.surface_nodes + report.edge_nodes,
                            2 * model.pairs.size(), model.finite->held(), name_of(state.scenario.law)));
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
    model.finite->begin_anew();
    model.finite->solve(time, pose);
  }
  model.field.coefficients = model.finite->coefficients();
}

} // namespace spherecut::app
