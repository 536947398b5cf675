// Problem:   random blocks of every law of finite strain, from nu = 0.3 to 0.499, under weight, pre-strain, precuts
// with
//            pressure, a blade and a tool that presses and slides, viscoelastic where no blade cuts.
// Measured:  steps that found no equilibrium, states that are not sound (a force or displacement that is not finite, a
//            volume ratio that is not positive, forces out of balance, faces of a cut that overlap, a tool left in the
//            surface's shares), iterations a step.
// Reference: none is allowed; what a scenario does not go with is refused before the first step.
// Command:   spherecut experiment run tissue_fuzz --out DIR
#include "experiments/experiment.hpp"
#include "experiments/registered.hpp"
#include "src/base/output_file.hpp"
#include "src/model/finite_model.hpp"
#include "src/output/figure.hpp"
#include "src/session/session.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <random>
#include <string>

namespace spherecut::experiments {

namespace {

constexpr int laws = 4;
constexpr const char* law_names[laws] = {"neo_hookean", "yeoh", "ogden", "holzapfel_gasser_ogden"};
constexpr double most_unbalanced = 1e-4, most_overlap = 2e-3; // as runs ask for them; of the node spacing
constexpr double fine = 0.005;                                // m

class Random {
 public:
  explicit Random(int seed) : engine_(static_cast<std::uint64_t>(seed)) {}
  double between(double lower, double upper) {
    return lower + (upper - lower) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  bool chance(double part) { return between(0, 1) < part; }

 private:
  std::mt19937_64 engine_;
};

std::string material(int law, bool may_fade, Random& random) {
  const double modulus = std::pow(10, random.between(3, 5)), mu = modulus / 3;
  std::string text = fmt::format("[material]\nlaw = \"{}\"\npoisson_ratio = {:.6g}\ndensity = 1000\n", law_names[law],
                                 random.chance(0.5) ? random.between(0.3, 0.49) : random.between(0.49, 0.499));
  if (random.chance(0.6)) { // at the same volume
    const double x = random.between(-0.12, 0.15), y = random.between(-0.12, 0.15);
    text += fmt::format("pretension = [{:.6g}, {:.6g}, {:.6g}]\n", x, y, 1 / ((1 + x) * (1 + y)) - 1);
  }
  switch (law) {
  case 0:
    text += fmt::format("young_modulus = {:.6g}\n", modulus);
    break;
  case 1:
    text += fmt::format("c1 = {:.6g}\nc2 = {:.6g}\nc3 = {:.6g}\n", mu / 2, random.between(0, 0.3) * mu,
                        random.between(0, 0.2) * mu);
    break;
  case 2:
    text += fmt::format("[[material.ogden]]\nmodulus = {:.6g}\nexponent = {:.6g}\n", mu * random.between(0.3, 1),
                        random.between(1.5, 4));
    if (random.chance(0.5))
      text += fmt::format("[[material.ogden]]\nmodulus = {:.6g}\nexponent = {:.6g}\n", -mu * random.between(0.05, 0.3),
                          -random.between(1.5, 4));
    break;
  default:
    text += fmt::format("young_modulus = {:.6g}\nfibre_modulus = {:.6g}\nfibre_exponent = {:.6g}\n"
                        "fibre_dispersion = {:.6g}\n",
                        modulus, mu * random.between(0.2, 2), random.between(0.5, 5), random.between(0, 0.3));
    for (int family = random.chance(0.5) ? 1 : 0; family < 2; ++family)
      text += fmt::format("[[material.fibre]]\ndirection = [{:.6g}, {:.6g}, {:.6g}]\n", random.between(-1, 1),
                          random.between(0.1, 1), random.between(-0.3, 0.3));
  }
  if (may_fade && random.chance(0.3))
    text += fmt::format("[[material.prony]]\nshare = {:.6g}\ntime = {:.6g}\n", random.between(0.1, 0.7),
                        random.between(0.1, 5));
  return text;
}

std::string scenario(int seed) {
  Random random(seed);
  const bool cuts = random.chance(0.5), has_precut = random.chance(0.5), presses = !cuts || random.chance(0.6);
  std::string text = fmt::format("[organ]\nshape = \"block\"\nsize = [0.06, 0.05, 0.03]\nedge = 0.006\n{}"
                                 "[nodes]\nfine_spacing = {}\ncoarse_spacing = 0.01\nfine_radius = 0.01\nrandom_seed = "
                                 "{}\n[output]\nfigures = false\n",
                                 material(seed % laws, !cuts, random), fine, seed);
  if (random.chance(0.6))
    text += "[[fixed]]\nregion = \"box\"\nlower = [-1, -1, -0.001]\nupper = [1, 1, 0.001]\n";
  else
    for (const int side : {-1, 1})
      text += fmt::format("[[fixed]]\nregion = \"half_space\"\npoint = [{}, 0, 0]\nnormal = [{}, 0, 0]\n",
                          side * 0.0299, -side);
  if (random.chance(0.5))
    text += "[gravity]\nacceleration = [0, 0, -9.81]\n";
  if (has_precut)
    text += fmt::format("[[precut]]\nshape = \"disc\"\ncentre = [{:.6g}, {:.6g}, {:.6g}]\nnormal = [{:.6g}, {:.6g}, "
                        "1]\nradius = {:.6g}\n",
                        random.between(-0.01, 0.01), random.between(-0.01, 0.01), random.between(0.012, 0.018),
                        random.between(-0.3, 0.3), random.between(-0.3, 0.3), random.between(0.008, 0.011));
  if (cuts) {
    const double x = random.between(-0.02, 0.0), y = random.between(-0.01, 0.01), depth = random.between(0.008, 0.016);
    text += fmt::format("[blade]\nedge = [[0, 0, 0], [0, 0.002, 0.03]]\nstep = 0.1\n[[blade.path]]\ntime = 0\nposition "
                        "= [{0:.6g}, {1:.6g}, 0.032]\n[[blade.path]]\ntime = 0.3\nposition = [{0:.6g}, {1:.6g}, "
                        "{2:.6g}]\n[[blade.path]]\ntime = 1\nposition = [{3:.6g}, {1:.6g}, {2:.6g}]\n",
                        x, y, 0.03 - depth, x + random.between(0.01, 0.02));
  }
  if (presses) {
    const double x = random.between(-0.012, 0.012), y = random.between(-0.01, 0.01),
                 depth = random.between(0.001, 0.006), end = cuts ? 1 : 2, along = random.between(-0.006, 0.006);
    text +=
        fmt::format("[tool]\nshape = \"sphere_tip\"\nradius = 0.01\nstep = 0.1\n[[tool.path]]\ntime = 0\nposition = "
                    "[{0:.6g}, {1:.6g}, 0.0305]\n[[tool.path]]\ntime = {2:.6g}\nposition = [{0:.6g}, {1:.6g}, "
                    "{3:.6g}]\n[[tool.path]]\ntime = {4:.6g}\nposition = [{5:.6g}, {1:.6g}, {3:.6g}]\n",
                    x, y, 0.6 * end, 0.03 - depth, end, x + along);
  }
  return text;
}

struct Tally {
  int runs = 0, refused = 0, steps = 0, cuts = 0, unsolved = 0, unsound = 0;
  std::vector<int> iterations;
  double residual = 0, overlap = 0; // the worst
};

// Why a state is none; empty: it is sound.
std::string fault_of(const app::Session& session, const app::StepResult& step, Tally& tally) {
  if (session.model().finite == nullptr)
    return "";
  if (!step.force.allFinite() || !step.torque.allFinite())
    return "a force that is not finite";
  for (const solvers::PointState& state : session.node_states())
    if (!state.displacement.allFinite() || !state.stress.allFinite())
      return "a displacement or stress that is not finite";
  if (!(step.least_jacobian > 0))
    return fmt::format("a volume ratio of {:g}", step.least_jacobian);
  tally.residual = std::max(tally.residual, step.residual);
  if (!(step.residual <= most_unbalanced))
    return fmt::format("forces out of balance by {:g}", step.residual);
  double overlap = 0;
  for (const double opening : session.model().finite->openings())
    overlap = std::max(overlap, -opening);
  tally.overlap = std::max(tally.overlap, overlap / fine);
  if (overlap > most_overlap * 2 * fine) // spacings grow away from the front to twice that
    return fmt::format("faces that overlap by {:g} m", overlap);
  return "";
}

void run_one(int seed, Tally& tally, const std::function<void(const std::string&)>& note) {
  ++tally.runs;
  const std::string text = scenario(seed);
  std::optional<app::Session> session;
  try {
    session.emplace(app::read_scenario_text("case.toml", text));
  } catch (const InputError& error) {
    ++tally.refused;
    note(fmt::format("seed {}: refused: {}", seed, error.what()));
    return;
  }
  for (const app::StepSample& sample : session->steps()) {
    ++tally.steps;
    try {
      const app::StepResult step = session->step(sample);
      tally.cuts += step.cut && step.cut->triangles > 0 ? 1 : 0;
      tally.iterations.push_back(step.iterations);
      if (const std::string fault = fault_of(*session, step, tally); !fault.empty()) {
        ++tally.unsound;
        note(fmt::format("seed {}, t = {:g} s: {}", seed, sample.time, fault));
      }
    } catch (const NumericalError& error) {
      ++tally.unsolved;
      note(fmt::format("seed {}, t = {:g} s: {}", seed, sample.time, error.what()));
      return;
    }
  }
}

int percentile(std::vector<int> values, double part) {
  if (values.empty())
    return 0;
  std::sort(values.begin(), values.end());
  return values[std::min(values.size() - 1, static_cast<std::size_t>(part * static_cast<double>(values.size())))];
}

} // namespace

std::vector<Check> run_tissue_fuzz(const ExperimentContext& context) {
  const int runs = context.quick ? 8 : 400;
  std::vector<Tally> of_law(laws);
  app::OutputFile notes(context.out / "notes.txt");
  for (int seed = 0; seed < runs; ++seed) {
    run_one(seed, of_law[seed % laws], [&](const std::string& line) { notes.write(line + '\n'); });
    if ((seed + 1) % 100 == 0)
      context.say(fmt::format("{} of {} runs", seed + 1, runs));
  }
  notes.close();
  app::OutputFile table(context.out / "tissue_fuzz.csv");
  table.write("law,runs,refused,steps,increments_of_cuts,unsolved,unsound,median_iterations,p95_iterations,"
              "worst_residual,worst_overlap_spacings\n");
  int unsolved = 0, unsound = 0, refused = 0, steps = 0;
  app::Figure figure{"Random runs at finite strain", "iterations a step", "share of the steps", false, false, {}};
  for (int law = 0; law < laws; ++law) {
    const Tally& tally = of_law[law];
    table.write(fmt::format("{},{},{},{},{},{},{},{},{},{:.3g},{:.3g}\n", law_names[law], tally.runs, tally.refused,
                            tally.steps, tally.cuts, tally.unsolved, tally.unsound, percentile(tally.iterations, 0.5),
                            percentile(tally.iterations, 0.95), tally.residual, tally.overlap));
    app::Series series{law_names[law], {}, {}, app::SeriesStyle::lines};
    std::vector<int> sorted = tally.iterations;
    std::sort(sorted.begin(), sorted.end());
    for (std::size_t k = 0; k < sorted.size(); ++k) {
      series.x.push_back(sorted[k]);
      series.y.push_back(static_cast<double>(k + 1) / static_cast<double>(sorted.size()));
    }
    figure.series.push_back(std::move(series));
    unsolved += tally.unsolved;
    unsound += tally.unsound;
    refused += tally.refused;
    steps += tally.steps;
  }
  table.close();
  app::write_png(figure, context.out / "iterations.png");
  return {{"steps", static_cast<double>(steps), ">=", context.quick ? 50.0 : 5000.0},
          {"steps_without_equilibrium", static_cast<double>(unsolved), "<=", 0},
          {"states_that_are_not_sound", static_cast<double>(unsound), "<=", 0},
          {"scenarios_refused", static_cast<double>(refused) / runs, "<=", 0.05}};
}

} // namespace spherecut::experiments
