// How a tear is written: rows of tears.csv, figures.
#pragma once

#include "src/figure.hpp"
#include "src/tear_report.hpp"

#include <string_view>

namespace spherecut::app {

/// First line of tears.csv, with its end of line.
std::string_view tear_columns();
/// Rows of it, one an increment; `report` of a step at `time` s.
std::string tear_rows(const TearReport& report);

/// Energies and torn area over time; `times` and `reports` one a step.
std::vector<std::pair<std::string, Figure>> tear_figures(const std::vector<double>& times,
                                                         const std::vector<TearReport>& reports);

} // namespace spherecut::app
