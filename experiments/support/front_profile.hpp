// Intensities along the front of a cut beside the exact ones, their errors, and a figure of them.
#pragma once

#include "experiments/support/precut_series.hpp"

#include "solvers/fracture/tearing.hpp"
#include "src/output/figure.hpp"

#include <functional>
#include <string>
#include <vector>

namespace spherecut::experiments {

/// Exact intensities at a place of the front, and where it lies along it, rad.
struct FrontPlace {
  double angle = 0;
  solvers::Intensities exact = Vector3::Zero();
};

struct FrontProfile {
  std::vector<topology::FrontFrame> frames;
  std::vector<double> angle;                                      // rad
  std::vector<solvers::Intensities> exact, integral, correlation; // Pa sqrt(m)
  [[nodiscard]] double largest() const;                           // of the exact intensities
  /// Largest error along the front of the given modes over `scale`: by the integral, as a tear takes it, or by the
  /// jump.
  [[nodiscard]] double integral_error(const std::vector<int>& modes, double scale) const;
  [[nodiscard]] double correlation_error(const std::vector<int>& modes, double scale) const;
};

/// At places about `spacing` m apart. The integral is that of front_states(), as tearing uses it.
FrontProfile front_profile(const solvers::Discretisation& body, const solvers::Field& field, double spacing,
                           const std::function<FrontPlace(const topology::FrontFrame&)>& exact);

/// The modes given, over the largest exact intensity: lines are exact, points found by the integral.
app::Figure front_figure(const FrontProfile& profile, const std::vector<int>& modes, const std::string& title,
                         const std::string& angle_label);

/// What a run of a precut experiment with a front gives to its table.
app::Table front_table();
void add_to_table(app::Table& table, const std::string& name, int seed, int nodes, double spacing,
                  const FrontProfile& profile);

/// Runs an experiment at every placement, and writes its table as fronts.csv.
using PlacedRun = std::function<void(const ExperimentContext& context, Placement placement, app::Table& table,
                                     std::vector<Check>& checks)>;
std::vector<Check> run_placements(const ExperimentContext& context, const PlacedRun& run);

} // namespace spherecut::experiments
