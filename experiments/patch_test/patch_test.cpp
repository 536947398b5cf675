// Problem:   unit cube with irregular nodes, base held and five faces loaded by the displacement and traction of a
//            linear field with components of order one.
// Reference: the field itself. A method with a linear basis must reproduce it: to round-off where rows are collocated
// or
//            integrated exactly, to the error of the quadrature in the weak form.
//            Two fields: `volume_change` strains by order one whatever the Poisson ratio, so that near
//            incompressibility its pressure is lambda / mu times its shear stress; in `even_stress` the volumetric part
//            is scaled by 1 - 2 nu and all stresses are of one order. The weak form's quadrature error follows the
//            stress: its bounds hold for even stress at every nu and for any field up to nu = 0.3; beyond that the
//            error is reported.
// Command:   spherecut experiment run patch_test --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/cube.hpp"
#include "experiments/support/statistics.hpp"

#include "src/output/figure.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

struct Configuration {
  std::string name;
  solvers::DiscretisationOptions options;
  double bound;
  double bound_up_to; // Poisson ratio to which the bound holds for `volume_change`
};

ManufacturedField even_stress_field(const solvers::Material& material) {
  ManufacturedField field = linear_field(material);
  field.slope -= 2 * material.poisson_ratio * field.slope.trace() / 3 * Matrix3::Identity();
  return field;
}

std::vector<Configuration> configurations() {
  solvers::DiscretisationOptions published, collocation, galerkin, galerkin_fine;
  published.method = solvers::Method::published;
  collocation.method = solvers::Method::collocation;
  galerkin.method = solvers::Method::galerkin;
  galerkin_fine = galerkin;
  galerkin_fine.quadrature = 3;
  return {{"published", published, 1e-10, 0.5},
          {"collocation", collocation, 1e-10, 0.5},
          {"galerkin", galerkin, 1e-3, 0.3},
          {"galerkin_3x3x3", galerkin_fine, 1e-4, 0.3}};
}

} // namespace

std::vector<Check> run_patch_test(const ExperimentContext& context) {
  const int divisions = 8, seeds = context.quick ? 1 : 3;
  const double jitter = 0.25;
  const std::vector<double> ratios =
      context.quick ? std::vector<double>{0.3, 0.49} : std::vector<double>{0, 0.3, 0.45, 0.49};

  std::vector<Check> checks;
  app::Table table({"method", "field", "poisson_ratio", "nodes", "median_error", "worst_error"});
  app::Figure figure{
      "Patch test: linear fields on irregular nodes", "Poisson ratio", "relative error", false, true, {}};
  for (const Configuration& configuration : configurations()) {
    double worst = 0, worst_beyond = 0;
    for (const bool even : {true, false}) {
      const std::string field_name = even ? "even_stress" : "volume_change";
      app::Series series{configuration.name + ", " + field_name, {}, {}};
      for (double nu : ratios) {
        const solvers::Material material{1, nu, 0};
        const ManufacturedField field = even ? even_stress_field(material) : linear_field(material);
        std::vector<double> errors;
        int nodes = 0;
        for (int seed = 1; seed <= seeds; ++seed) {
          const auto body = solvers::discretise(cube_problem(field, divisions, jitter, seed), configuration.options);
          errors.push_back(displacement_error(*body, body->solve(), field));
          nodes = body->report().nodes;
        }
        double& bounded = even || nu <= configuration.bound_up_to ? worst : worst_beyond;
        bounded = std::max(bounded, largest(errors));
        table.add({configuration.name, field_name, fmt::format("{}", nu), fmt::format("{}", nodes),
                   fmt::format("{:.2e}", median(errors)), fmt::format("{:.2e}", largest(errors))});
        series.x.push_back(nu);
        series.y.push_back(largest(errors));
        context.say(fmt::format("{}, {}, nu = {}: worst of {} seeds {:.2e}", configuration.name, field_name, nu, seeds,
                                largest(errors)));
      }
      figure.series.push_back(series);
    }
    checks.push_back({"patch_test_" + configuration.name, worst, "<=", configuration.bound});
    if (worst_beyond > 0)
      checks.push_back({"patch_test_" + configuration.name + "_volume_change_reported", worst_beyond, ">=", 0});
  }
  table.write(context.out / "errors.csv");
  app::write_png(figure, context.out / "errors.png");
  return checks;
}

} // namespace spherecut::experiments
