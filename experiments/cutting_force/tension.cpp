#include "experiments/cutting_force/tension.hpp"

#include "solvers/elasticity/homogeneous.hpp"
#include "src/output/figure.hpp"
#include "src/session/session.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

constexpr double modulus = 1e4, nu = 0.3, toughness = 10;                          // Pa; J/m2
constexpr double length = 0.16, thickness = 0.01, height = 0.04, slit_end = -0.02; // m; the strip's middle is at x = 0
constexpr double first_counted = 0.006, last = 0.03; // m, of the cut, that the means are over; where the blade ends

struct TensionLaw {
  std::string name;
  solvers::LawSpec spec;
};

std::vector<TensionLaw> laws() {
  const double shear = modulus / (2 * (1 + nu)), bulk = solvers::bulk_modulus_of(shear, nu);
  return {{"linear", {solvers::LinearLaw{shear}, bulk, {}}},
          {"neo_hookean", {solvers::NeoHookeanLaw{shear}, bulk, {}}}};
}

/// J/m2 of the strip as it is given.
double release_of(const TensionLaw& law, double strain) {
  const Matrix3 gradient = Vector3(1, 1, 1 + strain).asDiagonal();
  double energy = 0;
  Matrix3 stress;
  solvers::make_law(law.spec)->evaluate({&gradient, 1}, {}, {&energy, 1}, {&stress, 1});
  // Of finite strain energies are those of the volume without stress.
  return energy * height / (law.name == "linear" ? 1 : 1 + strain);
}

std::string held_half_space(const Vector3& point, const Vector3& normal, const char* axes) {
  return fmt::format("[[fixed]]\nregion = \"half_space\"\npoint = [{}, {}, {}]\nnormal = [{}, {}, {}]\naxes = [{}]\n",
                     point.x(), point.y(), point.z(), normal.x(), normal.y(), normal.z(), axes);
}

app::Scenario strip(const TensionLaw& law, double strain, double spacing, int seed) {
  const double middle = 0.5 * height + 0.0011; // off planes of the background cells
  std::string text = fmt::format("[organ]\nshape = \"block\"\nsize = [{}, {}, {}]\n[material]\nlaw = \"{}\"\n"
                                 "young_modulus = {}\npoisson_ratio = {}\ntoughness = {}\npretension = [0, 0, {}]\n",
                                 length, thickness, height, law.name, modulus, nu, toughness, strain);
  const double clamp = 1e-6;
  text += held_half_space({0, 0, clamp}, Vector3::UnitZ(), "\"x\", \"y\", \"z\"");
  text += held_half_space({0, 0, height - clamp}, -Vector3::UnitZ(), "\"x\", \"y\", \"z\"");
  for (const int side : {-1, 1})
    text += held_half_space({0, side * (0.5 * thickness - clamp), 0}, -side * Vector3::UnitY(), "\"y\"");
  text +=
      fmt::format("[nodes]\nfine_spacing = {}\ncoarse_spacing = {}\nrandom_seed = {}\n[[precut]]\nshape = "
                  "\"rectangle\"\ncentre = [{}, 0, {}]\nnormal = [0, 0, 1]\nup = [1, 0, 0]\nwidth = {}\nheight = {}\n",
                  spacing, 0.25 * height, seed, -0.5 * length, middle, 3 * thickness, 2 * (slit_end + 0.5 * length));
  text += fmt::format(
      "[blade]\nedge = [[0, {0}, 0], [0, {1}, 0]]\nedge_radius = 0.0001\nstep = 0.05\n[[blade.path]]\ntime = "
      "0\nposition = [{2}, 0, {4}]\n[[blade.path]]\ntime = 1\nposition = [{3}, 0, {4}]\n",
      -0.9 * thickness, 0.9 * thickness, slit_end - 0.002, slit_end + last, middle);
  return app::read_scenario_text("strip.toml", text);
}

/// The blade's work per area of the cut, J/m2, from where the front has left its first place behind.
double paid_in(const TensionLaw& law, double strain, double spacing, int seed) {
  app::Session session(strip(law, strain, spacing, seed));
  double from_work = 0, from_area = 0, work = 0, area = 0;
  for (const app::StepSample& sample : session.steps()) {
    const app::StepResult step = session.step(sample);
    work = step.cut->blade.ledger.work;
    area = step.cut->area;
    if (from_area == 0 && area > thickness * (slit_end + 0.5 * length + first_counted)) {
      from_work = work;
      from_area = area;
    }
  }
  return (work - from_work) / (area - from_area);
}

} // namespace

void cut_under_tension(const ExperimentContext& context, std::vector<Check>& checks) {
  const std::vector<double> shares =
      context.quick ? std::vector<double>{0, 0.5} : std::vector<double>{0, 0.25, 0.5, 0.75, 0.9};
  const int seeds = context.quick ? 1 : 3;
  const double spacing = context.quick ? 0.0035 : 0.0025;
  app::Table table({"law", "strain", "seed", "G_J_m2", "work_J_m2", "wanted_J_m2"});
  app::Figure figure{"Cutting under tension",
                     "what the tension releases / toughness",
                     "work of the blade / toughness",
                     false,
                     false,
                     {}};
  for (const TensionLaw& law : laws()) {
    app::Series series{law.name, {}, {}, app::SeriesStyle::points};
    double worst = 0;
    for (const double share : shares) {
      double low = 0, high = 1; // the strain at which that share of the toughness is released
      for (int k = 0; k < 60; ++k) {
        const double strain = 0.5 * (low + high);
        (release_of(law, strain) < share * toughness ? low : high) = strain;
      }
      const double strain = share > 0 ? 0.5 * (low + high) : 0, release = release_of(law, strain);
      std::vector<double> paid;
      for (int seed = 1; seed <= seeds; ++seed) {
        paid.push_back(paid_in(law, strain, spacing, seed));
        table.add({law.name, fmt::format("{:.4f}", strain), fmt::format("{}", seed), fmt::format("{:.4f}", release),
                   fmt::format("{:.4f}", paid.back()), fmt::format("{:.4f}", toughness - release)});
        worst = std::max(worst, std::abs(paid.back() - (toughness - release)) / toughness);
        series.x.push_back(release / toughness);
        series.y.push_back(paid.back() / toughness);
      }
      context.say(
          fmt::format("{}, strain {:.3f}: the tension releases {:.2f} J/m2, the blade's work is {:.3f} to {:.3f} "
                      "J/m2 ({:.3f} wanted)",
                      law.name, strain, release, *std::min_element(paid.begin(), paid.end()),
                      *std::max_element(paid.begin(), paid.end()), toughness - release));
    }
    checks.push_back({"cutting_force_under_tension_" + law.name, worst, "<=", 0.03}); // of the toughness
    figure.series.push_back(series);
  }
  figure.series.push_back({"toughness less what is released", {0, 1}, {1, 0}, app::SeriesStyle::lines});
  table.write(context.out / "tension.csv");
  app::write_png(figure, context.out / "tension.png");
}

} // namespace spherecut::experiments
