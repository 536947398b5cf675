// Problem:   what people bring: organs as segmentations and programs leave them, thin walls, loads without a tool, cuts
//            that reach out of the body; hardware at its own rate, hands that go where they like, files and messages
//            that nobody has vouched for. Every input is made here.
// Reference: closed forms, the same answer by another way of this program, or a clear word.
// Command:   spherecut experiment run real_world --out DIR
#include "experiments/real_world/live_situations.hpp"
#include "experiments/real_world/situations.hpp"
#include "experiments/registered.hpp"

#include "src/output/figure.hpp"
#include "topology/base/errors.hpp"

#include <fmt/format.h>

namespace spherecut::experiments {

namespace real_world {

Outcome run_text(const ExperimentContext& context, const std::string& text) {
  app::Session session(app::read_scenario_text(context.out / "case.toml", text), [](const std::string&) {});
  Outcome outcome;
  for (const app::StepSample& sample : session.steps())
    outcome.last = session.step(sample);
  outcome.nodes = session.model().sprinkling.nodes.size();
  for (const solvers::PointState& state : session.node_states())
    outcome.largest_displacement = std::max(outcome.largest_displacement, state.displacement.norm());
  outcome.warnings = session.warnings();
  return outcome;
}

std::string refusal_of(const ExperimentContext& context, const std::string& text) {
  try {
    run_text(context, text);
  } catch (const std::exception& error) {
    return error.what();
  }
  return "";
}

} // namespace real_world

std::vector<Check> run_real_world(const ExperimentContext& context) {
  constexpr std::array<real_world::Group, 7> groups{
      real_world::organ_files,      real_world::organ_bodies, real_world::default_cracks, real_world::narrow_gaps,
      real_world::device_elsewhere, real_world::slow_clients, real_world::disorder};
  std::vector<Check> checks;
  for (const real_world::Group group : groups)
    for (Check& check : group(context)) {
      context.say(fmt::format("{}: {:.5g} {} {:.4g}", check.name, check.value, check.relation, check.bound));
      checks.push_back(std::move(check));
    }
  app::Table table({"check", "value", "relation", "bound"});
  app::Series shares{"value over bound", {}, {}, app::SeriesStyle::points};
  for (std::size_t k = 0; k < checks.size(); ++k) {
    const Check& check = checks[k];
    table.add({check.name, fmt::format("{:.6g}", check.value), check.relation, fmt::format("{:.6g}", check.bound)});
    if (check.bound == 0)
      continue;
    shares.x.push_back(static_cast<double>(k + 1));
    shares.y.push_back(check.value / check.bound);
  }
  table.write(context.out / "real_world.csv");
  app::write_png({"What people bring", "check", "value over its bound", false, false, {shares}},
                 context.out / "real_world.png");
  return checks;
}

} // namespace spherecut::experiments
