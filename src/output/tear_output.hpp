// How a tear is written: rows of tears.csv, figures.
#pragma once

#include "src/output/columns.hpp"
#include "src/output/figure.hpp"
#include "src/session/tear_report.hpp"

namespace spherecut::app {

/// What a row of tears.csv tells of: an increment of a step. The last one also has what the step ended with.
struct TearRow {
  const TearReport& report;
  const TearIncrement& increment;
  bool last;
};
std::span<const Column<TearRow>> tear_columns();
std::vector<TearRow> tear_rows(const TearReport& report);
/// As lines of tears.csv.
std::string tear_lines(const TearReport& report);

/// Energies and torn area over time; `times` and `reports` one a step.
std::vector<std::pair<std::string, Figure>> tear_figures(const std::vector<double>& times,
                                                         const std::vector<TearReport>& reports);

} // namespace spherecut::app
