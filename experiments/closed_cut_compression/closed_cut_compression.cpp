// Problem:   the flat punch of `punch` above a cut that is buried in the half-space: a disc of the punch's radius a,
//            its centre 1.25 a deep, tilted by 9 degrees and shifted. The load closes it.
// Reference: the same punch on the same half-space without cut, at the same spacing under the punch. A closed cut whose
// lips stick is as stiff as uncut
//            tissue; lips that slide soften it by about 1 % for this size and depth. Lips that do not see each other
//            (`open`) are run too: they go through one another, which is the error that contact mends.
// Command:   spherecut experiment run closed_cut_compression --out DIR
#include "experiments/registered.hpp"
#include "experiments/support/cut_body.hpp"
#include "experiments/support/half_space_contact.hpp"
#include "experiments/support/statistics.hpp"
#include "solvers/contact/lip_contact.hpp"
#include "src/output/figure.hpp"
#include "topology/incision/cut_sheets.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

using solvers::LipCondition;
using solvers::Method;

constexpr double depth = 1e-6; // m, of the punch: contact is linear
constexpr double disc_radius = 1, tilt = 9 * std::numbers::pi / 180;
const Vector3 disc_centre(0.031, -0.023, -1.25);
const Vector3 disc_normal(std::sin(tilt) * std::cos(0.7), std::sin(tilt) * std::sin(0.7), std::cos(tilt));

struct Pressed {
  double force = 0;            // N
  double closed = 0;           // part of the pairs that are closed
  double interpenetration = 0; // deepest anywhere on the disc, over the punch's depth
  bool converged = true;
  int nodes = 0, pairs = 0;
};

HalfSpaceCase half_space_case(Method method, int nodes, int seed) {
  return {Indenter::punch, method, 0.3, nodes, static_cast<std::uint64_t>(seed)};
}

HalfSpaceBody cut_half_space(Method method, int nodes, int seed) {
  HalfSpaceCase half_space = half_space_case(method, nodes, seed);
  half_space.cut = {topology::make_disc_sheet(disc_centre, disc_normal, disc_radius, 0.1)};
  return half_space_body(half_space);
}

topology::FlatPunch punch_tool() {
  return {contact_radius, 10 * contact_radius};
}

/// At the spacing of the body with the cut, whose lips cost it nodes.
double uncut_force(Method method, int nodes, int seed, double fine) {
  HalfSpaceCase half_space = half_space_case(method, nodes, seed);
  half_space.fine = fine;
  const HalfSpaceBody body = half_space_body(half_space);
  solvers::ContactOptions options;
  options.gap_tolerance = 1e-9 * depth;
  return solvers::press(body.patch, punch_tool(), topology::pose_at(punch_tool(), {0, 0, -depth}), options)
      .tool_force.z();
}

/// Deepest interpenetration of the lips over the disc, point by point: contact holds back means over the nodes' shares.
double deepest_overlap(const HalfSpaceBody& body, const solvers::Field& field) {
  constexpr int rings = 24, sectors = 36;
  const Vector3 u = disc_normal.unitOrthogonal(), v = disc_normal.cross(u);
  double deepest = 0;
  for (int a = 0; a < rings; ++a)
    for (int b = 0; b < sectors; ++b) {
      const double r = disc_radius * (a + 0.5) / rings, angle = 2 * std::numbers::pi * b / sectors;
      const Vector3 x = disc_centre + r * (std::cos(angle) * u + std::sin(angle) * v);
      deepest = std::max(deepest, -opening_at(*body.body, field, x, disc_normal, body.fine).dot(disc_normal));
    }
  return deepest;
}

Pressed press_cut(const HalfSpaceBody& body, LipCondition condition) {
  solvers::ContactOptions options;
  options.gap_tolerance = 1e-9 * depth;
  const topology::ToolPose pose = topology::pose_at(punch_tool(), {0, 0, -depth});
  const std::vector<solvers::LipPair> pairs = solvers::lip_pairs(body.body->problem().nodes);
  Pressed result;
  result.nodes = body.nodes();
  result.pairs = static_cast<int>(pairs.size());
  solvers::Field field;
  if (condition == LipCondition::open) {
    const solvers::ContactState state = solvers::press(body.patch, punch_tool(), pose, options);
    result.force = state.tool_force.z();
    field = solvers::deform(body.patch, state);
  } else {
    const solvers::LipPatch lips = solvers::condense_lips(*body.body, pairs, condition, &body.patch);
    const solvers::CutContactState state = solvers::press(body.patch, lips, punch_tool(), pose, options);
    result.force = state.tool.tool_force.z();
    result.converged = state.lips.converged && state.tool.converged;
    result.closed = static_cast<double>(std::count(state.lips.closed.begin(), state.lips.closed.end(), char{1})) /
                    static_cast<double>(pairs.size());
    field = solvers::deform(body.patch, lips, state);
  }
  result.interpenetration = deepest_overlap(body, field) / depth;
  return result;
}

} // namespace

std::vector<Check> run_closed_cut_compression(const ExperimentContext& context) {
  const int seeds = context.quick ? 1 : 10;
  constexpr int nodes = 1500;
  std::vector<Check> checks;
  app::Table table({"method", "lips", "seed", "nodes", "pairs", "force_over_uncut", "closed", "interpenetration"});
  app::Figure figure{"Punch above a closed cut", "seed", "force over that of the uncut body", false, false, {}};
  for (Method method : {Method::galerkin, Method::collocation}) {
    std::vector<std::vector<double>> ratios(3);
    double deepest = 0, least_open = 1; // interpenetration in contact, and of open lips
    bool converged = true;
    for (int seed = 1; seed <= seeds; ++seed) {
      const HalfSpaceBody body = cut_half_space(method, nodes, seed);
      const double uncut = uncut_force(method, nodes, seed, body.fine);
      for (LipCondition condition : {LipCondition::open, LipCondition::frictionless, LipCondition::sticking}) {
        const Pressed pressed = press_cut(body, condition);
        ratios[static_cast<std::size_t>(condition)].push_back(pressed.force / uncut);
        if (condition == LipCondition::open) {
          least_open = std::min(least_open, pressed.interpenetration);
        } else {
          deepest = std::max(deepest, pressed.interpenetration);
          converged = converged && pressed.converged;
        }
        table.add({std::string(solvers::to_string(method)), std::string(solvers::to_string(condition)),
                   fmt::format("{}", seed), fmt::format("{}", pressed.nodes), fmt::format("{}", pressed.pairs),
                   fmt::format("{:.4f}", pressed.force / uncut), fmt::format("{:.2f}", pressed.closed),
                   fmt::format("{:.1e}", pressed.interpenetration)});
      }
    }
    for (LipCondition condition : {LipCondition::open, LipCondition::frictionless, LipCondition::sticking}) {
      const std::vector<double>& values = ratios[static_cast<std::size_t>(condition)];
      app::Series series{fmt::format("{}, {}", solvers::to_string(method), solvers::to_string(condition)),
                         {},
                         values,
                         app::SeriesStyle::points};
      for (int seed = 1; seed <= seeds; ++seed)
        series.x.push_back(seed);
      figure.series.push_back(series);
      context.say(fmt::format("{}, lips {}: force over uncut {:.4f} ({:.4f} to {:.4f})", solvers::to_string(method),
                              solvers::to_string(condition), median(values),
                              *std::min_element(values.begin(), values.end()), largest(values)));
      if (condition == LipCondition::open)
        continue;
      const double bound = condition == LipCondition::sticking ? 0.02 : 0.04;
      std::vector<double> errors;
      errors.reserve(values.size());
      for (double value : values)
        errors.push_back(std::abs(value - 1));
      const std::string name =
          fmt::format("closed_cut_{}_{}", solvers::to_string(method), solvers::to_string(condition));
      checks.push_back({name, median(errors), "<=", bound});
      checks.push_back({name + "_worst_seed", largest(errors), "<=", 2 * bound});
    }
    const std::string name = fmt::format("closed_cut_{}", solvers::to_string(method));
    context.say(
        fmt::format("{}: interpenetration over the depth at most {:.4f} in contact, at least {:.3f} of open lips",
                    solvers::to_string(method), deepest, least_open));
    checks.push_back({name + "_interpenetration", deepest, "<=", 0.02});
    checks.push_back({name + "_interpenetration_open", least_open, ">=", 0.2});
    // Lips that slide are softer than those that stick, on every node set.
    double sliding = 0;
    for (std::size_t k = 0; k < ratios[0].size(); ++k)
      sliding = std::max(sliding, ratios[static_cast<std::size_t>(LipCondition::frictionless)][k] /
                                      ratios[static_cast<std::size_t>(LipCondition::sticking)][k]);
    checks.push_back({name + "_frictionless_over_sticking", sliding, "<=", 0.999});
    checks.push_back({name + "_converged", converged ? 1.0 : 0.0, ">=", 1});
  }
  table.write(context.out / "runs.csv");
  app::write_png(figure, context.out / "force.png");
  return checks;
}

} // namespace spherecut::experiments
