// Runs and checks scenarios for the command line.
#pragma once

#include <cstdio>
#include <filesystem>

namespace spherecut::app {

class Session;
struct StepResult;

inline constexpr int status_of_interrupted = 130; // exit status of a program that was interrupted

enum class RunEnd { complete, interrupted, differs }; // differs: a replay from its recording

/// Reads the scenario, moves tool and blade along their ways, and leaves the results in `out`. Says how it goes on
/// `screen`. SIGINT and SIGTERM end the run within
/// two seconds, the step at hand given up (interrupt.hpp). Throws InputError and NumericalError; what was
/// written until then stays, and what is refused in its first step leaves nothing.
RunEnd run_scenario(const std::filesystem::path& scenario, const std::filesystem::path& out, std::FILE* screen);

/// Throws NumericalError where what the step found is not finite or larger than any tissue: a run does not write such
/// rows. `step` is the session's last.
void require_tissue(const Session& session, const StepResult& step);

/// Everything that run_scenario() does before the first step: organ, motion, precuts, nodes, fixed regions, and what
/// the run will take. The organ's surface as it is mended goes to `mended` first, unless that is empty. Throws
/// InputError, also where a run would be refused in its first step for a reason that is known before.
void check_scenario(const std::filesystem::path& scenario, const std::filesystem::path& mended, std::FILE* screen);

} // namespace spherecut::app
