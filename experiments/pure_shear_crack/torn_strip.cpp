#include "experiments/pure_shear_crack/torn_strip.hpp"

#include "experiments/pure_shear_crack/strip_scenario.hpp"
#include "src/session/session.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

constexpr double height = 0.05, shear = 2000, nu = 0.49; // m, Pa

struct StripLaw {
  std::string name, constants;
  solvers::LawSpec spec;
};

std::vector<StripLaw> strip_laws() {
  const double bulk = solvers::bulk_modulus_of(shear, nu);
  return {{"neo_hookean",
           fmt::format("young_modulus = {}", 2 * (1 + nu) * shear),
           {solvers::NeoHookeanLaw{shear}, bulk, {}}},
          {"yeoh",
           fmt::format("c1 = {}\nc2 = {}\nc3 = {}", 0.5 * shear, 0.1 * shear, 0.01 * shear),
           {solvers::YeohLaw{0.5 * shear, 0.1 * shear, 0.01 * shear}, bulk, {}}}};
}

double wanted_release(const StripLaw& law, double stretch) {
  return strip_release(law.spec, stretch, height);
}

/// Six times as long as high; it tears over half of that, quick over a twelfth.
app::Scenario strip(const StripLaw& law, double stretch, double toughness, std::uint64_t seed, bool quick) {
  const StripScenario scenario{
      .law = law.name,
      .constants = law.constants,
      .poisson_ratio = nu,
      .stretch = stretch,
      .toughness = toughness,
      .height = height,
      .length = 6 * height,
      .thickness = 0.2 * height,
      .crack = 1.5 * height,
      .fine = (quick ? 0.1 : 0.07) * height,
      .coarse = 0.2 * height,
      .seed = seed,
      .tearing =
          fmt::format("step = 1\nmost_increments = 200\nmost_area = {}\n", (quick ? 0.5 : 3) * height * 0.2 * height),
  };
  return app::read_scenario_text("strip.toml", scenario.text());
}

} // namespace

void tear_strips(const std::vector<double>& stretches, std::uint64_t seed, const ExperimentContext& context,
                 ErrorSeries& errors) {
  double onset = 0, way = 0, straightness = 0, given_up = 0, untorn = 0;
  for (const StripLaw& law : strip_laws())
    for (const double stretch : stretches) {
      const double wanted = wanted_release(law, stretch);
      app::Session session(strip(law, stretch, 0.8 * wanted, seed, context.quick));
      const app::StepResult step = session.step(session.steps().front());
      double release = 0, off = 0;
      for (const app::TearIncrement& increment : step.tear->increments) {
        release += increment.release / static_cast<double>(step.tear->increments.size());
        off = std::max(off, std::abs(increment.front.y()) / height);
      }
      const double torn = step.tear->area / session.scenario().tearing.most_area;
      const double first = step.tear->increments.front().release / wanted - 1;
      const double lost = -step.tear->ledger.elastic / (wanted * step.tear->area) - 1;
      context.say(fmt::format("{}, stretch {}, seed {}: torn {:.3g} cm2 in {} increments; G at the start off W H by "
                              "{:.2f} %, on the way by {:.2f} % in the mean; what the strip gives up by {:.2f} %; the "
                              "front {:.2f} % of the height off the middle; {}",
                              law.name, stretch, seed, 1e4 * step.tear->area, step.tear->increments.size() - 1,
                              100 * first, 100 * (release / wanted - 1), 100 * lost, 100 * off, step.tear->reason));
      onset = std::max(onset, std::abs(first));
      way = std::max(way, std::abs(release / wanted - 1));
      given_up = std::max(given_up, std::abs(lost));
      straightness = std::max(straightness, off);
      untorn = std::max(untorn, 1 - torn);
    }
  errors.add("onset", onset);
  errors.add("release_on_the_way", way);
  errors.add("given_up", given_up);
  errors.add("off_the_middle", straightness);
  errors.add("untorn", untorn);
}

int wrong_onsets(const std::vector<double>& stretches, double margin, const ExperimentContext& context) {
  int wrong = 0;
  for (const StripLaw& law : strip_laws())
    for (const double stretch : stretches)
      for (const bool tears : {true, false}) {
        const double toughness = wanted_release(law, stretch) * (tears ? 1 / (1 + margin) : 1 + margin);
        app::Scenario scenario = strip(law, stretch, toughness, 1, context.quick);
        scenario.tearing.most_increments = 1;
        app::Session session(scenario);
        const bool has_torn = session.step(session.steps().front()).tear->area > 0;
        wrong += has_torn != tears ? 1 : 0;
      }
  return wrong;
}

} // namespace spherecut::experiments
