// summary.json of a run.
#pragma once

#include "src/output/run_output.hpp"

namespace spherecut::app {

/// Inputs, node counts, peak force, solver status, timings and warnings; see docs/scenario.md for the keys.
std::string summary_json(const Session& session, const RunOutput& output, RunStatus status, const std::string& message);

} // namespace spherecut::app
