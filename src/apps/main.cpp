// The command line of runs, which passes the other commands on to their programs. Exit status: 0 done, 1 a check of an
// experiment failed or a replay differs, 2 unusable input or command line, 3 numerical failure, 130 interrupted. A
// server has no other end than an interrupt: that is 0.
#include "solvers/algebra/parallel.hpp"
#include "src/apps/program.hpp"
#include "src/base/version.hpp"
#include "src/run/run.hpp"
#include "src/run/sweep.hpp"
#include "src/scenario/keys.hpp"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <fmt/core.h>
#include <string_view>

namespace {

using namespace spherecut;

int run(int argc, char** argv) {
  // Programs of their own, so that whoever runs scenarios need not compile them.
  if (argc > 1 && argv[1] == std::string_view("experiment"))
    return program::pass_on("spherecut-experiment", argv + 2);
  if (argc > 1 && (argv[1] == std::string_view("haptics") || argv[1] == std::string_view("serve")))
    return program::pass_on("spherecut-live", argv + 1);
  if (argc > 1 && argv[1] == std::string_view("sweep"))
    app::become_sweep({argv + 2, argv + argc});
  CLI::App commands("Spherecut: pressing, cutting and tearing of soft tissue by the method of finite spheres",
                    "spherecut");
  commands.set_version_flag("--version", fmt::format("spherecut {}", app::version()));
  commands.require_subcommand(1);
  std::string scenario;
  std::string out;
  int threads = 0;

  const auto named = [](const std::string& given) {
    return std::string(given.empty() ? "the name is empty; allowed: the name of a file or folder" : "");
  };

  auto* run_command = commands.add_subcommand("run", "Run a scenario");
  run_command->add_option("--threads", threads, program::about_threads("one a core, at most 16"));
  run_command->add_option("scenario", scenario, "TOML file")->required()->check(named);
  run_command->add_option("--out", out, "Folder for the results; must not hold results yet")->required()->check(named);

  auto* check = commands.add_subcommand("check", "Check a scenario without running it");
  check->add_option("scenario", scenario, "TOML file")->required()->check(named);
  check->add_option("--write", out, "Surface file (.obj, .ply) for the organ as it is mended, in the unit of its file")
      ->check(named);

  commands.add_subcommand("haptics", "Hold the tool of a scenario in real time, with a force at 1 kHz");
  commands.add_subcommand("serve", "Press and cut in a browser: a live session at http://ADDRESS:PORT/");
  commands.add_subcommand("experiment", "List or run the experiments");
  commands.add_subcommand("sweep", "Run a scenario over many values of its keys: one table, figures; sweep --help");

  auto* help = commands.add_subcommand("scenario-help", "Every key of a scenario file");
  bool markdown = false;
  help->add_flag("--markdown", markdown, "As the reference part of docs/scenario.md");

  try {
    commands.parse(argc, argv);
  } catch (const CLI::Success& success) { // --help, --version
    return program::ended(commands.exit(success));
  } catch (const CLI::ParseError& error) {
    return program::complain(program::what_is_wrong(commands, argc, argv, error), program::status_bad_input);
  }

  solvers::set_thread_count(run_command->count("--threads") > 0 ? threads : program::threads_unless_told(0));
  if (!help->parsed())
    program::require_resources(false);
  if (run_command->parsed())
    return program::status_of(app::run_scenario(scenario, out, stdout));
  if (check->parsed())
    app::check_scenario(scenario, out, stdout);
  else
    std::fputs((markdown ? app::scenario_reference() : app::scenario_help()).c_str(), stdout);
  return program::ended(0);
}

} // namespace

int main(int argc, char** argv) {
  return spherecut::program::start(argc, argv, run);
}
