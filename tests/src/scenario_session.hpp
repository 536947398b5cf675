// Scenarios from text: what the reader says of them, and sessions of them.
#pragma once

#include "src/session/session.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"

#include <string>
#include <vector>

namespace spherecut::tests {

inline app::Scenario scenario_of(const std::string& text) {
  const TemporaryFolder folder;
  return app::read_scenario(write_file(folder.path() / "case.toml", text));
}

/// What the reader says about the text; empty when it takes it.
inline std::string complaint(const std::string& text) {
  try {
    static_cast<void>(scenario_of(text));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

inline app::Session session_of(const std::string& text) {
  return app::Session(scenario_of(text));
}

/// All steps of a session.
inline std::vector<app::StepResult> run(app::Session& session) {
  std::vector<app::StepResult> results;
  for (const app::StepSample& sample : session.steps())
    results.push_back(session.step(sample));
  return results;
}

} // namespace spherecut::tests
