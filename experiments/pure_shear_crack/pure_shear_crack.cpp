// Problem:   a strip 5 H long and H wide between clamps, 0.4 H thick with free sides, of which one half stands on a
//            plane of symmetry; a crack along its middle from one end over 2 H. The clamps move apart, by
//            stretches of 1.05 to 1.8; neo-Hookean and Yeoh, nu = 0.49. Then the crack of a strip that is given as
//            stretched tears on, in a run of the program.
// Reference: G = W H, W the energy of the strip far ahead of the crack, in pure shear between its clamps, from the law
//            [Rivlin and Thomas 1953]: as the crack grows, strip as it is ahead becomes strip as it is behind, free of
//            strain.
// Command:   spherecut experiment run pure_shear_crack --out DIR
#include "experiments/pure_shear_crack/torn_strip.hpp"
#include "experiments/registered.hpp"
#include "experiments/support/finite_block.hpp"
#include "experiments/support/precut_series.hpp"
#include "experiments/support/statistics.hpp"

#include "solvers/elasticity/homogeneous.hpp"
#include "solvers/release/energy_release.hpp"
#include "src/output/figure.hpp"
#include "topology/incision/cut_sheets.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

constexpr double strip_height = 1, strip_behind = 2, strip_ahead = 3, strip_half_depth = 0.2; // m

struct TornLaw {
  std::string name, label;
  solvers::LawSpec spec;
};

/// The strip with its crack up to x = tip.
FiniteBlock torn_strip(double fine, double tip, std::uint64_t seed) {
  FiniteBlock block{.lower = {-strip_behind, -0.5 * strip_height, 0},
                    .upper = {strip_ahead, 0.5 * strip_height, strip_half_depth},
                    .spacing = 0.1,
                    .seed = seed};
  // The clamps; the plane of symmetry; the far end, which stays in pure shear as it slides along itself.
  block.held[2] = block.held[3] = {true, true, false};
  block.held[4][2] = true;
  block.held[1][0] = true;
  const double from = -strip_behind - 0.5;
  block.cuts = {topology::make_rectangle_sheet({0.5 * (from + tip), 0, 0.5 * strip_half_depth}, Vector3::UnitY(),
                                               Vector3::UnitX(), 1, tip - from, fine)};
  solvers::SpacingField spacing;
  spacing.fine = fine;
  spacing.coarse = std::max(0.16, fine);
  spacing.segments = {{Vector3(tip, 0, 0), Vector3(tip, 0, strip_half_depth)}};
  block.graded = spacing;
  return block;
}

double pure_shear_energy(const TornLaw& given, const solvers::Law& law, double stretch) {
  const Matrix3 gradient = solvers::homogeneous::pure_shear(given.spec, stretch).gradient;
  // pure_shear() stretches along x and holds y; the strip's clamps lie along x.
  Matrix3 turned = Matrix3::Zero();
  turned.diagonal() = Vector3(gradient(1, 1), gradient(0, 0), gradient(2, 2));
  double energy = 0;
  Matrix3 stress;
  law.evaluate({&turned, 1}, {}, {&energy, 1}, {&stress, 1});
  return energy;
}

} // namespace

std::vector<Check> run_pure_shear_crack(const ExperimentContext& context) {
  const double nu = 0.49, fine = context.quick ? 0.1 : 0.05;
  const int seeds = context.quick ? 1 : 10;
  const std::vector<double> stretches = context.quick
                                            ? std::vector<double>{1.05, 1.2}
                                            : std::vector<double>{1.05, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6, 1.7, 1.8};
  const std::vector<TornLaw> laws = {
      {"neo_hookean", "neo-Hookean", {solvers::NeoHookeanLaw{1}, solvers::bulk_modulus_of(1, nu), {}}},
      {"yeoh", "Yeoh", {solvers::YeohLaw{0.5, 0.1, 0.01}, solvers::bulk_modulus_of(1, nu), {}}}};
  // Radii between which the shift fades, in spacings at the front; the first is the default.
  const std::vector<std::array<double, 2>> tubes = {{1, 4}, {1, 3}, {2, 5}};
  std::vector<Check> checks;
  app::Table table({"sight", "law", "seed", "nodes", "stretch", "energy_times_height", "release", "release_of_points",
                    "release_narrow", "release_wide", "far_energy_error", "iterations", "least_jacobian"});
  app::Figure figure{"A crack in a strip in pure shear", "stretch", "G / (mu H)", false, false, {}};
  const std::array rules{solvers::SightRule::enriched, solvers::SightRule::appended};
  for (const solvers::SightRule rule : rules)
    for (const TornLaw& given : laws) {
      const bool is_default = rule == rules.front();
      const std::shared_ptr<const solvers::Law> law = solvers::make_law(given.spec);
      ErrorSeries errors;
      app::Series exact{given.label + ", W H", {}, {}, app::SeriesStyle::lines};
      app::Series found{
          fmt::format("{}, {}, integral", given.label, to_string(rule)), {}, {}, app::SeriesStyle::points};
      for (int seed = 1; seed <= seeds; ++seed) {
        FiniteBlock block = torn_strip(fine, 0, seed);
        block.lips_apart = rule == solvers::SightRule::appended;
        const solvers::FiniteBody body(finite_block(block), law, {.sight = rule});
        solvers::EquilibriumOptions accurate;
        accurate.tolerance = 1e-4;
        solvers::Equilibrium equilibrium(body, accurate);
        double worst = 0, worst_of_points = 0, apart = 0, far = 0;
        for (const double stretch : stretches) {
          const auto status = equilibrium.solve(
              {body.prescribed_values([&](const Vector3& x) { return Vector3(0, (stretch - 1) * x.y(), 0); }), 1, {}});
          const VectorX& u = equilibrium.coefficients();
          const double energy = pure_shear_energy(given, *law, stretch), wanted = energy * strip_height;
          const solvers::EnergyMomentum momentum(body, u);
          std::vector<double> released;
          solvers::ReleaseOptions options;
          options.half_length.reset();
          for (const auto& [inner, outer] : tubes) {
            options.inner = inner;
            options.outer = outer;
            released.push_back(momentum.mean(options).rate);
          }
          options = {};
          options.half_length.reset();
          options.pressure = solvers::ReleasePressure::points;
          const double of_points = momentum.mean(options).rate;
          const double far_error =
              std::abs(body.at({strip_ahead - 0.1, 0.2 * strip_height, 0.5 * strip_half_depth}, u).energy / energy - 1);
          worst = std::max(worst, std::abs(released[0] / wanted - 1));
          worst_of_points = std::max(worst_of_points, std::abs(of_points / wanted - 1));
          const auto [least, most] = std::minmax_element(released.begin(), released.end());
          apart = std::max(apart, (*most - *least) / wanted);
          far = std::max(far, far_error);
          table.add({std::string(to_string(rule)), given.name, fmt::format("{}", seed), fmt::format("{}", body.size()),
                     fmt::format("{}", stretch), fmt::format("{:.6g}", wanted), fmt::format("{:.6g}", released[0]),
                     fmt::format("{:.6g}", of_points), fmt::format("{:.6g}", released[1]),
                     fmt::format("{:.6g}", released[2]), fmt::format("{:.1e}", far_error),
                     fmt::format("{}", status.iterations), fmt::format("{:.3f}", status.least_jacobian)});
          context.say(
              fmt::format("{}, {}, seed {}, {} nodes, stretch {}: G off by {:.2f} % (pressure of points {:.2f} %), "
                          "{} iterations, least J {:.3f}",
                          to_string(rule), given.label, seed, body.size(), stretch, 100 * (released[0] / wanted - 1),
                          100 * (of_points / wanted - 1), status.iterations, status.least_jacobian));
          if (seed == 1) {
            exact.x.push_back(stretch);
            exact.y.push_back(wanted);
            found.x.push_back(stretch);
            found.y.push_back(released[0]);
          }
        }
        errors.add("release", worst);
        errors.add("release_of_points", worst_of_points);
        errors.add("tubes", apart);
        errors.add("far_energy", far);
      }
      if (is_default)
        figure.series.push_back(exact);
      figure.series.push_back(found);
      context.say(fmt::format("{}, {}: worst over the stretches, median of the node sets (worst): {}", to_string(rule),
                              given.label, errors.text()));
      const std::string name =
          "pure_shear_crack_" + given.name + (is_default ? "" : fmt::format("_{}", to_string(rule)));
      errors.check(name, "release", 0.03, checks);
      errors.check(name, "tubes", 0.02, checks);
      errors.check(name, "far_energy", 0.005, checks);
      checks.push_back({name + "_release_of_points_reported", median(errors["release_of_points"]), ">=", 0});
    }
  const std::vector<double> torn = context.quick ? std::vector<double>{1.3} : std::vector<double>{1.1, 1.3, 1.5};
  ErrorSeries tears;
  for (int seed = 1; seed <= (context.quick ? 1 : 3); ++seed)
    tear_strips(torn, static_cast<std::uint64_t>(seed), context, tears);
  context.say(
      fmt::format("torn strips, worst over laws and stretches, median of the node sets (worst): {}", tears.text()));
  tears.check("pure_shear_tear", "onset", 0.05, checks);
  tears.check("pure_shear_tear", "release_on_the_way", 0.05, checks);
  tears.check("pure_shear_tear", "given_up", 0.05, checks);
  tears.check("pure_shear_tear", "off_the_middle", 0.07, checks); // a spacing of the nodes
  tears.check("pure_shear_tear", "untorn", 0.05, checks);
  checks.push_back({"pure_shear_tear_wrong_onsets", static_cast<double>(wrong_onsets(torn, 0.05, context)), "<=", 0});
  table.write(context.out / "releases.csv");
  app::write_png(figure, context.out / "releases.png");
  return checks;
}

} // namespace spherecut::experiments
