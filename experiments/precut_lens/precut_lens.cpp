// Problem:   a cut along a spherical cap, half angle 45 degrees, whose rim has the radius a = 1 m, in a cube of 10 m,
//            tilted and shifted against it, and along its axes. Its faces carry the pressure p that remote hydrostatic
//            tension p leaves on them; the surface of the cube is held.
// Reference: axisymmetric elements, K_I = 0.889 and K_II = -0.244 times 2 p sqrt(a / pi) all along the front at nu =
//            0.22, with the + side outside. In print are 0.877 and 0.235 [Martynenko and Ulitko 1979; code_aster
//            V3.04.155]: their distance is reported. Errors are the largest along the front, each mode over its own.
// Command:   spherecut experiment run precut_lens --out DIR
#include "experiments/analytic/cracks.hpp"
#include "experiments/reference/lens.hpp"
#include "experiments/registered.hpp"
#include "experiments/support/front_profile.hpp"
#include "experiments/support/pressed_crack.hpp"
#include "experiments/support/statistics.hpp"

#include "topology/incision/cut_sheets.hpp"

#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

constexpr double pi = std::numbers::pi, sphere = std::numbers::sqrt2, half_angle = pi / 4; // m, rad
constexpr double pressure = 1, half_size = 5;                                              // Pa, m

/// The rim lies in the plane of the frame, about its origin; the + side is the outer one.
topology::SurfaceMesh cap_sheet(const CutFrame& crack, double edge) {
  topology::SurfaceMesh sheet = topology::make_disc_sheet(Vector3::Zero(), Vector3::UnitZ(), sphere * half_angle, edge);
  for (Vector3& x : sheet.vertices) {
    const double r = std::hypot(x[0], x[1]), angle = r / sphere, share = r > 0 ? sphere * std::sin(angle) / r : 0;
    x = crack.origin + crack.global({share * x[0], sphere * (std::cos(angle) - std::cos(half_angle)), share * x[1]});
  }
  return sheet;
}

void run_placed(const ExperimentContext& context, Placement placement, app::Table& table, std::vector<Check>& checks) {
  const CutFrame crack = placed_frame(placement, {0.03, -0.05, 0.04}, {0.22, -0.17, 0.1});
  const std::string name = "precut_lens" + suffix(placement);
  const int seeds = context.quick ? 1 : 10;
  const double spacing = context.quick ? 0.16 : 0.06; // m, at the front
  const PrecutMethod method = precut_methods(true).front();
  const solvers::Material material{1, 0.22, 0};
  const solvers::Intensities exact = pressure * lens_by_elements(material, half_angle, 20);
  const solvers::Intensities printed = lens_intensities(sphere, pressure);
  const Vector3 corner(half_size, half_size, half_size);
  PressedCrack pressed;
  pressed.domain = topology::make_box_domain(-corner, corner, 1);
  pressed.sheet = cap_sheet(crack, spacing / 3);
  pressed.fine = spacing;
  pressed.coarse = 15;
  pressed.material = material;
  pressed.pressure = pressure;
  pressed.at_surface = [](const Vector3&) -> Vector3 { return Vector3::Zero(); };
  ErrorSeries errors;
  for (int seed = 1; seed <= seeds; ++seed) {
    solvers::Problem problem = pressed_crack(pressed, seed, method);
    const int nodes = problem.nodes.size();
    const auto discretisation = solvers::discretise(std::move(problem), method.options());
    const FrontProfile profile = front_profile(*discretisation, discretisation->solve(), 2 * pi / 16.01,
                                               [&](const topology::FrontFrame& front) -> FrontPlace {
                                                 const Vector3 at = crack.local(front.point);
                                                 return {std::atan2(at[2], at[0]), exact};
                                               });
    errors.add("k_1", profile.integral_error({0}, exact[0]));
    errors.add("k_2", profile.integral_error({1}, -exact[1]));
    errors.add("k_3", profile.integral_error({2}, exact[0])); // over K_I: it is none
    errors.add("k_1_correlation", profile.correlation_error({0}, exact[0]));
    errors.add("k_2_correlation", profile.correlation_error({1}, -exact[1]));
    add_to_table(table, "lens" + suffix(placement), seed, nodes, spacing, profile);
    context.say(
        fmt::format("seed {}, {} nodes: K_I off by {:.2f} %, K_II by {:.2f} % (by correlation {:.2f}, {:.2f} %)", seed,
                    nodes, 100 * errors["k_1"].back(), 100 * errors["k_2"].back(),
                    100 * errors["k_1_correlation"].back(), 100 * errors["k_2_correlation"].back()));
    if (seed == 1 && placement == Placement::tilted)
      app::write_png(front_figure(profile, {0, 1, 2},
                                  "Spherical cap under hydrostatic tension: intensities along the front",
                                  "angle around the front / rad"),
                     context.out / "lens.png");
  }
  const Eigen::Vector2d apart = exact.head<2>().cwiseQuotient(printed.head<2>());
  context.say(fmt::format("elements over print: K_I {:.4f}, K_II {:.4f}", apart[0], apart[1]));
  context.say(fmt::format("{}, medians (worst): {}", name, errors.text()));
  // The quick variant's nodes see the sheet bend within the tube of the integral: K_II is off by a fifth.
  errors.check(name, "k_1", context.quick ? 0.05 : 0.03, checks);
  errors.check(name, "k_2", context.quick ? 0.3 : 0.03, checks);
  errors.check(name, "k_3", context.quick ? 0.05 : 0.03, checks);
  for (const char* mode : {"k_1_correlation", "k_2_correlation"})
    checks.push_back({fmt::format("{}_{}_reported", name, mode), median(errors[mode]), ">=", 0});
  checks.push_back({name + "_k_1_of_print_reported", std::abs(apart[0] - 1), ">=", 0});
  checks.push_back({name + "_k_2_of_print_reported", std::abs(apart[1] - 1), ">=", 0});
}

} // namespace

std::vector<Check> run_precut_lens(const ExperimentContext& context) {
  return run_placements(context, run_placed);
}

} // namespace spherecut::experiments
