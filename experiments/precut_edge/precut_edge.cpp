// Problem:   a strip 1 m wide and 3 m long, 0.4 m thick between sliding sides (plane strain), cut in from one side over
//            0.4 of its width, and pulled at its ends by the stress s. It stands askew between the axes, and along
//            them. The same with free sides and nu = 0, which is plane strain too, turned about all three axes.
// Reference: K_I of the single-edge-notched strip, to 0.5 % [Tada, Paris and Irwin].
// Command:   spherecut experiment run precut_edge --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/precut_series.hpp"
#include "experiments/support/statistics.hpp"
#include "experiments/support/tilted_strip.hpp"

#include "src/output/figure.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

std::vector<Check> run_precut_edge(const ExperimentContext& context) {
  const int seeds = context.quick ? 1 : 10;
  const std::vector<int> sizes = context.quick ? std::vector<int>{700} : std::vector<int>{700, 1400};
  constexpr double width = 1, depth = 0.4, tension = 1;
  // The strip lies along `ahead`: its length is the way of the cut, its height the direction of the pull.
  const double wanted = edge_notched_strip_intensity(tension, depth, width);
  std::vector<Check> checks;
  app::Table table({"placement", "method", "sight", "sides", "nodes", "seed", "spacing", "k_correlation",
                    "k_interaction", "k_exact"});
  app::Figure figure{"Edge-notched strip: intensity over Tada's", "nodes", "K_I / exact", false, false, {}};
  struct Run {
    PrecutMethod method;
    StripSides sides;
    Placement placement = Placement::tilted;
    [[nodiscard]] std::string name() const {
      return method.name() + (sides == StripSides::free ? "_free_sides" : "") + suffix(placement);
    }
  };
  std::vector<Run> runs;
  for (const PrecutMethod& method : precut_methods(context.quick)) {
    runs.push_back({method, StripSides::sliding});
    if (method.judged)
      runs.push_back({method, StripSides::free});
  }
  if (!context.quick)
    for (const PrecutMethod& method : precut_methods(true))
      for (const StripSides sides : {StripSides::sliding, StripSides::free})
        runs.push_back({method, sides, Placement::aligned});
  for (const Run& run : runs) {
    const PrecutMethod& method = run.method;
    const TiltedStrip strip = tilted_strip(width, 3, 0.4, 0.2, run.sides, run.placement);
    const CutFrame& frame = strip.frame;
    app::Series points{run.name(), {}, {}, app::SeriesStyle::points};
    for (int size : run.placement == Placement::tilted ? sizes : std::vector<int>{sizes.back()}) {
      ErrorSeries errors;
      for (int seed = 1; seed <= (method.judged ? seeds : std::min(seeds, 3)); ++seed) {
        CutBodyCase cut{strip.domain, {cut_from_end(strip, depth, 0.07, 0.1)}, 4, 0.35,
                        size,         static_cast<std::uint64_t>(seed)};
        cut.method = method.method;
        cut.sight = method.sight;
        CutBody body = cut_body(cut);
        body.problem.material = {1, run.sides == StripSides::free ? 0.0 : 0.3, 0};
        hold_strip(body.problem, strip);
        body.problem.loads.traction = [frame](const Vector3&, const Vector3& n) -> Vector3 {
          const double pull = n.dot(frame.normal);
          return std::abs(pull) > 0.9 ? Vector3((pull > 0 ? tension : -tension) * frame.normal) : Vector3::Zero();
        };
        const auto discretisation = solvers::discretise(body.problem, method.options());
        const solvers::Field field = discretisation->solve();
        const auto front = body.problem.incision->front_frame(
            frame.origin + (depth - 0.5 * width) * frame.ahead + 0.07 * frame.normal, 0.1);
        const double by_jump = solvers::displacement_correlation(*discretisation, field, *front)[0];
        const double by_integral = solvers::interaction_integral(*discretisation, field, *front)[0];
        errors.add("k_correlation", std::abs(by_jump / wanted - 1));
        errors.add("k_interaction", std::abs(by_integral / wanted - 1));
        table.add({to_string(run.placement), std::string(solvers::to_string(method.method)),
                   std::string(solvers::to_string(method.sight)), run.sides == StripSides::free ? "free" : "sliding",
                   fmt::format("{}", body.problem.nodes.size()), fmt::format("{}", seed),
                   fmt::format("{:.4f}", body.fine), fmt::format("{:.5f}", by_jump), fmt::format("{:.5f}", by_integral),
                   fmt::format("{:.5f}", wanted)});
        points.x.push_back(body.problem.nodes.size());
        points.y.push_back(by_integral / wanted);
      }
      context.say(fmt::format("{}, {} nodes, medians (worst): {}", run.name(), size, errors.text()));
      if (size != sizes.back())
        continue;
      const std::string name = "precut_edge_" + run.name();
      if (method.judged) {
        errors.check(name, "k_correlation", method.bound(0.04, 0.08), checks);
        errors.check(name, "k_interaction", method.bound(0.04, 0.08), checks);
      } else {
        checks.push_back({name + "_k_interaction_reported", median(errors["k_interaction"]), ">=", 0});
      }
    }
    figure.series.push_back(points);
  }
  table.write(context.out / "runs.csv");
  app::write_png(figure, context.out / "intensity.png");
  return checks;
}

} // namespace spherecut::experiments
