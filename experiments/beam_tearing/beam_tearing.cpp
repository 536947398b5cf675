// Problem:   a bar split along its middle (double cantilever), its arms drawn apart by shear on their ends, tears on
//            along its weaker middle plane until the cut is twice as long. At every length the opening is raised until
//            the release rate reaches the toughness; then the front moves by up to one and a half spacings. Sliding
//            sides (plane strain), askew between the axes.
// Reference: beams of height H that turn at their root, opening d = 8 P (b + 0.64 H)^3 / (w E* H^3), that release
//            G = 12 P^2 (b + 0.64 H)^2 / (w^2 E* H^3) = G_c: the load P against the opening d, the length b eliminated.
// Command:   spherecut experiment run beam_tearing --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/cut_body.hpp"
#include "experiments/support/statistics.hpp"
#include "experiments/support/tilted_strip.hpp"

#include "solvers/fracture/tearing.hpp"
#include "src/output/figure.hpp"
#include "topology/incision/front_growth.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::experiments {

namespace {

constexpr double arm = 1, length = 10.5, thickness = 0.6, first_depth = 4; // m
constexpr double toughness = 1, elsewhere = 4, weak_half = 0.004;          // J/m2; m
constexpr double stride = 1.5, slope = 2;                                  // spacings
const solvers::Material material{1, 0.3, 0};
const double modulus = material.young_modulus / (1 - material.poisson_ratio * material.poisson_ratio);

/// Load of the beams at an opening at which they release the toughness, N.
double beam_load(double opening) {
  // P = A / l and d = B P l^3 with l = b + 0.64 H: l^2 = d / (A B).
  const double a = thickness * std::sqrt(toughness * modulus * std::pow(arm, 3) / 12);
  const double b = 8 / (thickness * modulus * std::pow(arm, 3));
  return a / std::sqrt(opening / (a * b));
}

struct Length {
  double depth = 0, straightness = 0; // m: mean over the front and its largest distance from it
  double height = 0;                  // m, of the front over the middle of the bar
  double area = 0;                    // m2
  double opening = 0, release = 0;    // under unit load: m, J/m2
  topology::FrontGrowth grown;
};

Length solve_length(const TiltedStrip& strip, const std::vector<topology::SurfaceMesh>& sheets, int nodes,
                    std::uint64_t seed, const solvers::DiscretisationOptions& options) {
  const CutFrame& frame = strip.frame;
  CutBody body = cut_body({strip.domain, sheets, 2.5, 0.35, nodes, seed, 0, options.method});
  body.problem.material = material;
  hold_strip(body.problem, strip);
  body.problem.loads.traction = [frame](const Vector3& x, const Vector3& n) -> Vector3 {
    if (n.dot(frame.ahead) > -0.9)
      return Vector3::Zero();
    return (frame.local(x)[1] > 0 ? 1 : -1) / (thickness * arm) * frame.normal;
  };
  const auto discretisation = solvers::discretise(body.problem, options);
  const solvers::Field field = discretisation->solve();
  const topology::Incision& incision = *body.problem.incision;
  Length result;
  constexpr int rows = 8, columns = 4;
  for (int a = 0; a < rows; ++a)
    for (int b = 0; b < columns; ++b)
      for (const double side : {1.0, -1.0}) {
        const Vector3 at(-0.5 * length + 1e-6, side * arm * (a + 0.5) / rows, thickness * ((b + 0.5) / columns - 0.5));
        result.opening += side *
                          discretisation->at(frame.origin + frame.global(at), field).displacement.dot(frame.normal) /
                          (rows * columns);
      }
  result.area = incision.area();
  const auto tough = [frame](const Vector3& x) {
    return std::abs(frame.local(x)[1]) < weak_half ? toughness : elsewhere;
  };
  const auto states = solvers::directed(
      solvers::averaged(material, solvers::front_states(*discretisation, field, tough, 0.1 * thickness),
                        1.5 * body.fine),
      solvers::TearDirection::weakest, tough, 0.5 * body.fine);
  std::vector<double> depths;
  for (const solvers::FrontState& state : states) {
    const Vector3 x = frame.local(state.frame.point);
    result.release += state.release / static_cast<double>(states.size());
    result.height += x[1] / static_cast<double>(states.size());
    if (std::abs(x[2]) < 0.4 * thickness) // away from the sides
      depths.push_back(x[0] + 0.5 * length);
  }
  for (const double depth : depths)
    result.depth += depth / static_cast<double>(depths.size());
  for (const double depth : depths)
    result.straightness = std::max(result.straightness, std::abs(depth - result.depth));
  // At one opening G falls as b^-4: so much of it is there when the step begins that it is back at the toughness when
  // it ends.
  std::vector<solvers::FrontState> acting = states;
  for (solvers::FrontState& state : acting)
    state.release *= std::pow(1 + stride * body.fine / (result.depth + 0.64 * arm), 4) * toughness / result.release;
  result.grown = topology::grow_front(
      incision, solvers::tear_motion(acting, stride * body.fine, body.fine, slope * body.fine), 0.5 * body.fine);
  return result;
}

struct Run {
  std::vector<double> depth, opening, load, height;
  double load_error = 0, straightness = 0, balance = 0;
};

Run tear(int nodes, double last_depth, std::uint64_t seed, const solvers::DiscretisationOptions& options,
         const ExperimentContext& context) {
  const TiltedStrip strip = tilted_strip(length, 2 * arm, thickness, 0.4, StripSides::sliding);
  std::vector<topology::SurfaceMesh> sheets{cut_from_end(strip, first_depth, 0, 0.15)};
  Run run;
  double work = 0, dissipated = 0, stored = 0, last_area = 0;
  constexpr int most_steps = 160;
  for (int step = 0; step < most_steps; ++step) {
    const Length at = solve_length(strip, sheets, nodes, seed, options);
    const double load = std::sqrt(toughness / at.release), opening = load * at.opening;
    if (step > 0) { // along P = c d^s, the power law through both ends
      const double power = std::log(load / run.load.back()) / std::log(opening / run.opening.back());
      work += (load * opening - run.load.back() * run.opening.back()) / (power + 1);
      dissipated += toughness * (at.area - last_area);
    } else {
      stored = 0.5 * load * opening;
    }
    last_area = at.area;
    context.say(
        fmt::format("depth {:.3f}, opening {:.2f}, load {:.5f} (beams {:.5f}), straight to {:.2f} % of the width",
                    at.depth, opening, load, beam_load(opening), 100 * at.straightness / thickness));
    run.depth.push_back(at.depth);
    run.opening.push_back(opening);
    run.load.push_back(load);
    run.height.push_back(at.height);
    run.load_error = std::max(run.load_error, std::abs(load / beam_load(opening) - 1));
    run.straightness = std::max(run.straightness, at.straightness / thickness);
    if (at.depth >= last_depth)
      break;
    sheets = at.grown.sheets;
  }
  if (dissipated > 0)
    run.balance = std::abs(work - (0.5 * run.load.back() * run.opening.back() - stored) - dissipated) / dissipated;
  return run;
}

} // namespace

std::vector<Check> run_beam_tearing(const ExperimentContext& context) {
  const int seeds = 1, nodes = context.quick ? 1500 : 2000;
  const double last_depth = context.quick ? first_depth + 0.2 : 2 * first_depth;
  std::vector<Check> checks;
  app::Table table({"method", "seed", "depth", "opening", "load", "beam_load", "height"});
  app::Figure figure{"Double cantilever that tears: load against opening", "opening / m", "load / N", false, false, {}};
  for (const solvers::Method method : {solvers::Method::galerkin, solvers::Method::collocation}) {
    if (context.quick && method == solvers::Method::collocation)
      continue;
    solvers::DiscretisationOptions options;
    options.method = method;
    std::vector<double> load, straightness, balance, reached;
    for (int seed = 1; seed <= seeds; ++seed) {
      const Run run = tear(nodes, last_depth, static_cast<std::uint64_t>(seed), options, context);
      load.push_back(run.load_error);
      straightness.push_back(run.straightness);
      balance.push_back(run.balance);
      reached.push_back(run.depth.back() / run.depth.front());
      for (std::size_t k = 0; k < run.depth.size(); ++k)
        table.add({std::string(solvers::to_string(method)), fmt::format("{}", seed),
                   fmt::format("{:.4f}", run.depth[k]), fmt::format("{:.5g}", run.opening[k]),
                   fmt::format("{:.5g}", run.load[k]), fmt::format("{:.5g}", beam_load(run.opening[k])),
                   fmt::format("{:.5f}", run.height[k])});
      if (seed == 1) {
        figure.series.push_back(
            {std::string(solvers::to_string(method)), run.opening, run.load, app::SeriesStyle::points});
        if (figure.series.size() == 1) {
          app::Series beam{"beams", run.opening, {}, app::SeriesStyle::lines};
          for (const double opening : run.opening)
            beam.y.push_back(beam_load(opening));
          figure.series.push_back(beam);
        }
      }
      context.say(fmt::format("{}, seed {}: {} lengths from {:.2f} to {:.2f}; load off by {:.2f} %, front straight to "
                              "{:.2f} % of the width, energy to {:.2f} %, strays {:.3f} m from the middle",
                              solvers::to_string(method), seed, run.depth.size(), run.depth.front(), run.depth.back(),
                              100 * run.load_error, 100 * run.straightness, 100 * run.balance, run.height.back()));
    }
    const double loose = method == solvers::DiscretisationOptions{}.method ? 1 : 2;
    const std::string name = fmt::format("beam_tearing_{}", solvers::to_string(method));
    checks.push_back({name + "_load", median(load), "<=", 0.07 * loose});
    checks.push_back({name + "_straightness", median(straightness), "<=", 0.1 * loose});
    checks.push_back({name + "_energy_balance", median(balance), "<=", 0.05 * loose});
    checks.push_back({name + "_growth", median(reached), ">=", context.quick ? 1.05 : 2});
  }
  table.write(context.out / "growth.csv");
  app::write_png(figure, context.out / "load.png");
  return checks;
}

} // namespace spherecut::experiments
