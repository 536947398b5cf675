// Problem:   what people bring who do this job: hardware at its own rate, hands that go where they like, files and
//            messages that nobody has vouched for. Every input is made here.
// Reference: the right answer of each by another way of this program, or a clear word.
// Command:   spherecut experiment run real_world --out DIR
#include "experiments/real_world/live_situations.hpp"

#include "src/figure.hpp"

#include <fmt/format.h>
#include <utility>

namespace spherecut::experiments {

std::vector<Check> run_real_world(const ExperimentContext& context) {
  std::vector<Check> checks;
  for (const auto& group : {real_world::device_elsewhere, real_world::slow_clients, real_world::disorder})
    for (Check& check : group(context))
      checks.push_back(std::move(check));
  app::Table table({"check", "value", "relation", "bound"});
  for (const Check& check : checks)
    table.add({check.name, fmt::format("{:.6g}", check.value), check.relation, fmt::format("{:.6g}", check.bound)});
  table.write(context.out / "real_world.csv");
  return checks;
}

} // namespace spherecut::experiments
