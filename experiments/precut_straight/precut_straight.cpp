// Problem:   a block of 2 x 1 x 2 m is cut from one side; the straight front runs through it, tilted and shifted
//            against the block, and along its axes. The exact displacement of a crack in mode I, II or III is
//            prescribed on the whole surface.
// Reference: the field itself [Williams 1957]: K = 1. The opening is compared from the front to 0.8 m behind it over
// the
//            middle 80 % of the front; K is the mean of three places along it, by displacement correlation and by
//            interaction integral.
// Command:   spherecut experiment run precut_straight --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/precut_series.hpp"
#include "experiments/support/statistics.hpp"
#include "experiments/support/straight_crack.hpp"

#include "src/output/figure.hpp"

#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

constexpr double half_thickness = 0.5; // m, of the block along the front
constexpr std::array<const char*, 3> mode_names{"I", "II", "III"};
constexpr std::array<int, 3> opening_component{1, 0, 2}; // in the axes (ahead, normal, tangent)

struct Opening {
  std::vector<double> behind, computed; // m, along the middle of the front
  double error = 0;                     // relative L2
};

Opening opening_of(const CutFrame& crack, const solvers::Discretisation& body, const solvers::Field& field,
                   double spacing, int mode) {
  const solvers::Intensities k = Vector3::Unit(mode);
  Opening opening;
  double error = 0, size = 0;
  for (int i = 0; i < 60; ++i)
    for (int j = 0; j < 5; ++j) {
      const double s = 0.8 * std::pow((i + 0.5) / 60, 2), along = half_thickness * (1.6 * (j + 0.5) / 5 - 0.8);
      const Vector3 x = crack.origin - s * crack.ahead + along * crack.tangent;
      const Vector3 jump = opening_at(body, field, x, crack.normal, spacing);
      const double computed = crack.local(crack.origin + jump)[opening_component[mode]];
      const double exact =
          2 * solvers::tip_field(body.problem().material, k, -s, 1e-15 * s).displacement[opening_component[mode]];
      error += (computed - exact) * (computed - exact);
      size += exact * exact;
      if (j == 2) {
        opening.behind.push_back(s);
        opening.computed.push_back(computed);
      }
    }
  opening.error = std::sqrt(error / size);
  return opening;
}

} // namespace

std::vector<Check> run_precut_straight(const ExperimentContext& context) {
  const int seeds = context.quick ? 2 : 10;
  std::vector<Check> checks;
  app::Table table({"placement", "method", "sight", "seed", "nodes", "spacing", "mode", "opening_error",
                    "k_correlation", "k_interaction", "k_of_other_modes"});
  app::Figure figure{"Straight crack, mode I: opening behind the front",
                     "distance behind the front / m",
                     "opening / m",
                     false,
                     false,
                     {}};
  for (const PrecutRun& run : precut_runs(context.quick, true)) {
    const auto& [method, placement] = run;
    const CutFrame crack = straight_crack_frame(placement);
    std::array<ErrorSeries, 3> errors;
    for (int seed = 1; seed <= seeds; ++seed) {
      CutBody body = straight_crack_body(static_cast<std::uint64_t>(seed), 0.3, method.method, method.sight, placement);
      const solvers::Material material = body.problem.material;
      solvers::Intensities acting = Vector3::Zero();
      hold_whole_surface(body.problem, [&acting, &crack, material](const Vector3& x) {
        return straight_crack_displacement(material, crack, acting, x);
      });
      const auto discretisation = solvers::discretise(body.problem, method.options());
      for (int mode = 0; mode < 3; ++mode) {
        acting = Vector3::Unit(mode);
        const solvers::Field field = discretisation->solve();
        const Opening opening = opening_of(crack, *discretisation, field, body.fine, mode);
        solvers::Intensities correlation = Vector3::Zero(), interaction = Vector3::Zero();
        const auto fronts = solvers::front_samples(*body.problem.incision, 0.2, 0.25);
        for (const topology::FrontFrame& front : fronts) {
          correlation += solvers::displacement_correlation(*discretisation, field, front);
          interaction += solvers::interaction_integral(*discretisation, field, front);
        }
        correlation /= static_cast<double>(fronts.size());
        interaction /= static_cast<double>(fronts.size());
        const double others = (interaction - interaction[mode] * acting).norm();
        errors[mode].add("opening", opening.error);
        errors[mode].add("k_correlation", std::abs(correlation[mode] - 1));
        errors[mode].add("k_interaction", std::abs(interaction[mode] - 1));
        table.add({to_string(placement), std::string(solvers::to_string(method.method)),
                   std::string(solvers::to_string(method.sight)), fmt::format("{}", seed),
                   fmt::format("{}", body.problem.nodes.size()), fmt::format("{:.4f}", body.fine), mode_names[mode],
                   fmt::format("{:.5f}", opening.error), fmt::format("{:.5f}", correlation[mode]),
                   fmt::format("{:.5f}", interaction[mode]), fmt::format("{:.5f}", others)});
        if (mode == 0 && seed == 1 && placement == Placement::tilted) {
          if (figure.series.empty()) {
            app::Series exact{"exact", opening.behind, {}, app::SeriesStyle::lines};
            for (double s : opening.behind)
              exact.y.push_back(2 * solvers::tip_field(material, acting, -s, 1e-15 * s).displacement[1]);
            figure.series.push_back(exact);
          }
          figure.series.push_back({method.name(), opening.behind, opening.computed, app::SeriesStyle::points});
        }
      }
    }
    for (int mode = 0; mode < 3; ++mode) {
      context.say(fmt::format("{}, mode {}, medians (worst): {}", run.name(), mode_names[mode], errors[mode].text()));
      const std::string name = fmt::format("precut_straight_{}_mode_{}", run.name(), mode_names[mode]);
      if (method.judged) {
        errors[mode].check(name, "opening", method.bound(0.015, 0.06), checks);
        errors[mode].check(name, "k_correlation", method.bound(0.02, 0.05), checks);
        errors[mode].check(name, "k_interaction", method.bound(0.02, 0.05), checks);
      } else {
        checks.push_back({name + "_opening_reported", median(errors[mode]["opening"]), ">=", 0});
      }
    }
  }
  table.write(context.out / "runs.csv");
  app::write_png(figure, context.out / "opening.png");
  return checks;
}

} // namespace spherecut::experiments
