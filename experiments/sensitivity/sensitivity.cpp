// Problem:   the numbers that measurements have fixed, each at half and at twice its value: a smooth field in a cube of
//            729 nodes, and a block of about 350 nodes with a straight crack in mode I and II.
// Reference: the manufactured field; the field at the front of a crack [Williams 1957].
// Command:   spherecut experiment run sensitivity --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/cube.hpp"
#include "experiments/support/statistics.hpp"
#include "experiments/support/straight_crack.hpp"

#include "solvers/collocation/body.hpp"
#include "solvers/fracture/stress_intensity.hpp"
#include "src/output/figure.hpp"
#include "topology/base/errors.hpp"

#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::experiments {

namespace {

using solvers::Method;

/// Everything that a row may change.
struct Numbers {
  solvers::Tuning tuning;
  solvers::DiscretisationOptions how;
  solvers::InteractionOptions tube;
};

/// Infinite where the number does not make a body.
using Measure = double (*)(const Numbers&, double poisson_ratio, int seed);

constexpr double unusable = std::numeric_limits<double>::infinity();

/// Relative L2 error of a smooth field.
double smooth_error(const Numbers& numbers, double poisson_ratio, int seed) {
  const ManufacturedField field = smooth_field({1, poisson_ratio, 0});
  solvers::Problem problem = cube_problem(field, 8, 0.25, static_cast<std::uint64_t>(seed));
  problem.tuning = numbers.tuning;
  const auto body = solvers::discretise(std::move(problem), numbers.how);
  return displacement_error(*body, body->solve(), field);
}

/// The crack opened in modes I and II: what `of_mode` makes of each, the larger.
template <class OfMode>
double crack_error(const Numbers& numbers, double poisson_ratio, int seed, const OfMode& of_mode) {
  const CutFrame& crack = straight_crack_frame();
  CutBody body = straight_crack_body(static_cast<std::uint64_t>(seed), 0.3, numbers.how.method);
  body.problem.material.poisson_ratio = poisson_ratio;
  body.problem.tuning = numbers.tuning;
  const solvers::Material material = body.problem.material;
  solvers::Intensities acting = Vector3::Zero();
  hold_whole_surface(body.problem, [&acting, &crack, material](const Vector3& x) {
    return straight_crack_displacement(material, crack, acting, x);
  });
  const auto discretisation = solvers::discretise(body.problem, numbers.how);
  double error = 0;
  for (const int mode : {0, 1}) {
    acting = Vector3::Unit(mode);
    error = std::max(error, of_mode(*discretisation, discretisation->solve(), body.fine, mode));
  }
  return error;
}

/// Of the opening behind the front.
double opening_error(const Numbers& numbers, double poisson_ratio, int seed) {
  return crack_error(
      numbers, poisson_ratio, seed,
      [](const solvers::Discretisation& body, const solvers::Field& field, double spacing, int mode) {
        const CutFrame& crack = straight_crack_frame();
        const int component = mode == 0 ? 1 : 0; // in the axes (ahead, normal, tangent)
        double error = 0, size = 0;
        for (int i = 0; i < 60; ++i)
          for (int j = 0; j < 5; ++j) {
            const double s = 0.8 * std::pow((i + 0.5) / 60, 2), along = 0.8 * (j + 0.5) / 5 - 0.4;
            const Vector3 x = crack.origin - s * crack.ahead + along * crack.tangent;
            const Vector3 jump = opening_at(body, field, x, crack.normal, spacing);
            const double exact =
                2 *
                solvers::tip_field(body.problem().material, Vector3::Unit(mode), -s, 1e-15 * s).displacement[component];
            error += std::pow(crack.local(crack.origin + jump)[component] - exact, 2);
            size += exact * exact;
          }
        return std::sqrt(error / size);
      });
}

/// Of the stress intensity, by the interaction integral, in the mean of three places.
double intensity_error(const Numbers& numbers, double poisson_ratio, int seed) {
  return crack_error(
      numbers, poisson_ratio, seed,
      [&numbers](const solvers::Discretisation& body, const solvers::Field& field, double /*spacing*/, int mode) {
        double mean = 0;
        const auto fronts = solvers::front_samples(*body.problem().incision, 0.2, 0.25);
        for (const topology::FrontFrame& front : fronts)
          mean += solvers::interaction_integral(body, field, front, numbers.tube)[mode] /
                  static_cast<double>(fronts.size());
        return std::abs(mean - 1);
      });
}

/// On which side of a number a body takes longer: less error there is no reason to go there, and is not judged.
enum class Dear { neither, half, twice };

struct Row {
  const char* name;
  Method method;
  double poisson_ratio;
  Measure measure;
  const char* measured;
  double& (*number)(Numbers&);
  Dear dear = Dear::neither;
};

constexpr double worst_over_best = 1.5;

// One line a number. Captureless, so that a row is plain data.
const std::vector<Row>& rows() {
  using N = Numbers;
  constexpr Method galerkin = Method::galerkin, collocation = Method::collocation;
  static const std::vector<Row> all = {
      {"sphere_radius", galerkin, 0.3, smooth_error, "smooth field",
       [](N& n) -> double& { return n.tuning.sphere_radius; }, Dear::twice},
      {"sphere_radius_cut", galerkin, 0.3, opening_error, "opening",
       [](N& n) -> double& { return n.tuning.sphere_radius_cut; }, Dear::twice},
      {"sphere_radius_soft", galerkin, 0.49, smooth_error, "smooth field",
       [](N& n) -> double& { return n.tuning.sphere_radius_soft; }, Dear::twice},
      {"cell_size", galerkin, 0.3, smooth_error, "smooth field", [](N& n) -> double& { return n.how.cell_size; },
       Dear::half},
      {"holding", galerkin, 0.3, smooth_error, "smooth field", [](N& n) -> double& { return n.tuning.holding; }},
      {"front_reach", galerkin, 0.3, opening_error, "opening", [](N& n) -> double& { return n.tuning.front_reach; },
       Dear::twice},
      {"front_reach_soft", galerkin, 0.49, opening_error, "opening",
       [](N& n) -> double& { return n.tuning.front_reach_soft; }, Dear::twice},
      {"front_blend", galerkin, 0.3, opening_error, "opening", [](N& n) -> double& { return n.tuning.front_blend; }},
      {"tube_inner", galerkin, 0.3, intensity_error, "intensity", [](N& n) -> double& { return n.tube.inner; }},
      {"tube_outer", galerkin, 0.3, intensity_error, "intensity", [](N& n) -> double& { return n.tube.outer; },
       Dear::twice},
      {"tube_half_length", galerkin, 0.3, intensity_error, "intensity",
       [](N& n) -> double& { return n.tube.half_length; }, Dear::twice},
      {"collocation_radius", collocation, 0.3, smooth_error, "smooth field",
       [](N& n) -> double& { return n.how.support_radius; }, Dear::twice},
      {"collocation_front_reach", collocation, 0.3, opening_error, "opening",
       [](N& n) -> double& { return n.tuning.collocation_front_reach; }, Dear::twice},
      {"collocation_front_radius", collocation, 0.3, opening_error, "opening",
       [](N& n) -> double& { return n.tuning.collocation_front_radius; }, Dear::twice},
      {"damping", collocation, 0.3, smooth_error, "smooth field", [](N& n) -> double& { return n.tuning.damping; }},
      {"damping_at_front", collocation, 0.3, opening_error, "opening",
       [](N& n) -> double& { return n.tuning.damping_at_front; }},
      {"pressure_smoothing", collocation, 0.49, smooth_error, "smooth field",
       [](N& n) -> double& { return n.tuning.pressure_smoothing; }},
  };
  return all;
}

Numbers numbers_of(const Row& row) {
  Numbers numbers;
  numbers.how.method = row.method;
  numbers.how.estimate_condition = false;
  if (row.method == Method::collocation)
    numbers.how.support_radius = solvers::default_collocation_radius;
  return numbers;
}

double median_error(const Row& row, double factor, int seeds) {
  std::vector<double> errors;
  for (int seed = 1; seed <= seeds; ++seed) {
    Numbers numbers = numbers_of(row);
    row.number(numbers) *= factor;
    try {
      errors.push_back(row.measure(numbers, row.poisson_ratio, seed));
    } catch (const NumericalError&) { // a support that is not sound
      errors.push_back(unusable);
    } catch (const InputError&) { // a tube that leaves the body, a blend of one
      errors.push_back(unusable);
    }
  }
  return median(errors);
}

std::string percent(double error) {
  return std::isfinite(error) ? fmt::format("{:.2f}", 100 * error) : "-";
}

} // namespace

std::vector<Check> run_sensitivity(const ExperimentContext& context) {
  const int seeds = context.quick ? 1 : 5;
  std::vector<Check> checks;
  app::Table table({"number", "method", "poisson_ratio", "value", "error_of", "at_half_percent", "at_it_percent",
                    "at_twice_percent"});
  app::Figure figure{"Error at half, at and at twice each number, in the order of the table",
                     "number",
                     "error over that at the number",
                     false,
                     true,
                     {{"half", {}, {}, app::SeriesStyle::points}, {"twice", {}, {}, app::SeriesStyle::points}}};
  for (const Row& row : rows()) {
    if (context.quick && checks.size() >= 4)
      break;
    Numbers numbers = numbers_of(row);
    const double value = row.number(numbers);
    const double half = median_error(row, 0.5, seeds), own = median_error(row, 1, seeds),
                 twice = median_error(row, 2, seeds);
    table.add({row.name, std::string(solvers::to_string(row.method)), fmt::format("{}", row.poisson_ratio),
               fmt::format("{:g}", value), row.measured, percent(half), percent(own), percent(twice)});
    context.say(fmt::format("{} = {:g} ({}, nu = {}, {}): {} / {} / {} % at half, at it, at twice", row.name, value,
                            solvers::to_string(row.method), row.poisson_ratio, row.measured, percent(half),
                            percent(own), percent(twice)));
    for (const auto& [series, error] : {std::pair(0, half), std::pair(1, twice)})
      if (std::isfinite(error)) {
        figure.series[series].x.push_back(static_cast<double>(checks.size()) + 1);
        figure.series[series].y.push_back(error / own);
      }
    double best = own;
    if (row.dear != Dear::half)
      best = std::min(best, half);
    if (row.dear != Dear::twice)
      best = std::min(best, twice);
    checks.push_back({fmt::format("{}_over_best", row.name), own / best, "<=", worst_over_best});
  }
  table.write(context.out / "sensitivity.csv");
  app::write_png(figure, context.out / "sensitivity.png");
  return checks;
}

} // namespace spherecut::experiments
