#include "experiments/support/front_profile.hpp"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <numeric>

namespace spherecut::experiments {

namespace {

double largest_error(const std::vector<solvers::Intensities>& found, const std::vector<solvers::Intensities>& exact,
                     const std::vector<int>& modes) {
  double worst = 0;
  for (std::size_t i = 0; i < found.size(); ++i)
    for (const int mode : modes)
      worst = std::max(worst, std::abs(found[i][mode] - exact[i][mode]));
  return worst;
}

} // namespace

double FrontProfile::largest() const {
  double k = 0;
  for (const solvers::Intensities& at : exact)
    k = std::max(k, at.cwiseAbs().maxCoeff());
  return k;
}

double FrontProfile::integral_error(const std::vector<int>& modes, double scale) const {
  return largest_error(integral, exact, modes) / scale;
}

double FrontProfile::correlation_error(const std::vector<int>& modes, double scale) const {
  return largest_error(correlation, exact, modes) / scale;
}

FrontProfile front_profile(const solvers::Discretisation& body, const solvers::Field& field, double spacing,
                           const std::function<FrontPlace(const topology::FrontFrame&)>& exact) {
  FrontProfile profile;
  for (const solvers::FrontState& state : solvers::front_states(
           body, field, [](const Vector3&) { return 1.0; }, spacing)) {
    const FrontPlace place = exact(state.frame);
    profile.frames.push_back(state.frame);
    profile.angle.push_back(place.angle);
    profile.exact.push_back(place.exact);
    profile.integral.push_back(state.intensities);
    profile.correlation.push_back(solvers::displacement_correlation(body, field, state.frame));
  }
  return profile;
}

app::Figure front_figure(const FrontProfile& profile, const std::vector<int>& modes, const std::string& title,
                         const std::string& angle_label) {
  app::Figure figure{title, angle_label, "K / largest K", false, false, {}};
  std::vector<std::size_t> order(profile.angle.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return profile.angle[a] < profile.angle[b]; });
  for (const int mode : modes) {
    const std::string name = std::array{"K_I", "K_II", "K_III"}[mode];
    app::Series exact{name + " exact", {}, {}, app::SeriesStyle::lines}, found{name, {}, {}, app::SeriesStyle::points};
    for (const std::size_t i : order) {
      exact.x.push_back(profile.angle[i]);
      exact.y.push_back(profile.exact[i][mode] / profile.largest());
      found.x.push_back(profile.angle[i]);
      found.y.push_back(profile.integral[i][mode] / profile.largest());
    }
    figure.series.push_back(exact);
    figure.series.push_back(found);
  }
  return figure;
}

app::Table front_table() {
  return app::Table({"case", "seed", "nodes", "spacing", "angle", "k1_exact", "k2_exact", "k3_exact", "k1_integral",
                     "k2_integral", "k3_integral", "k1_correlation", "k2_correlation", "k3_correlation"});
}

void add_to_table(app::Table& table, const std::string& name, int seed, int nodes, double spacing,
                  const FrontProfile& profile) {
  for (std::size_t i = 0; i < profile.angle.size(); ++i) {
    std::vector<std::string> row{name, fmt::format("{}", seed), fmt::format("{}", nodes),
                                 fmt::format("{:.4f}", spacing), fmt::format("{:.4f}", profile.angle[i])};
    for (const auto* k : {&profile.exact[i], &profile.integral[i], &profile.correlation[i]})
      for (int mode = 0; mode < 3; ++mode)
        row.push_back(fmt::format("{:.5f}", (*k)[mode]));
    table.add(row);
  }
}

std::vector<Check> run_placements(const ExperimentContext& context, const PlacedRun& run) {
  std::vector<Check> checks;
  app::Table table = front_table();
  for (const Placement placement : precut_placements(context.quick))
    run(context, placement, table, checks);
  table.write(context.out / "fronts.csv");
  return checks;
}

} // namespace spherecut::experiments
