#include "experiments/real_world/situations.hpp"

#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments::real_world {

namespace {

/// A column that does not widen (nu = 0) under its own weight: its top sinks by rho g L^2 / (2 E).
Check weight_alone(const ExperimentContext& context) {
  constexpr double height = 0.05, modulus = 5000, density = 1000, gravity = 9.81;
  const std::string text = fmt::format(
      "[organ]\nshape = \"block\"\nsize = [0.02, 0.02, {}]\n[material]\nyoung_modulus = {}\npoisson_ratio = 0.0\n"
      "density = {}\n[gravity]\nacceleration = [0, 0, -{}]\n[nodes]\ncoarse_spacing = 0.005\n"
      "[[fixed]]\nregion = \"half_space\"\npoint = [0, 0, 1e-4]\nnormal = [0, 0, 1]\naxes = [\"z\"]\n"
      "[[fixed]]\nregion = \"half_space\"\npoint = [-0.0099, 0, 0]\nnormal = [1, 0, 0]\naxes = [\"x\"]\n"
      "[[fixed]]\nregion = \"half_space\"\npoint = [0, -0.0099, 0]\nnormal = [0, 1, 0]\naxes = [\"y\"]\n",
      height, modulus, density, gravity);
  const double exact = density * gravity * height * height / (2 * modulus);
  return {"weight_alone", std::abs(run_text(context, text).largest_displacement / exact - 1), "<=", 0.03};
}

constexpr const char* hanging_sheet = R"([organ]
shape = "block"
size = [0.10, 0.003, 0.10]
edge = 0.004
[material]
young_modulus = 1e7
poisson_ratio = 0.3
density = 1000.0
[[fixed]]
region = "half_space"
point = [0.0, 0.0, 0.0995]
normal = [0.0, 0.0, -1.0]
[gravity]
acceleration = [0.0, -3.0, -10.0]
)";

/// A sheet of 3 mm that hangs by its upper edge, on nodes that nobody has chosen: the free edge of a plate under its
/// own weight across moves by q L^4 / (8 D), D = E t^3 / (12 (1 - nu^2)); clamped so wide it does not narrow.
std::vector<Check> thin_sheet(const ExperimentContext& context) {
  constexpr double plate = 4.55e-3; // m, of the notched sheet's whole plate, from plate theory
  std::vector<Check> checks;
  if (!context.quick) {
    const Outcome outcome = run_text(context, hanging_sheet);
    context.say(fmt::format("sheet: {} nodes, {:.4g} mm", outcome.nodes, 1e3 * outcome.largest_displacement));
    checks.push_back({"thin_sheet", std::abs(outcome.largest_displacement / plate - 1), "<=", 0.06});
  }
  const std::string refusal = refusal_of(context, std::string(hanging_sheet) + "[nodes]\ncoarse_spacing = 0.01\n");
  checks.push_back({"coarse_wall_refused", refusal.find("three nodes") != std::string::npos ? 1.0 : 0.0, ">=", 1});
  return checks;
}

/// One cut, by sheets that reach out of the body by more and more: the same nodes.
Check reach_of_sheet(const ExperimentContext& context) {
  double most = 0, least = 1e9;
  for (const double reach : {0.01, 0.1, 1.0}) {
    const std::string text = fmt::format(
        "[organ]\nshape = \"block\"\nsize = [0.06, 0.04, 0.04]\n[material]\nyoung_modulus = 5000\npoisson_ratio = 0.4\n"
        "[[fixed]]\nregion = \"half_space\"\npoint = [0, 0, 1e-4]\nnormal = [0, 0, 1]\n[[precut]]\nshape = "
        "\"rectangle\"\n"
        "centre = [0, 0, {}]\nnormal = [1, 0, 0]\nup = [0, 0, 1]\nwidth = {}\nheight = {}\n",
        0.02 + 0.5 * (0.02 + reach), 0.04 + 2 * reach, 0.02 + reach);
    const int nodes = run_text(context, text).nodes;
    most = std::max<double>(most, nodes);
    least = std::min<double>(least, nodes);
  }
  context.say(fmt::format("one cut by three sheets: {:.0f} to {:.0f} nodes", least, most));
  return {"reach_of_sheet", most - least, "<=", 0};
}

} // namespace

std::vector<Check> organ_bodies(const ExperimentContext& context) {
  std::vector<Check> checks{weight_alone(context), reach_of_sheet(context)};
  for (Check& check : thin_sheet(context))
    checks.push_back(std::move(check));
  return checks;
}

} // namespace spherecut::experiments::real_world
