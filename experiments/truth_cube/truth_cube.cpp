// Problem:   the Truth Cube: silicone RTV6166, 80 mm, with beads on a grid of 10 mm, compressed by a plate to 5, 12.5
// and
//            18.25 % and pressed by a ball of 25.4 mm diameter to 22 and 36 % of its height. A quarter of it at finite
//            strain, neo-Hookean, nu = 0.49; plates that slip or hold.
// Measured:  stiffness under the plate 798 N/m, with beads 780 N/m [Kerdok and others 2003]. The modulus is fitted to
//            the force at 5 %; force and shape at the others are predicted. Forces and beads at the others were not to
//            be had: the predictions are written down, and what is checked is that they are the law's.
// Reference: closed form of the law under plates that slip; the same on other nodes.
// Command:   spherecut experiment run truth_cube --out DIR
#include "experiments/analytic/finite_strain.hpp"
#include "experiments/measured.hpp"
#include "experiments/support/finite_block.hpp"

#include "src/output/figure.hpp"
#include "topology/base/errors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <string>

namespace spherecut::experiments {

namespace {

constexpr double edge = 0.08, half = 0.5 * edge, ball_radius = 0.0127; // m
constexpr double measured_stiffness = 798;                             // N/m
constexpr double poisson_ratio = 0.49;
constexpr std::array plate_strains{0.025, 0.05, 0.075, 0.1, 0.125, 0.155, 0.1825};
constexpr double fitted_at = 0.05, ball_step = 0.01;

const std::vector<double> plate_loads = {0.05, 0.125, 0.1825};

enum class Plates { slip, hold };

std::string name_of(Plates plates) {
  return plates == Plates::slip ? "slip" : "hold";
}

/// Displacement of a bead at one load.
struct Bead {
  Vector3 rest, moved;
};

struct Load {
  std::string name;
  double strain = 0;
  double force = 0; // N, of the whole cube, at a shear modulus of 1 Pa
  double bulge = 0; // m, outward, of the middle of a side
  double least_jacobian = 1;
  std::vector<Bead> beads;
};

struct Pressed {
  int nodes = 0;
  std::vector<Load> loads;
  [[nodiscard]] double reached() const { return loads.empty() ? 0 : loads.back().strain; }
  [[nodiscard]] const Load& at(double strain) const {
    return *std::min_element(loads.begin(), loads.end(), [strain](const Load& a, const Load& b) {
      return std::abs(a.strain - strain) < std::abs(b.strain - strain);
    });
  }
};

/// A quarter between its planes of symmetry x = 0 and y = 0.
HeldFaces held_faces(Plates plates, bool top) {
  HeldFaces held{};
  held[0][0] = held[2][1] = held[4][2] = true;
  held[5][2] = top;
  if (plates == Plates::hold) {
    held[4].fill(true);
    if (top)
      held[5].fill(true);
  }
  return held;
}

Load load_of(const solvers::FiniteBody& body, const solvers::Equilibrium& equilibrium, std::string name, double strain,
             double force, const solvers::EquilibriumStatus& status) {
  Load load{std::move(name), strain, force, 0, status.least_jacobian, {}};
  const VectorX& u = equilibrium.coefficients();
  load.bulge = body.at({half, 0, half}, u).displacement.x();
  for (int i = 0; i <= 3; ++i)
    for (int j = 0; j <= 3; ++j)
      for (int k = 1; k <= 7; ++k) {
        const Vector3 x = 0.01 * Vector3(i, j, k);
        load.beads.push_back({x, x + body.at(x, u).displacement});
      }
  return load;
}

Pressed press_plate(Plates plates, double spacing) {
  const solvers::FiniteBody body(
      finite_block({.upper = {half, half, edge}, .spacing = spacing, .jitter = 0.2, .held = held_faces(plates, true)}),
      neo_hookean(1, poisson_ratio));
  solvers::EquilibriumOptions accurate;
  accurate.tolerance = 1e-4;
  solvers::Equilibrium equilibrium(body, accurate);
  Pressed pressed{body.size(), {}};
  for (const double strain : plate_strains) {
    const auto status = equilibrium.solve({body.prescribed_values([strain](const Vector3& x) {
                                             return Vector3(0, 0, x.z() > edge - 1e-9 ? -strain * edge : 0);
                                           }),
                                           1,
                                           {}});
    const double force = -4 * face_force(body, equilibrium.constraint_forces(), 2, edge).z();
    pressed.loads.push_back(load_of(body, equilibrium, "plate", strain, force, status));
  }
  return pressed;
}

/// The ball stands on the axis of symmetry; the nodes are fine where it presses. As far as an equilibrium is found.
Pressed press_ball(Plates plates, double fine, double deepest, const std::function<void(const std::string&)>& say) {
  solvers::SpacingField spacing;
  spacing.fine = fine;
  spacing.coarse = 0.012;
  spacing.slope = 0.3;
  spacing.radius = ball_radius;
  spacing.centres = {{0, 0, edge}};
  const solvers::FiniteBody body(
      finite_block(
          {.upper = {half, half, edge}, .spacing = fine, .held = held_faces(plates, false), .graded = spacing}),
      neo_hookean(1, poisson_ratio));
  solvers::Equilibrium equilibrium(body);
  const topology::SphereTip ball{ball_radius};
  std::vector<int> candidates;
  const solvers::NodeCloud& nodes = body.problem().nodes;
  for (int i = 0; i < nodes.size(); ++i)
    if (nodes.positions[i].z() > edge - 1e-9)
      candidates.push_back(i);
  equilibrium.set_contact(ball, candidates);
  Pressed pressed{body.size(), {}};
  const int steps = static_cast<int>(std::lround(deepest / ball_step));
  for (int k = 1; k <= steps; ++k) {
    const double strain = deepest * k / steps;
    solvers::EquilibriumStatus status;
    try {
      status = equilibrium.solve({{}, 1, topology::pose_at(ball, {0, 0, edge * (1 - strain)})});
    } catch (const NumericalError& error) {
      say(fmt::format("  ball at {:.2f} %, {} nodes: {}", 100 * strain, body.size(), error.what()));
      break;
    }
    pressed.loads.push_back(load_of(body, equilibrium, "ball", strain, 4 * status.tool_force.z(), status));
  }
  return pressed;
}

/// Largest change of the forces at the given loads from other nodes to these, over the forces; of loads that both have
/// reached.
double change_of_force(const Pressed& coarser, const Pressed& finer, const std::vector<double>& strains) {
  double change = 0;
  for (const double strain : strains)
    if (strain <= std::min(coarser.reached(), finer.reached()) + 1e-9)
      change = std::max(change, std::abs(coarser.at(strain).force / finer.at(strain).force - 1));
  return change;
}

} // namespace

std::vector<Check> run_truth_cube(const ExperimentContext& context) {
  std::vector<Check> checks;
  app::Table forces({"plates", "tool", "nodes", "strain", "force_N", "bulge_mm", "least_jacobian"});
  app::Table beads({"plates", "tool", "strain", "x_mm", "y_mm", "z_mm", "moved_x_mm", "moved_y_mm", "moved_z_mm"});
  app::Figure figure{
      "Truth Cube: predicted from the stiffness at 5 %", "travel / height", "force / N", false, false, {}};
  const std::vector<double> ball_loads = context.quick ? std::vector{0.1} : std::vector{0.22, 0.36};
  const double deepest = ball_loads.back();
  for (const Plates plates : {Plates::slip, Plates::hold}) {
    const std::string name = name_of(plates);
    const Pressed plate_coarser = press_plate(plates, context.quick ? 0.02 : 0.0133);
    const Pressed plate = press_plate(plates, context.quick ? 0.0133 : 0.01);
    const Pressed ball_coarser = press_ball(plates, context.quick ? 0.007 : 0.0045, deepest, context.say);
    const Pressed ball = press_ball(plates, context.quick ? 0.006 : 0.0035, deepest, context.say);
    const double shear_modulus = measured_stiffness * fitted_at * edge / plate.at(fitted_at).force; // Pa
    context.say(fmt::format("plates that {}: E = {:.2f} kPa", name, 2e-3 * (1 + poisson_ratio) * shear_modulus));
    for (const Pressed* pressed : {&plate, &ball}) {
      app::Series series{fmt::format("{}, plates that {}", pressed->loads.front().name, name), {}, {}};
      for (const Load& load : pressed->loads) {
        const double force = shear_modulus * load.force;
        series.x.push_back(load.strain);
        series.y.push_back(force);
        forces.add({name, load.name, fmt::format("{}", pressed->nodes), fmt::format("{:.4f}", load.strain),
                    fmt::format("{:.4f}", force), fmt::format("{:.3f}", 1e3 * load.bulge),
                    fmt::format("{:.3f}", load.least_jacobian)});
      }
      figure.series.push_back(series);
      const auto tell = [&](double strain) {
        const Load& load = pressed->at(strain);
        context.say(fmt::format("  {} at {:.2f} %, {} nodes: {:.3f} N, sides bulge by {:.2f} mm, least J {:.3f}",
                                load.name, 100 * load.strain, pressed->nodes, shear_modulus * load.force,
                                1e3 * load.bulge, load.least_jacobian));
        for (const Bead& bead : load.beads) {
          std::vector<std::string> row{name, load.name, fmt::format("{:.4f}", load.strain)};
          for (const Vector3* x : {&bead.rest, &bead.moved})
            for (int axis = 0; axis < 3; ++axis)
              row.push_back(fmt::format("{:.3f}", 1e3 * (*x)[axis]));
          beads.add(row);
        }
      };
      for (const double strain : pressed == &plate ? plate_loads : ball_loads)
        if (strain <= pressed->reached() + 1e-9)
          tell(strain);
    }
    if (plates == Plates::slip) {
      // Every plane across the load stays plane.
      double worst = 0;
      for (const Load& load : plate.loads) {
        const BlockState exact =
            block_state(*neo_hookean(1, poisson_ratio), {1, 1, 1 - load.strain}, {false, false, true});
        worst = std::max({worst, std::abs(load.force / (-edge * edge * exact.stress.z()) - 1),
                          std::abs(load.bulge / (half * (exact.stretch.x() - 1)) - 1)});
      }
      context.say(fmt::format("  off the closed form by {:.4f} %", 100 * worst));
      checks.push_back({"truth_cube_slip_closed_form", worst, "<=", 0.003});
    }
    checks.push_back({fmt::format("truth_cube_{}_plate_spacing", name),
                      change_of_force(plate_coarser, plate, plate_loads), "<=", context.quick ? 0.08 : 0.03});
    checks.push_back({fmt::format("truth_cube_{}_ball_spacing", name), change_of_force(ball_coarser, ball, ball_loads),
                      "<=", context.quick ? 0.3 : 0.05});
    checks.push_back({fmt::format("truth_cube_{}_ball_reached", name), ball.reached(), ">=", deepest - 1e-9});
    checks.push_back({fmt::format("truth_cube_{}_stiffening_reported", name),
                      plate.at(plate_loads.back()).force / plate_loads.back() / (plate.at(fitted_at).force / fitted_at),
                      ">=", 0});
  }
  forces.write(context.out / "forces.csv");
  beads.write(context.out / "beads.csv");
  app::write_png(figure, context.out / "forces.png");
  return checks;
}

} // namespace spherecut::experiments
