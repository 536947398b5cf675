// Cuts in scenarios that say nothing of nodes: the volume of their opening and the intensities at their fronts.
#include "experiments/analytic/cracks.hpp"
#include "experiments/real_world/situations.hpp"
#include "solvers/fracture/tearing.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments::real_world {

namespace {

constexpr double modulus = 1e4, poisson_ratio = 0.3; // Pa
const solvers::Material material{modulus, poisson_ratio, 0};

/// What a scenario gives with the nodes that it derives.
struct Found {
  int nodes = 0;
  double volume = 0;               // m3
  std::vector<double> intensities; // Pa sqrt(m), sizes of those of one mode along the fronts
};

Found found(const ExperimentContext& context, const std::string& text, int seed, int mode) {
  app::Session session(
      app::read_scenario_text(context.out / "case.toml", text + fmt::format("[nodes]\nrandom_seed = {}\n", seed)),
      [](const std::string&) {});
  Found result;
  for (const app::StepSample& sample : session.steps())
    result.volume = session.step(sample).cut->opening_volume;
  result.nodes = session.model().sprinkling.nodes.size();
  for (const solvers::FrontState& state : solvers::front_states(
           *session.model().body, session.model().field, [](const Vector3&) { return 1.0; },
           2 * session.zone().spacing.fine))
    result.intensities.push_back(std::abs(state.intensities[mode]));
  return result;
}

double worst_of(const std::vector<double>& values, double exact) {
  double worst = 0;
  for (const double value : values)
    worst = std::max(worst, std::abs(value / exact - 1));
  return worst;
}

double mean_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values)
    sum += value;
  return sum / static_cast<double>(values.size());
}

std::string block(const Vector3& size) {
  return fmt::format("[organ]\nshape = \"block\"\nsize = [{}, {}, {}]\n[material]\nyoung_modulus = {}\n"
                     "poisson_ratio = {}\n",
                     size.x(), size.y(), size.z(), modulus, poisson_ratio);
}

std::string held(const Vector3& point, const Vector3& normal, const std::string& axes) {
  return fmt::format("[[fixed]]\nregion = \"half_space\"\npoint = [{}, {}, {}]\nnormal = [{}, {}, {}]\naxes = {}\n",
                     point.x(), point.y(), point.z(), normal.x(), normal.y(), normal.z(), axes);
}

/// Discs of 10 mm radius under pressure, 100 mm from one another in a block of ten radii about each, tilted against it:
/// Sneddon's, with the surface so far away that it adds half a per cent.
void discs(const ExperimentContext& context, int count, std::vector<Check>& checks) {
  constexpr double radius = 0.01, side = 0.1, pressure = 100;
  std::string text = block({count * side, side, side}) + held({0, 0, 1e-4}, {0, 0, 1}, R"(["x", "y", "z"])");
  for (int k = 0; k < count; ++k)
    text += fmt::format("[[precut]]\nshape = \"disc\"\ncentre = [{}, 0.001, 0.052]\nnormal = [{}, {}, 1]\nradius = {}\n"
                        "pressure = {}\n",
                        (k - 0.5 * (count - 1)) * side + 0.002, 0.2 - 0.3 * k, 0.1 + 0.2 * k, radius, pressure);
  const double intensity = 2 * pressure * std::sqrt(radius / std::numbers::pi);
  double volume = 0, worst = 0;
  for (int seed = 1; seed <= (context.quick ? 1 : 3); ++seed) {
    const Found here = found(context, text, seed, 0);
    const double off = here.volume / (count * penny_opening_volume(material, radius, pressure)) - 1;
    volume = std::max(volume, std::abs(off));
    worst = std::max(worst, worst_of(here.intensities, intensity));
    context.say(fmt::format("{} disc(s), set {}: {} nodes, opening volume {:.2f} % off, K_I {:.2f} % off in the mean, "
                            "{:.2f} % at the worst of {} places",
                            count, seed, here.nodes, 100 * off, 100 * (mean_of(here.intensities) / intensity - 1),
                            100 * worst_of(here.intensities, intensity), here.intensities.size()));
  }
  const std::string name = fmt::format("default_{}_disc", count);
  checks.push_back({name + "_volume", volume, "<=", 0.02});
  checks.push_back({name + "_intensity", worst, "<=", 0.03});
}

/// A strip of width W with a crack of depth b from its side, sheared along the crack's front by what its tissue is
/// pretensioned by, held at its ends a height H apart: K_III = tau (2 W tan(pi b / 2 W))^(1/2) [Tada, Paris and Irwin
/// 2000], tau less than that of the whole strip by the crack's compliance, (4 W / pi) ln(1 / cos(pi b / 2 W)) of
/// height.
void antiplane_edge(const ExperimentContext& context, std::vector<Check>& checks) {
  constexpr double width = 0.06, height = 0.12, strain = 0.01, beyond = 0.005, above = 0.0613;
  double worst = 0;
  for (const auto& [depth, thickness] : context.quick
                                            ? std::vector<std::array<double, 2>>{{0.02, 0.02}}
                                            : std::vector<std::array<double, 2>>{{0.02, 0.02}, {0.01, 0.04}}) {
    const double reach = depth + beyond, half = 0.5 * thickness, angle = 0.5 * std::numbers::pi * depth / width;
    const std::string text =
        block({width, thickness, height}) + fmt::format("pretension = [0, 0, 0, {}, 0, 0]\n", strain) +
        "[cut]\nlips = \"open\"\n" + held({0, 0, 1e-5}, {0, 0, 1}, R"(["x", "y", "z"])") +
        held({0, 0, height - 1e-5}, {0, 0, -1}, R"(["x", "y", "z"])") +
        held({0, 1e-5 - half, 0}, {0, 1, 0}, R"(["x", "z"])") + held({0, half - 1e-5, 0}, {0, -1, 0}, R"(["x", "z"])") +
        fmt::format("[[precut]]\nshape = \"rectangle\"\ncentre = [{}, 0, {}]\nnormal = [0, 0, 1]\nup = [1, 0, 0]\n"
                    "width = {}\nheight = {}\n",
                    0.5 * reach - 0.5 * width - beyond, above, thickness + 2 * beyond, reach);
    const double given_way = -4 * width / std::numbers::pi * std::log(std::cos(angle));
    const double stress = 2 * material.shear_modulus() * strain * height / (height + given_way);
    const double exact = stress * std::sqrt(2 * width * std::tan(angle));
    for (int seed = 1; seed <= (context.quick ? 1 : 5); ++seed) {
      const Found here = found(context, text, seed, 2);
      const double off = mean_of(here.intensities) / exact - 1;
      worst = std::max(worst, std::abs(off));
      context.say(
          fmt::format("edge of {} mm in {} mm, set {}: {} nodes, K_III {:.2f} % off in the mean, {:.2f} % at the "
                      "worst of {} places",
                      1e3 * depth, 1e3 * thickness, seed, here.nodes, 100 * off,
                      100 * worst_of(here.intensities, exact), here.intensities.size()));
    }
  }
  checks.push_back({"default_antiplane_edge", worst, "<=", 0.03});
}

} // namespace

std::vector<Check> default_cracks(const ExperimentContext& context) {
  std::vector<Check> checks;
  discs(context, 1, checks);
  if (!context.quick)
    discs(context, 2, checks);
  antiplane_edge(context, checks);
  return checks;
}

} // namespace spherecut::experiments::real_world
