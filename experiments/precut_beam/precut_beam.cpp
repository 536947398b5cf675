// Problem:   a bar split along its middle over most of its length (double cantilever), its two arms pulled apart by
//            shear on their ends. It is turned about all three axes, and lies along them; nu = 0 keeps it in plane
//            strain between free sides.
// Reference: beams of height H that turn at their root: opening 8 P (b + 0.64 H)^3 / (w E H^3).
// Command:   spherecut experiment run precut_beam --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/precut_series.hpp"
#include "experiments/support/statistics.hpp"
#include "experiments/support/tilted_strip.hpp"

#include "src/output/figure.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

std::vector<Check> run_precut_beam(const ExperimentContext& context) {
  const int seeds = context.quick ? 1 : 10;
  const std::vector<int> sizes = context.quick ? std::vector<int>{1000} : std::vector<int>{1000, 2000};
  constexpr double arm = 1, depth = 8, length = 11, thickness = 0.8, force = 1;
  const solvers::Material material{1, 0, 0};
  const double wanted =
      8 * force * std::pow(depth + 0.64 * arm, 3) / (thickness * material.young_modulus * std::pow(arm, 3));
  std::vector<Check> checks;
  app::Table table({"placement", "method", "sight", "nodes", "seed", "spacing", "opening", "beam"});
  app::Figure figure{
      "Double cantilever: opening over that of root-corrected beams", "nodes", "opening / beam", false, false, {}};
  for (const PrecutRun& run : precut_runs(context.quick)) {
    const auto& [method, placement] = run;
    const TiltedStrip strip = tilted_strip(length, 2 * arm, thickness, 0.4, StripSides::free, placement);
    const CutFrame& frame = strip.frame;
    app::Series points{run.name(), {}, {}, app::SeriesStyle::points};
    for (int size : placement == Placement::tilted ? sizes : std::vector<int>{sizes.back()}) {
      ErrorSeries errors;
      for (int seed = 1; seed <= (method.judged ? seeds : std::min(seeds, 3)); ++seed) {
        CutBodyCase cut{strip.domain, {cut_from_end(strip, depth, 0, 0.4)}, 1.5, 0.35,
                        size,         static_cast<std::uint64_t>(seed)};
        cut.method = method.method;
        cut.sight = method.sight;
        CutBody body = cut_body(cut);
        body.problem.material = material;
        hold_strip(body.problem, strip);
        body.problem.loads.traction = [frame](const Vector3& x, const Vector3& n) -> Vector3 {
          if (n.dot(frame.ahead) > -0.9)
            return Vector3::Zero();
          return (frame.local(x)[1] > 0 ? 1 : -1) * force / (thickness * arm) * frame.normal;
        };
        const auto discretisation = solvers::discretise(body.problem, method.options());
        solvers::Field field;
        try {
          field = discretisation->solve();
        } catch (const NumericalError& error) {
          if (method.method != solvers::Method::published)
            throw;
          // Its collocated traction rows can leave a slender body nearly singular: the record says so.
          context.say(fmt::format("{}, {} nodes, seed {}: {}", run.name(), size, seed, error.what()));
          table.add({to_string(placement), std::string(solvers::to_string(method.method)),
                     std::string(solvers::to_string(method.sight)), fmt::format("{}", body.problem.nodes.size()),
                     fmt::format("{}", seed), fmt::format("{:.4f}", body.fine), "not solved",
                     fmt::format("{:.5g}", wanted)});
          continue;
        }
        // Mean over the ends of the arms.
        constexpr int rows = 8, columns = 4;
        double opening = 0;
        for (int a = 0; a < rows; ++a)
          for (int b = 0; b < columns; ++b)
            for (const double side : {1.0, -1.0}) {
              const Vector3 at(-0.5 * length + 1e-6, side * arm * (a + 0.5) / rows,
                               thickness * ((b + 0.5) / columns - 0.5));
              const Vector3 x = frame.origin + frame.global(at);
              opening += side * discretisation->at(x, field).displacement.dot(frame.normal) / (rows * columns);
            }
        errors.add("compliance", std::abs(opening / wanted - 1));
        table.add({to_string(placement), std::string(solvers::to_string(method.method)),
                   std::string(solvers::to_string(method.sight)), fmt::format("{}", body.problem.nodes.size()),
                   fmt::format("{}", seed), fmt::format("{:.4f}", body.fine), fmt::format("{:.5g}", opening),
                   fmt::format("{:.5g}", wanted)});
        points.x.push_back(body.problem.nodes.size());
        points.y.push_back(opening / wanted);
      }
      if (errors.empty()) { // never solved: said above
        if (size == sizes.back())
          checks.push_back({"precut_beam_" + run.name() + "_solved_reported", 0, ">=", 0});
        continue;
      }
      context.say(fmt::format("{}, {} nodes, median (worst): {}", run.name(), size, errors.text()));
      if (size != sizes.back())
        continue;
      const std::string name = "precut_beam_" + run.name();
      if (method.judged)
        errors.check(name, "compliance", method.bound(0.05, 0.08), checks);
      else
        checks.push_back({name + "_compliance_reported", median(errors["compliance"]), ">=", 0});
    }
    figure.series.push_back(points);
  }
  table.write(context.out / "runs.csv");
  app::write_png(figure, context.out / "compliance.png");
  return checks;
}

} // namespace spherecut::experiments
