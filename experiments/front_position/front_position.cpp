// Problem:   a cut whose faces are under pressure, in a block that is held at one wall, grows by a tenth of a node
//            spacing at a time, over four spacings: a straight front across the block between sliding sides, and a
//            disc; along the axes of the block and turned against them. Nodes are sprinkled for the first position, and
//            replaced as a session replaces them.
// Reference: energy: at a constant load each step stores G dA. And openings behind the front change smoothly.
// Command:   spherecut experiment run front_position --out DIR
#include "experiments/analytic/cracks.hpp"
#include "experiments/registered.hpp"
#include "experiments/support/cut_body.hpp"
#include "experiments/support/precut_series.hpp"
#include "experiments/support/statistics.hpp"

#include "solvers/appended/appended_body.hpp"
#include "solvers/appended/uncut_body.hpp"
#include "solvers/fracture/tearing.hpp"
#include "src/output/figure.hpp"
#include "topology/incision/cut_sheets.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

using solvers::Method;
using solvers::SightRule;

constexpr double spacing = 0.004;       // m, of the nodes along the whole way of the front
constexpr double half_side = 0.036;     // m, of the block across the cut and along the way
constexpr double half_thickness = 0.02; // m, of the block along a straight front
constexpr double first_way = 0.020;     // m, from the wall to the first straight front
constexpr double first_radius = 0.010;  // m, of the disc
constexpr double step = 0.1;            // spacings
constexpr double probe_behind = 3;      // spacings behind the first straight front: where openings are looked at
const Vector3 turned_about = Vector3(1, 2, 1).normalized();

enum class Shape { straight, disc };

struct Case {
  Shape shape = Shape::straight;
  double tilt = 0; // degrees
  double nu = 0.3;
  PrecutMethod method;
};

struct Steps {
  std::vector<double> ratios;                     // of each step, dU / (G dA)
  std::vector<double> openings;                   // m, of each position
  [[nodiscard]] double largest_off_trend() const; // over the largest opening
};

/// Of a cubic that fits them best.
double Steps::largest_off_trend() const {
  const auto count = static_cast<Eigen::Index>(openings.size());
  const VectorX x = VectorX::LinSpaced(count, -1, 1);
  MatrixX powers(count, 4);
  for (Eigen::Index p = 0; p < powers.cols(); ++p)
    powers.col(p) = x.array().pow(static_cast<double>(p));
  const VectorX values = Eigen::Map<const VectorX>(openings.data(), count);
  const VectorX off = values - powers * powers.colPivHouseholderQr().solve(values);
  return off.lpNorm<Eigen::Infinity>() / values.maxCoeff();
}

CutFrame frame_of(const Case& the) {
  return tilted_frame({0.0013, 0.0007, 0.0009}, the.tilt * std::numbers::pi / 180 * turned_about);
}

topology::SurfaceMesh sheet_of(const Case& the, double advance) {
  const CutFrame frame = frame_of(the);
  constexpr double edge = 0.5 * spacing, beyond = 0.04; // m, across and behind
  if (the.shape == Shape::disc)
    return topology::make_disc_sheet(frame.origin, frame.normal, first_radius + advance, edge);
  const double front = first_way - half_side + advance, length = first_way + advance + beyond;
  return topology::make_rectangle_sheet(frame.origin + (front - 0.5 * length) * frame.ahead, frame.normal, frame.ahead,
                                        2 * (half_thickness + beyond), length, edge);
}

/// Fine nodes along the whole way of the front.
solvers::SpacingField spacing_along(const Case& the, const std::shared_ptr<const topology::Domain>& domain,
                                    double whole_way) {
  solvers::SpacingField field;
  field.fine = spacing;
  field.coarse = 4 * spacing;
  field.slope = 0.35;
  for (const double advance : {0.0, 0.5 * whole_way, whole_way}) {
    const topology::Incision incision({sheet_of(the, advance)}, domain);
    const auto segments = solvers::front_segments(incision, 2 * spacing);
    field.segments.insert(field.segments.end(), segments.begin(), segments.end());
  }
  return field;
}

/// The wall ahead; and a straight front has sides that slide: its intensities are the same all along.
void hold(solvers::Problem& problem, Shape shape) {
  const auto ahead = [](const Vector3& x) { return x.x() > half_side * (1 - 1e-6); };
  const auto slides = [shape](const Vector3& x) {
    return shape == Shape::straight && std::abs(x.y()) > half_thickness * (1 - 1e-6);
  };
  hold_surface(
      problem, [=](const Vector3& x, const Vector3&) { return ahead(x) || slides(x); },
      [](const Vector3&) -> Vector3 { return Vector3::Zero(); });
  for (solvers::Prescribed& entry : problem.prescribed)
    if (!ahead(problem.domain->closest_surface_point(problem.nodes.positions[entry.node])))
      entry.components = {false, true, false};
  problem.prescribed_region = [=](const Vector3& x, const Vector3&, int axis) {
    return ahead(x) || (axis == 1 && slides(x));
  };
}

Steps grow(const Case& the, int steps) {
  const double thickness = the.shape == Shape::disc ? half_side : half_thickness;
  const auto domain =
      topology::make_box_domain({-half_side, -thickness, -half_side}, {half_side, thickness, half_side}, 4 * spacing);
  const CutFrame frame = frame_of(the);
  const bool appends = the.method.sight == SightRule::appended;
  solvers::SprinkleOptions sprinkle;
  sprinkle.spacing = spacing_along(the, domain, step * spacing * steps);
  sprinkle.ring_ahead = solvers::wants_ring_ahead(the.method.method);
  sprinkle.lips_apart = appends;
  solvers::DiscretisationOptions options = the.method.options();
  options.estimate_condition = false;

  const double probe_at = the.shape == Shape::disc ? 0 : first_way - half_side - probe_behind * spacing;
  const Vector3 probe = frame.origin + probe_at * frame.ahead;
  Steps found;
  solvers::NodeCloud nodes;
  std::shared_ptr<const solvers::UncutBody> uncut;
  double last_energy = 0, last_release = 0, last_area = 0;
  for (int k = 0; k <= steps; ++k) {
    solvers::Problem problem;
    problem.domain = domain;
    problem.incision = std::make_shared<topology::Incision>(
        std::vector<topology::SurfaceMesh>{sheet_of(the, step * spacing * k)}, domain, k);
    sprinkle.incision = problem.incision;
    nodes = k == 0 ? solvers::sprinkle(*domain, sprinkle).nodes : solvers::resprinkle(*domain, sprinkle, nodes).nodes;
    problem.nodes = nodes;
    problem.material = {1e4, the.nu, 0};
    hold(problem, the.shape);
    problem.loads.lip_traction = [](const Vector3&, const Vector3& normal) -> Vector3 { return -100 * normal; };
    const auto body = appends ? solvers::make_appended(std::move(problem), options, uncut)
                              : solvers::discretise(std::move(problem), options);
    const solvers::Field field = body->solve();
    const auto states = solvers::front_states(
        *body, field, [](const Vector3&) { return 1.0; }, spacing);
    double release = 0;
    for (const solvers::FrontState& state : states)
      release += state.release / static_cast<double>(states.size());
    const double energy = 0.5 * body->load_work(field), area = body->problem().incision->area();
    if (k > 0)
      found.ratios.push_back((energy - last_energy) / (0.5 * (release + last_release) * (area - last_area)));
    found.openings.push_back(opening_at(*body, field, probe, frame.normal, spacing).norm());
    last_energy = energy;
    last_release = release;
    last_area = area;
  }
  return found;
}

} // namespace

std::vector<Check> run_front_position(const ExperimentContext& context) {
  const int steps = context.quick ? 14 : 40;
  const std::vector<double> tilts = context.quick ? std::vector<double>{0} : std::vector<double>{0, 1, 8.5, 45};
  const std::vector<double> ratios{0.3, 0.49};
  std::vector<PrecutMethod> methods{{Method::galerkin, SightRule::appended, true}};
  if (!context.quick) {
    methods.push_back({Method::galerkin, SightRule::enriched, true});
    methods.push_back({Method::collocation, SightRule::enriched, true});
  }
  std::vector<Check> checks;
  app::Table table({"rule", "shape", "tilt_degrees", "nu", "step", "ratio", "opening_m"});
  app::Figure figure{"Energy of each step, front along the axes, nu = 0.3",
                     "way of the front / spacings",
                     "dU / (G dA)",
                     false,
                     false,
                     {}};
  for (const PrecutMethod& method : methods)
    for (const double nu : ratios) {
      std::vector<double> off_energy, off_mean, off_trend;
      for (const Shape shape : {Shape::straight, Shape::disc})
        for (const double tilt : tilts) {
          if (shape == Shape::disc && (context.quick || tilt == 1 || tilt == 45)) // it has all directions in itself
            continue;
          const Steps found = grow({shape, tilt, nu, method}, steps);
          double worst = 0, sum = 0;
          app::Series line{fmt::format("{}, {}", method.name(), shape == Shape::disc ? "disc" : "straight"),
                           {},
                           {},
                           app::SeriesStyle::lines_and_points};
          for (std::size_t k = 0; k < found.ratios.size(); ++k) {
            worst = std::max(worst, std::abs(found.ratios[k] - 1));
            sum += found.ratios[k];
            line.x.push_back(step * static_cast<double>(k + 1));
            line.y.push_back(found.ratios[k]);
            table.add({method.name(), shape == Shape::disc ? "disc" : "straight", fmt::format("{:g}", tilt),
                       fmt::format("{:g}", nu), fmt::format("{}", k + 1), fmt::format("{:.4f}", found.ratios[k]),
                       fmt::format("{:.6g}", found.openings[k + 1])});
          }
          if (tilt == 0 && nu == 0.3)
            figure.series.push_back(line);
          off_energy.push_back(worst);
          off_mean.push_back(std::abs(sum / static_cast<double>(found.ratios.size()) - 1));
          off_trend.push_back(found.largest_off_trend());
          context.say(fmt::format("{}, nu = {:g}, {}, {:g} degrees: dU / (G dA) {:.3f} in the mean, a step is off by "
                                  "{:.1f} % at most; openings off their trend by {:.2f} %",
                                  method.name(), nu, shape == Shape::disc ? "disc" : "straight", tilt,
                                  sum / static_cast<double>(found.ratios.size()), 100 * worst, 100 * off_trend.back()));
        }
      const std::string name = fmt::format("front_position_{}_nu{:.0f}", method.name(), 100 * nu);
      checks.push_back({name + (context.quick ? "_energy_reported" : "_energy"), largest(off_energy),
                        "<=", context.quick ? 1 : 0.08});
      checks.push_back({name + "_energy_mean", largest(off_mean), "<=", context.quick ? 0.2 : 0.08});
      checks.push_back({name + "_opening", largest(off_trend), "<=", 0.01});
    }
  table.write(context.out / "steps.csv");
  app::write_png(figure, context.out / "front_position.png");
  return checks;
}

} // namespace spherecut::experiments
