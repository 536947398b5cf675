// The rows that a run writes, as dicts: keys are the columns of forces.csv, cuts.csv and tears.csv.
#pragma once

#include "python/bindings/shared.hpp"
#include "src/session/session.hpp"

namespace spherecut::bindings {

py::dict force_row(const app::StepResult& result);
py::dict cut_row(double time, const app::CutReport& report);
py::list tear_rows(const app::TearReport& report);

} // namespace spherecut::bindings
