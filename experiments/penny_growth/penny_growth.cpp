// Problem:   a penny crack filled with a prescribed volume of fluid tears on from radius a to 1.5 a. At every size the
//            volume is raised until the release rate reaches the toughness somewhere; then the front grows by up to
//            half a spacing. Then the same at a prescribed pressure, which runs away.
// Reference: [Sneddon 1946]: growth begins at p = sqrt(pi G_c E* / (4 a)), E* = E / (1 - nu^2), and follows a^-1/2; the
//            crack stays round. Its surroundings are held at the displacement of the round crack of the same area.
// Command:   spherecut experiment run penny_growth --out DIR
#include "experiments/analytic/cracks.hpp"
#include "experiments/registered.hpp"
#include "experiments/support/cut_body.hpp"
#include "experiments/support/statistics.hpp"

#include "solvers/fracture/tearing.hpp"
#include "src/output/figure.hpp"
#include "topology/incision/cut_sheets.hpp"
#include "topology/incision/front_growth.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <numbers>

namespace spherecut::experiments {

namespace {

constexpr double pi = std::numbers::pi, radius = 1, toughness = 1;
const solvers::Material material{1, 0.3, 0};
const CutFrame crack = tilted_frame({0.03, -0.05, 0.04}, {0.22, -0.17, 0.1});

double exact_pressure(double a) {
  const double modulus = material.young_modulus / (1 - material.poisson_ratio * material.poisson_ratio);
  return std::sqrt(pi * toughness * modulus / (4 * a));
}

/// The crack at one size, under unit pressure.
struct Size {
  double area = 0, radius = 0; // m2; m, of the circle of that area
  double roundness = 0;        // (largest - smallest distance of the front from its middle) / 2 / their mean
  double volume = 0;           // m3
  double release = 0;          // J/m2, largest along the front
  double spacing = 0;          // m
  topology::FrontGrowth grown;
};

Size solve_size(const std::vector<topology::SurfaceMesh>& sheets, int nodes, std::uint64_t seed,
                const solvers::DiscretisationOptions& options) {
  CutBodyCase cut;
  cut.domain = topology::make_box_domain({-3, -3, -3}, {3, 3, 3}, 0.75);
  cut.sheets = sheets;
  cut.slope = 0.25;
  cut.nodes = nodes;
  cut.seed = seed;
  cut.method = options.method;
  CutBody body = cut_body(cut);
  body.problem.material = material;
  const topology::Incision& incision = *body.problem.incision;
  Size size;
  size.area = incision.area();
  size.radius = std::sqrt(size.area / pi);
  size.spacing = body.fine;
  Vector3 middle = Vector3::Zero();
  for (const topology::FrontSegment& segment : incision.front())
    middle += (segment.to - segment.from).norm() * 0.5 * (segment.from + segment.to);
  middle /= incision.front_length();
  double least = 1e300, most = 0;
  for (const topology::FrontSegment& segment : incision.front()) {
    least = std::min(least, (segment.from - middle).norm());
    most = std::max(most, (segment.from - middle).norm());
  }
  size.roundness = (most - least) / (most + least);
  hold_whole_surface(body.problem,
                     [a = size.radius](const Vector3& x) { return penny_displacement(material, crack, a, 1, x); });
  body.problem.loads.lip_traction = [](const Vector3&, const Vector3& n) -> Vector3 { return -n; };
  const auto discretisation = solvers::discretise(body.problem, options);
  const solvers::Field field = discretisation->solve();
  // Volume: the opening over the sheet's triangles.
  for (const topology::SurfaceMesh& sheet : incision.sheets())
    for (const Triangle& t : sheet.triangles) {
      const Vector3 &a = sheet.vertices[t[0]], &b = sheet.vertices[t[1]], &c = sheet.vertices[t[2]];
      const Vector3 area = 0.5 * (b - a).cross(c - a), n = area.normalized(), centre = (a + b + c) / 3;
      for (const Vector3& corner : {a, b, c}) {
        const Vector3 x = 0.5 * (centre + corner);
        size.volume += area.norm() / 3 * opening_at(*discretisation, field, x, n, body.fine).dot(n);
      }
    }
  const auto states = solvers::averaged(
      material,
      solvers::front_states(
          *discretisation, field, [](const Vector3&) { return toughness; }, 2 * pi * size.radius / 24.01),
      1.5 * body.fine);
  for (const solvers::FrontState& state : states)
    size.release = std::max(size.release, state.release);
  // The volume goes on rising until the front has moved by half a spacing. At one volume G falls as a^-5: so much of it
  // is there when the step begins that it is back at the toughness when it ends.
  std::vector<solvers::FrontState> acting = states;
  for (solvers::FrontState& state : acting)
    state.release *= std::pow(1 + 0.5 * body.fine / size.radius, 5) * toughness / size.release;
  size.grown =
      topology::grow_front(incision, solvers::tear_motion(acting, 0.5 * body.fine, body.fine), 0.5 * body.fine);
  return size;
}

struct Growth {
  std::vector<double> radius, pressure, volume, roundness;
  double onset_error = 0, law_error = 0, worst_roundness = 0, balance = 0;
  bool runs_away = false; // at the pressure of the onset
};

Growth grow(int nodes, int steps, std::uint64_t seed, const solvers::DiscretisationOptions& options) {
  Growth growth;
  std::vector<topology::SurfaceMesh> sheets{topology::make_disc_sheet(crack.origin, crack.normal, radius, 0.1)};
  double work = 0, dissipated = 0, stored_first = 0, stored_last = 0, last_area = 0, last_release = 0;
  growth.runs_away = true;
  for (int step = 0; step <= steps; ++step) {
    const Size size = solve_size(sheets, nodes, seed, options);
    const double pressure = std::sqrt(toughness / size.release), volume = pressure * size.volume;
    // Fluid pushed in between the sizes, and what it went into.
    const double stored = 0.5 * pressure * volume;
    if (step == 0) {
      stored_first = stored;
      growth.onset_error = std::abs(pressure / exact_pressure(radius) - 1);
    } else {
      // Work of the fluid along p = c V^s, the power law through both ends.
      const double last_pressure = growth.pressure.back(), last_volume = growth.volume.back();
      const double power = std::log(pressure / last_pressure) / std::log(volume / last_volume);
      work += (pressure * volume - last_pressure * last_volume) / (power + 1);
      dissipated += toughness * (size.area - last_area);
      growth.runs_away = growth.runs_away && size.release > last_release; // more release at the same pressure
    }
    stored_last = stored;
    last_area = size.area;
    last_release = size.release;
    growth.radius.push_back(size.radius);
    growth.pressure.push_back(pressure);
    growth.volume.push_back(volume);
    growth.roundness.push_back(size.roundness);
    growth.law_error = std::max(growth.law_error, std::abs(pressure * std::sqrt(size.radius) / exact_pressure(1) - 1));
    growth.worst_roundness = std::max(growth.worst_roundness, size.roundness);
    if (size.radius >= 1.5 * radius)
      break;
    sheets = size.grown.sheets;
  }
  // At onset, W - dU = G_c dA: the part of the work that opens the crack is half of it, the rest is stored.
  if (dissipated > 0)
    growth.balance = std::abs(work - (stored_last - stored_first) - dissipated) / dissipated;
  return growth;
}

} // namespace

std::vector<Check> run_penny_growth(const ExperimentContext& context) {
  const int seeds = context.quick ? 1 : 3, nodes = context.quick ? 1500 : 2400, steps = context.quick ? 2 : 40;
  std::vector<Check> checks;
  app::Table table({"method", "seed", "radius", "pressure", "exact_pressure", "volume", "roundness"});
  app::Figure figure{"Pressure at which a penny crack grows", "radius / m", "pressure / Pa", false, false, {}};
  app::Series law{"exact", {}, {}, app::SeriesStyle::lines};
  for (int i = 0; i <= 50; ++i) {
    law.x.push_back(radius + 0.01 * i);
    law.y.push_back(exact_pressure(law.x.back()));
  }
  figure.series.push_back(law);
  for (const solvers::Method method : {solvers::Method::galerkin, solvers::Method::collocation}) {
    solvers::DiscretisationOptions options;
    options.method = method;
    std::vector<double> onset, follow, roundness, balance, away;
    for (int seed = 1; seed <= seeds; ++seed) {
      const Growth growth = grow(nodes, steps, static_cast<std::uint64_t>(seed), options);
      onset.push_back(growth.onset_error);
      follow.push_back(growth.law_error);
      roundness.push_back(growth.worst_roundness);
      balance.push_back(growth.balance);
      away.push_back(growth.runs_away ? 1 : 0);
      for (std::size_t k = 0; k < growth.radius.size(); ++k)
        table.add({std::string(solvers::to_string(method)), fmt::format("{}", seed),
                   fmt::format("{:.5f}", growth.radius[k]), fmt::format("{:.5f}", growth.pressure[k]),
                   fmt::format("{:.5f}", exact_pressure(growth.radius[k])), fmt::format("{:.5f}", growth.volume[k]),
                   fmt::format("{:.5f}", growth.roundness[k])});
      if (seed == 1)
        figure.series.push_back(
            {std::string(solvers::to_string(method)), growth.radius, growth.pressure, app::SeriesStyle::points});
      context.say(fmt::format(
          "{}, seed {}: {} sizes to radius {:.3f}; onset off by {:.2f} %, a^-1/2 by {:.2f} %, round "
          "to {:.2f} %, energy to {:.2f} %",
          solvers::to_string(method), seed, growth.radius.size(), growth.radius.back(), 100 * growth.onset_error,
          100 * growth.law_error, 100 * growth.worst_roundness, 100 * growth.balance));
    }
    const double loose = method == solvers::DiscretisationOptions{}.method ? 1 : 2;
    const std::string name = fmt::format("penny_growth_{}", solvers::to_string(method));
    checks.push_back({name + "_onset", median(onset), "<=", 0.05 * loose});
    checks.push_back({name + "_pressure_over_radius", median(follow), "<=", 0.06 * loose});
    checks.push_back({name + "_roundness", median(roundness), "<=", 0.05 * loose});
    checks.push_back({name + "_energy_balance", median(balance), "<=", 0.05 * loose});
    checks.push_back({name + "_runs_away_at_prescribed_pressure", median(away), ">=", 1});
  }
  table.write(context.out / "growth.csv");
  app::write_png(figure, context.out / "pressure.png");
  return checks;
}

} // namespace spherecut::experiments
