// Problem:   a strip in plane strain (sliding sides) with a cut from one side that lies askew to the pull on its ends.
//            The pull is raised until the release rate reaches the toughness; then the cut tears on, out of its plane,
//            by a fixed way, and so on: on three spacings at the front, h, h / 1.4 and h / 2.
// Reference: the solution on the finest nodes: onset load within 5 %, path within one h.
// Command:   spherecut experiment run spacing_independence --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/cut_body.hpp"
#include "experiments/support/tilted_strip.hpp"

#include "solvers/fracture/tearing.hpp"
#include "src/output/figure.hpp"
#include "topology/incision/cut_sheets.hpp"
#include "topology/incision/front_growth.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

constexpr double length = 4, height = 2, thickness = 0.4; // m; pulled along its length
constexpr double depth = 0.8, askew = 0.6, toughness = 1; // m; rad; J/m2
const solvers::Material material{1, 0.3, 0};

struct Path {
  double spacing = 0, onset = 0; // m; Pa
  std::vector<Vector3> places;   // m, of the middle of the front, in axes along length, height and thickness
  std::vector<double> loads;     // Pa at which it has torn to each
  double balance = 0;            // of the energies
};

Path tear(double spacing, double way, double last, std::uint64_t seed, const solvers::DiscretisationOptions& options) {
  const TiltedStrip strip = tilted_strip(length, height, thickness, 0.4, StripSides::sliding);
  const CutFrame& frame = strip.frame;
  // From the middle of the lower side inwards, turned against the height.
  const Vector3 inwards = frame.global({std::sin(askew), std::cos(askew), 0});
  const Vector3 across = frame.global({-std::cos(askew), std::sin(askew), 0});
  const Vector3 mouth = frame.origin + frame.global({-0.3, -0.5 * height, 0});
  const double beyond = 0.5;
  std::vector<topology::SurfaceMesh> sheets{
      topology::make_rectangle_sheet(mouth + 0.5 * (depth - beyond) * inwards, across, inwards, thickness + 0.4,
                                     depth + beyond, std::min(0.5 * spacing, 0.1))};
  Path path;
  path.spacing = spacing;
  double work = 0, taken = 0, last_stored = 0, last_opening = 0, last_area = 0;
  for (double torn = 0;; torn += way) {
    CutBody body = cut_body({strip.domain, sheets, 3, 0.35, 0, seed, spacing, options.method});
    body.problem.material = material;
    hold_strip(body.problem, strip);
    body.problem.loads.traction = [frame](const Vector3&, const Vector3& n) -> Vector3 {
      const double end = n.dot(frame.ahead);
      return std::abs(end) < 0.9 ? Vector3(Vector3::Zero()) : Vector3(std::copysign(1, end) * frame.ahead);
    };
    const auto discretisation = solvers::discretise(body.problem, options);
    const solvers::Field field = discretisation->solve();
    const auto states =
        solvers::averaged(material,
                          solvers::front_states(
                              *discretisation, field, [](const Vector3&) { return toughness; }, 0.15 * thickness),
                          thickness);
    double release = 0;
    Vector3 middle = Vector3::Zero();
    for (const solvers::FrontState& state : states) {
      release += state.release / static_cast<double>(states.size());
      middle += frame.local(state.frame.point) / static_cast<double>(states.size());
    }
    const double load = std::sqrt(toughness / release); // times the pull of 1 Pa
    // Of the pull's own account: its work along from load to load against what is stored and what the tear takes.
    const double opening = discretisation->load_work(field) * load, stored = 0.5 * load * opening;
    const double area = body.problem.incision->area();
    if (!path.loads.empty()) {
      work += 0.5 * (load + path.loads.back()) * (opening - last_opening) - (stored - last_stored);
      taken += toughness * (area - last_area);
    } else {
      path.onset = load;
    }
    last_stored = stored;
    last_opening = opening;
    last_area = area;
    path.places.push_back(middle);
    path.loads.push_back(load);
    if (torn >= last - 1e-9)
      break;
    std::vector<solvers::FrontState> acting = states;
    for (solvers::FrontState& state : acting) // the whole front moves by the same way
      state.release = 2 * toughness;
    sheets = topology::grow_front(*body.problem.incision, solvers::tear_motion(acting, way, thickness), 0.5 * spacing)
                 .sheets;
  }
  path.balance = taken > 0 ? std::abs(work - taken) / taken : 0;
  return path;
}

/// Largest distance of the places of a path from the line through those of another, m.
double distance(const Path& path, const Path& reference) {
  double farthest = 0;
  for (const Vector3& x : path.places) {
    double nearest = 1e300;
    for (std::size_t k = 1; k < reference.places.size(); ++k) {
      const Vector3 &a = reference.places[k - 1], &b = reference.places[k];
      const double t = std::clamp((x - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
      nearest = std::min(nearest, (x - a - t * (b - a)).head<2>().norm());
    }
    farthest = std::max(farthest, nearest);
  }
  return farthest;
}

} // namespace

std::vector<Check> run_spacing_independence(const ExperimentContext& context) {
  const double coarsest = context.quick ? 0.17 : 0.14, way = 0.1, last = context.quick ? 0.1 : 0.6;
  std::vector<Check> checks;
  app::Table table({"method", "spacing", "x", "y", "load"});
  app::Figure figure{"Path of a tear on three spacings", "along the strip / m", "across / m", false, false, {}};
  for (const solvers::Method method : {solvers::Method::galerkin, solvers::Method::collocation}) {
    if (context.quick && method == solvers::Method::collocation)
      continue;
    solvers::DiscretisationOptions options;
    options.method = method;
    std::vector<Path> paths;
    for (const double factor : {1.0, 1.4, 2.0}) {
      paths.push_back(tear(coarsest / factor, way, last, 1, options));
      const Path& path = paths.back();
      app::Series line{fmt::format("{}, h = {:.3f}", solvers::to_string(method), path.spacing),
                       {},
                       {},
                       app::SeriesStyle::lines_and_points};
      for (std::size_t k = 0; k < path.places.size(); ++k) {
        table.add({std::string(solvers::to_string(method)), fmt::format("{:.4f}", path.spacing),
                   fmt::format("{:.5f}", path.places[k][0]), fmt::format("{:.5f}", path.places[k][1]),
                   fmt::format("{:.5f}", path.loads[k])});
        line.x.push_back(path.places[k][0]);
        line.y.push_back(path.places[k][1]);
      }
      figure.series.push_back(line);
      context.say(fmt::format("{}, h = {:.4f}: onset at {:.4f} Pa, torn to ({:.4f}, {:.4f}) at {:.4f} Pa, energy to "
                              "{:.2f} %",
                              solvers::to_string(method), path.spacing, path.onset, path.places.back()[0],
                              path.places.back()[1], path.loads.back(), 100 * path.balance));
    }
    double onset = 0, stray = 0, balance = 0;
    for (const Path& path : paths) {
      onset = std::max(onset, std::abs(path.onset / paths.back().onset - 1));
      stray = std::max(stray, distance(path, paths.back()) / path.spacing);
      balance = std::max(balance, path.balance);
    }
    const double loose = method == solvers::DiscretisationOptions{}.method ? 1 : 2;
    const std::string name = fmt::format("spacing_independence_{}", solvers::to_string(method));
    checks.push_back({name + "_onset", onset, "<=", 0.05 * loose});
    checks.push_back({name + "_path_in_spacings", stray, "<=", 1 * loose});
    if (context.quick) // of a single increment it is the difference of two discretisations
      checks.push_back({name + "_energy_balance_reported", balance, ">=", 0});
    else
      checks.push_back({name + "_energy_balance", balance, "<=", 0.05 * loose});
  }
  table.write(context.out / "paths.csv");
  app::write_png(figure, context.out / "path.png");
  return checks;
}

} // namespace spherecut::experiments
