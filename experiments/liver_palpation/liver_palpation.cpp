// Problem:   the paper's Figure 4: a laparoscopic instrument through a port in the abdominal wall presses on a liver,
// once
//            with its tip on the front of the dome and once with its shaft laid across the top. E = 6 kPa, nu = 0.45,
//            the bare area behind and the underside held, contact frictionless, the contact area an outcome.
// Reference: itself on finer nodes, and the other method: there is no exact solution. The force must settle under
//            refinement; without friction none of it acts along the shaft.
// Command:   spherecut experiment run liver_palpation --out DIR
#include "experiments/registered.hpp"

#include "src/output/figure.hpp"
#include "src/output/vtp.hpp"
#include "src/session/session.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace spherecut::experiments {

namespace {

using solvers::Method;

/// One way of the instrument.
struct Press {
  std::string name;
  Vector3 port;             // m
  app::Approach approach;   // of the tip
  double fine_radius;       // m, of the fine zone
  std::vector<double> fine; // m, refinements, coarse to fine
};

std::vector<Press> presses(bool quick) {
  Press tip{"tip",
            {0, -0.16, 0.18},
            {{-0.05, -0.04, 0.05}, Vector3(-0.05, 0.12, -0.13).normalized(), 0.006, 0.002, 1},
            0.010,
            {0.004, 0.0028, 0.002, 0.0014}};
  Press shaft{"shaft",
              {0.16, -0.10, 0.10},
              {{-0.12, 0, 0.058}, -Vector3::UnitZ(), 0.006, 0.002, 1},
              0.018,
              {0.0056, 0.004, 0.0028, 0.002}};
  if (quick) {
    tip.fine = {0.004, 0.003};
    return {tip};
  }
  return {tip, shaft};
}

app::FixedRegion half_space(const std::string& name, const Vector3& point, const Vector3& normal) {
  return {name, Plane{normal, normal.dot(point)}};
}

app::Scenario scenario(const Press& press, Method method, double fine, int steps, int triangles) {
  app::Scenario scenario;
  scenario.file = "liver_palpation";
  scenario.title = "Laparoscopic palpation of a liver, " + press.name;
  scenario.organ.shape = app::LiverOrgan{triangles};
  scenario.material = {6000, 0.45, 1060};
  scenario.fixed = {half_space("bare area", {0, 0.045, 0}, -Vector3::UnitY()),
                    half_space("underside", {0, 0, -0.030}, Vector3::UnitZ())};
  scenario.nodes.fine_spacing = fine;
  scenario.nodes.coarse_spacing = 8 * fine; // the whole cloud is refined, not the contact alone
  scenario.nodes.fine_radius = press.fine_radius;
  scenario.method.method = method;
  app::ToolSettings& tool = scenario.tool.emplace();
  tool.shape = topology::Laparoscope{0.0075, 0.005, 0.30, press.port};
  tool.motion = press.approach;
  tool.step = press.approach.duration / steps;
  return scenario;
}

struct Curve {
  std::unique_ptr<app::Session> session;
  std::vector<app::StepResult> steps;
  [[nodiscard]] double force() const { return steps.back().force.norm(); } // N, at the full depth
};

Curve run(app::Scenario scenario) {
  Curve curve;
  curve.session = std::make_unique<app::Session>(std::move(scenario));
  for (const app::StepSample& sample : curve.session->steps())
    curve.steps.push_back(curve.session->step(sample));
  return curve;
}

double way_mm(const app::StepResult& step, const Press& press) {
  const app::Approach& approach = press.approach;
  return 1e3 * ((approach.depth + approach.clearance) * step.time / approach.duration - approach.clearance);
}

/// Surface displacement, m. A point beyond every sphere does not move.
Vector3 displacement(const app::Session& session, const Vector3& x) {
  try {
    return session.model().body->at(x, session.model().field).displacement;
  } catch (const InputError&) {
    return Vector3::Zero();
  }
}

void write_surface(const app::Session& session, const std::filesystem::path& file) {
  const topology::SurfaceMesh& surface = session.organ().domain->surface();
  std::vector<Vector3> moved, displacements;
  for (const Vector3& x : surface.vertices) {
    displacements.push_back(displacement(session, x));
    moved.push_back(x + displacements.back());
  }
  app::write_vtp(file, moved, surface.triangles, {app::vector_data("displacement [m]", displacements)});
}

/// The surface through the contact, at rest and deformed, in the plane of the contact normal and the tool's heading.
app::Figure section(const Curve& curve, const Press& press) {
  const app::StepResult& last = curve.steps.back();
  const Vector3 up = last.contact.normal;
  const Vector3 along = up.cross(last.pose.axis).normalized(); // across the instrument
  app::Series rest{"at rest", {}, {}, app::SeriesStyle::lines};
  app::Series deformed{"pressed", {}, {}, app::SeriesStyle::lines};
  constexpr double reach = 0.04;
  constexpr int samples = 100;
  for (int k = -samples; k <= samples; ++k) {
    const Vector3 x =
        curve.session->organ().domain->closest_surface_point(last.contact.point + reach * k / samples * along);
    const Vector3 y = x + displacement(*curve.session, x);
    rest.x.push_back(1e3 * along.dot(x - last.contact.point));
    rest.y.push_back(1e3 * up.dot(x - last.contact.point));
    deformed.x.push_back(1e3 * along.dot(y - last.contact.point));
    deformed.y.push_back(1e3 * up.dot(y - last.contact.point));
  }
  return {"Liver surface across the " + press.name, "distance / mm", "height / mm", false, false, {rest, deformed}};
}

} // namespace

std::vector<Check> run_liver_palpation(const ExperimentContext& context) {
  const int steps = context.quick ? 4 : 10, triangles = context.quick ? 5000 : 20000;
  std::vector<Check> checks;
  app::Table forces({"press", "method", "fine_spacing_m", "nodes", "way_m", "force_x_n", "force_y_n", "force_z_n",
                     "force_n", "contact_radius_m", "active_nodes", "rotation_degrees", "converged"});
  app::Table convergence({"press", "method", "fine_spacing_m", "nodes", "force_n", "change_from_coarser"});
  for (const Press& press : presses(context.quick)) {
    app::Figure figure{
        "Force on the instrument, " + press.name, "way after the first touch / mm", "force / N", false, false, {}};
    std::vector<double> finest_force; // N, one per method
    for (Method method : {Method::galerkin, Method::collocation}) {
      const std::string name(solvers::to_string(method));
      double coarser = std::numeric_limits<double>::quiet_NaN(), change = 0, along_shaft = 0;
      int unconverged = 0;
      for (double fine : press.fine) {
        const Curve curve = run(scenario(press, method, fine, steps, triangles));
        const int nodes = curve.session->model().sprinkling.nodes.size();
        app::Series series{fmt::format("{}, {} nodes", name, nodes), {}, {}};
        for (const app::StepResult& step : curve.steps) {
          const double way = way_mm(step, press);
          unconverged += step.converged ? 0 : 1;
          if (way >= -1e-9) {
            series.x.push_back(way);
            series.y.push_back(step.force.norm());
          }
          forces.add({press.name, name, fmt::format("{}", fine), fmt::format("{}", nodes),
                      fmt::format("{:.5f}", 1e-3 * way), fmt::format("{:.5f}", step.force.x()),
                      fmt::format("{:.5f}", step.force.y()), fmt::format("{:.5f}", step.force.z()),
                      fmt::format("{:.5f}", step.force.norm()), fmt::format("{:.5f}", step.contact_radius),
                      fmt::format("{}", step.active_nodes), fmt::format("{:.1f}", step.rotation_degrees),
                      step.converged ? "1" : "0"});
        }
        change = std::abs(curve.force() / coarser - 1);
        convergence.add({press.name, name, fmt::format("{}", fine), fmt::format("{}", nodes),
                         fmt::format("{:.4f}", curve.force()),
                         std::isfinite(change) ? fmt::format("{:.4f}", change) : ""});
        context.say(fmt::format("{}, {}, {} nodes: {:.4f} N{}", press.name, name, nodes, curve.force(),
                                std::isfinite(change) ? fmt::format(", change {:.2f} %", 100 * change) : ""));
        along_shaft = std::abs(curve.steps.back().force.dot(curve.steps.back().pose.axis)) / curve.force();
        coarser = curve.force();
        if (fine == press.fine.back() || fine == press.fine.front())
          figure.series.push_back(series);
        if (fine == press.fine.back() && method == Method::galerkin) {
          write_surface(*curve.session, context.out / (press.name + "_surface.vtp"));
          app::write_png(section(curve, press), context.out / (press.name + "_section.png"));
        }
      }
      const std::string prefix = "liver_" + press.name + "_" + name;
      checks.push_back({prefix + "_last_refinement_change", change, "<=", context.quick ? 0.15 : 0.05});
      checks.push_back({prefix + "_steps_not_converged", static_cast<double>(unconverged), "<=", 0});
      if (press.name == "shaft")
        checks.push_back({prefix + "_force_along_shaft", along_shaft, "<=", 0.01});
      finest_force.push_back(coarser);
    }
    checks.push_back(
        {"liver_" + press.name + "_methods_differ", std::abs(finest_force[1] / finest_force[0] - 1), "<=", 0.05});
    app::write_png(figure, context.out / (press.name + "_force.png"));
  }
  forces.write(context.out / "forces.csv");
  convergence.write(context.out / "convergence.csv");
  return checks;
}

} // namespace spherecut::experiments
