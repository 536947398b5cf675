// Problem:   a straight crack in mixed mode, exact displacements on the boundary, tears on by half a spacing. The kink
//            of the first new piece of sheet is measured on the sheet.
// Reference: the direction of largest hoop stress [Erdogan and Sih 1963] of the exact intensities: 70.5 degrees in mode
//            II alone.
// Command:   spherecut experiment run kink --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/statistics.hpp"
#include "experiments/support/straight_crack.hpp"

#include "solvers/fracture/tearing.hpp"
#include "src/output/figure.hpp"
#include "topology/incision/front_growth.hpp"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

const CutFrame& crack = straight_crack_frame();
constexpr double degrees = 180 / std::numbers::pi;

/// Angle of the triangles that a sheet has gained over the middle of the front, rad, by their area.
double measured_kink(const topology::SurfaceMesh& before, const topology::SurfaceMesh& after) {
  Vector3 normal = Vector3::Zero();
  for (std::size_t t = before.triangles.size(); t < after.triangles.size(); ++t) {
    const auto& [a, b, c] = after.triangles[t];
    const auto& x = after.vertices;
    const Vector3 area = 0.5 * (x[b] - x[a]).cross(x[c] - x[a]);
    if (std::abs(crack.local((x[a] + x[b] + x[c]) / 3)[2]) < 0.25)
      normal += area;
  }
  return std::atan2(-normal.dot(crack.ahead), normal.dot(crack.normal));
}

} // namespace

std::vector<Check> run_kink(const ExperimentContext& context) {
  const int seeds = context.quick ? 1 : 10;
  const std::vector<Vector3> mixes{{1, 0.2, 0}, {1, 0.5, 0}, {1, 1, 0}, {0.4, -1, 0}, {0, 1, 0}, {1, 0.5, 0.5}};
  std::vector<Check> checks;
  app::Table table({"method", "k_1", "k_2", "k_3", "seed", "kink_degrees", "exact_degrees"});
  app::Figure figure{"Kink of the first new piece of sheet", "exact / degrees", "measured / degrees", false, false, {}};
  for (const solvers::Method method : {solvers::Method::galerkin, solvers::Method::collocation}) {
    solvers::DiscretisationOptions options;
    options.method = method;
    std::vector<std::vector<double>> errors(mixes.size());
    app::Series points{std::string(solvers::to_string(method)), {}, {}, app::SeriesStyle::points};
    for (int seed = 1; seed <= seeds; ++seed) {
      CutBody body = straight_crack_body(static_cast<std::uint64_t>(seed), 0.1, method);
      const solvers::Material& material = body.problem.material;
      solvers::Intensities acting = Vector3::Zero();
      hold_whole_surface(body.problem, [&acting, material](const Vector3& x) {
        return straight_crack_displacement(material, crack, acting, x);
      });
      const auto discretisation = solvers::discretise(body.problem, options);
      for (std::size_t m = 0; m < mixes.size(); ++m) {
        acting = mixes[m];
        const solvers::Field field = discretisation->solve();
        const double toughness = 0.5 * solvers::driving_release_rate(material, acting);
        const auto states = solvers::front_states(
            *discretisation, field, [toughness](const Vector3&) { return toughness; }, body.fine);
        const topology::FrontGrowth growth = topology::grow_front(
            *body.problem.incision, solvers::tear_motion(states, 0.5 * body.fine, 2 * body.fine), 0.5 * body.fine);
        const double found = degrees * measured_kink(body.problem.incision->sheets()[0], growth.sheets[0]);
        const double wanted = degrees * solvers::kink_angle(acting);
        errors[m].push_back(std::abs(found - wanted));
        points.x.push_back(wanted);
        points.y.push_back(found);
        table.add({std::string(solvers::to_string(method)), fmt::format("{}", acting[0]), fmt::format("{}", acting[1]),
                   fmt::format("{}", acting[2]), fmt::format("{}", seed), fmt::format("{:.2f}", found),
                   fmt::format("{:.2f}", wanted)});
      }
    }
    figure.series.push_back(points);
    const double bound = method == solvers::DiscretisationOptions{}.method ? 4 : 8;
    for (std::size_t m = 0; m < mixes.size(); ++m) {
      const std::string name =
          fmt::format("kink_{}_{}_{}_{}", solvers::to_string(method), mixes[m][0], mixes[m][1], mixes[m][2]);
      context.say(fmt::format("{}: exact {:.1f} degrees, off by {:.2f} ({:.2f})", name,
                              degrees * solvers::kink_angle(mixes[m]), median(errors[m]), largest(errors[m])));
      checks.push_back({name, median(errors[m]), "<=", bound});
      checks.push_back({name + "_worst", largest(errors[m]), "<=", 2 * bound});
    }
  }
  figure.series.push_back({"exact", {-75, 75}, {-75, 75}, app::SeriesStyle::lines});
  table.write(context.out / "runs.csv");
  app::write_png(figure, context.out / "kink.png");
  return checks;
}

} // namespace spherecut::experiments
