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
  if (!context.quick) { // with a notch of 10 mm in its side, which moves the free edge little
    const Outcome outcome = run_text(
        context, std::string(hanging_sheet) +
                     "[[precut]]\nshape = \"rectangle\"\ncentre = [0.05, 0.0, 0.05]\nnormal = [0.0, 0.0, 1.0]\nup = "
                     "[1.0, 0.0, 0.0]\nwidth = 0.1\nheight = 0.02\n[cut]\nlips = \"open\"\n");
    context.say(fmt::format("notched sheet: {} nodes, {:.4g} mm", outcome.nodes, 1e3 * outcome.largest_displacement));
    checks.push_back({"notched_sheet", std::abs(outcome.largest_displacement / plate - 1), "<=", 0.06});
  }
  const std::string refusal = refusal_of(context, std::string(hanging_sheet) + "[nodes]\ncoarse_spacing = 0.01\n");
  checks.push_back({"coarse_wall_refused", refusal.find("three nodes") != std::string::npos ? 1.0 : 0.0, ">=", 1});
  return checks;
}

/// A plate of 2 mm with a crack of 12 mm in its middle, a fifth of its width, whose faces carry a pressure p: it opens
/// by 4 p a / E V(a / b) [Tada, Paris and Irwin 2000], plane stress, whatever the nodes through it.
std::vector<Check> cracked_plate(const ExperimentContext& context) {
  constexpr double a = 0.006, b = 0.03, modulus = 1e6, pressure = 5e3, x = a / b;
  const double factor = -0.071 - 0.535 * x + 0.169 * x * x + 0.020 * x * x * x - 1.071 / x * std::log(1 - x);
  const double exact = 4 * pressure * a / modulus * factor;
  const std::string text = fmt::format(
      "[organ]\nshape = \"block\"\nsize = [{}, 0.002, 0.12]\nedge = 0.004\n[material]\nyoung_modulus = {}\n"
      "poisson_ratio = 0.3\n[[fixed]]\nregion = \"half_space\"\npoint = [0, 0, 0.0005]\nnormal = [0, 0, 1]\n"
      "[[precut]]\nshape = \"rectangle\"\ncentre = [0, 0, 0.06]\nnormal = [0, 0, 1]\nup = [0, 1, 0]\nwidth = {}\n"
      "height = 0.01\npressure = {}\n",
      2 * b, modulus, 2 * a, pressure);
  std::vector<Check> checks;
  if (!context.quick) {
    const Outcome outcome = run_text(context, text);
    const double opening = outcome.last.cut ? outcome.last.cut->opening : 0;
    context.say(fmt::format("cracked plate: {} nodes, opens by {:.4g} mm, by the closed form {:.4g} mm", outcome.nodes,
                            1e3 * opening, 1e3 * exact));
    checks.push_back({"cracked_plate", std::abs(opening / exact - 1), "<=", 0.05});
  }
  const std::string refusal = refusal_of(context, text + "[nodes]\ncoarse_spacing = 0.005\n");
  checks.push_back(
      {"cracked_plate_coarse_refused", refusal.find("three nodes") != std::string::npos ? 1.0 : 0.0, ">=", 1});
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
  for (const auto& group : {thin_sheet(context), cracked_plate(context)})
    checks.insert(checks.end(), group.begin(), group.end());
  return checks;
}

} // namespace spherecut::experiments::real_world
