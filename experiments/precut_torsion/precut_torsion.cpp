// Problem:   a disc-shaped cut of radius a = 1 m in a cube of 4 m, tilted and shifted against it, and along its axes.
//            Its faces carry what remote torsion about its axis, or remote shear along one direction in its plane,
//            leaves on them. The exact displacement is prescribed on the surface of the cube.
// Reference: K_III = 4 tau sqrt(a / pi) / 3 in torsion [Tada, Paris and Irwin]; K_II = 4 tau cos w sqrt(a / pi) / (2 -
//            nu) and K_III = -4 (1 - nu) tau sin w sqrt(a / pi) / (2 - nu) in shear [Kassir and Sih 1966]. Errors are
//            the largest of any mode along the front, over the largest intensity.
// Command:   spherecut experiment run precut_torsion --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/cut_body.hpp"
#include "experiments/support/front_profile.hpp"
#include "experiments/support/penny_body.hpp"
#include "experiments/support/statistics.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <numbers>

namespace spherecut::experiments {

namespace {

constexpr double pi = std::numbers::pi, shear = 1; // Pa

double angle_of(const CutFrame& crack, const topology::FrontFrame& front) {
  const Vector3 out = front.point - crack.origin;
  return std::atan2(out.dot(crack.tangent), out.dot(crack.ahead));
}

struct ShearCase {
  const char* name;
  std::function<Vector3(const Vector3&)> displacement;     // exact
  std::function<Matrix3(const Vector3&)> stress;           // remote, whose traction the faces lack
  std::function<solvers::Intensities(double angle)> exact; // along the front
};

std::vector<ShearCase> shear_cases(const CutFrame& crack, const solvers::Material& material) {
  const Matrix3 along = shear * (crack.normal * crack.ahead.transpose() + crack.ahead * crack.normal.transpose());
  const double turn = torsion_turn(material, penny_radius, shear, 0);
  return {{"torsion",
           [=](const Vector3& x) {
             return ellipse_jump_displacement(
                 material, crack, penny_radius, penny_radius,
                 [&](double along_ahead, double along_tangent) -> Vector3 {
                   return turn * (along_ahead * crack.tangent - along_tangent * crack.ahead);
                 },
                 x, 40, 24);
           },
           [=](const Vector3& x) -> Matrix3 {
             const Vector3 around = shear / penny_radius * crack.normal.cross(x - crack.origin);
             return crack.normal * around.transpose() + around * crack.normal.transpose();
           },
           [](double) -> solvers::Intensities {
             return {0, 0, torsion_intensity(penny_radius, shear)};
           }},
          {"shear",
           [=](const Vector3& x) { return loaded_penny_displacement(material, crack, penny_radius, along, x); },
           [=](const Vector3&) -> const Matrix3& { return along; },
           [=](double w) { return penny_intensities(material, penny_radius, 0, shear, w); }}};
}

void run_placed(const ExperimentContext& context, Placement placement, app::Table& table, std::vector<Check>& checks) {
  const CutFrame crack = penny_frame(placement);
  const int seeds = context.quick ? 1 : 10;
  const int nodes = context.quick ? 1800 : 5000;
  const PrecutMethod method = precut_methods(true).front();
  const solvers::Material material{1, 0.3, 0};
  std::map<std::string, ErrorSeries> errors;
  for (int seed = 1; seed <= seeds; ++seed) {
    CutBody body = penny_body(nodes, static_cast<std::uint64_t>(seed), material.poisson_ratio, method, placement);
    for (const ShearCase& shear_case : shear_cases(crack, material)) {
      solvers::Problem problem = body.problem;
      hold_whole_surface(problem, shear_case.displacement);
      problem.loads.lip_traction = [&](const Vector3& x, const Vector3& n) -> Vector3 {
        return -shear_case.stress(x) * n;
      };
      const auto discretisation = solvers::discretise(problem, method.options());
      const solvers::Field field = discretisation->solve();
      FrontProfile profile = front_profile(*discretisation, field, 2 * pi * penny_radius / 16.01,
                                           [&](const topology::FrontFrame& front) -> FrontPlace {
                                             const double w = angle_of(crack, front);
                                             return {w, shear_case.exact(w)};
                                           });
      errors[shear_case.name].add("k", profile.integral_error({0, 1, 2}, profile.largest()));
      errors[shear_case.name].add("k_correlation", profile.correlation_error({0, 1, 2}, profile.largest()));
      add_to_table(table, shear_case.name + suffix(placement), seed, problem.nodes.size(), body.fine, profile);
      if (seed == 1 && placement == Placement::tilted)
        app::write_png(front_figure(profile, {0, 1, 2},
                                    fmt::format("Penny crack, {}: intensities along the front", shear_case.name),
                                    "angle around the front / rad"),
                       context.out / fmt::format("{}.png", shear_case.name));
      // The integral over a tube half as long.
      for (std::size_t k = 0; k < profile.frames.size(); ++k)
        profile.integral[k] =
            solvers::interaction_integral(*discretisation, field, profile.frames[k], {.half_length = 1});
      errors[shear_case.name].add("k_short_tube", profile.integral_error({0, 1, 2}, profile.largest()));
    }
  }
  for (const auto& [name, series] : errors) {
    const std::string run_name = name + suffix(placement);
    context.say(fmt::format("{}, {} nodes, medians (worst): {}", run_name, nodes, series.text()));
    series.check("precut_torsion_" + run_name, "k", 0.03, checks);
    for (const char* other : {"k_short_tube", "k_correlation"})
      checks.push_back({fmt::format("precut_torsion_{}_{}_reported", run_name, other), median(series[other]), ">=", 0});
  }
}

} // namespace

std::vector<Check> run_precut_torsion(const ExperimentContext& context) {
  return run_placements(context, run_placed);
}

} // namespace spherecut::experiments
