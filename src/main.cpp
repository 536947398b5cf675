// The command line. Exit status: 0 done, 1 a check of an experiment failed or a replay differs, 2 unusable input or
// command line, 3 numerical failure, 130 interrupted. A server has no other end than an interrupt: that is 0.
#include "solvers/parallel.hpp"
#include "src/haptics/run_haptics.hpp"
#include "src/interrupt.hpp"
#include "src/program.hpp"
#include "src/run.hpp"
#include "src/scenario_keys.hpp"
#include "src/sweep.hpp"
#include "src/version.hpp"
#include "src/viewer/serve.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <fmt/core.h>
#include <string_view>
#include <thread>

namespace {

using namespace spherecut;

int status_of(app::RunEnd end) {
  switch (end) {
  case app::RunEnd::complete:
    return 0;
  case app::RunEnd::interrupted:
    return app::status_of_interrupted;
  case app::RunEnd::differs:
    break;
  }
  return program::status_check_failed;
}

/// Cores of the machine that threads of a solve may have; the real-time loop keeps one for itself.
int default_threads(bool is_real_time) {
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  return std::clamp(is_real_time ? cores - 1 : cores, 1, 16);
}

int run(int argc, char** argv) {
  // Most of what there is to compile is in the experiments: a program of its own.
  if (argc > 1 && argv[1] == std::string_view("experiment"))
    return program::pass_on("spherecut-experiment", argv + 2);
  if (argc > 1 && argv[1] == std::string_view("sweep"))
    app::become_sweep({argv + 2, argv + argc});
  CLI::App commands("Spherecut: pressing, cutting and tearing of soft tissue by the method of finite spheres",
                    "spherecut");
  commands.set_version_flag("--version", fmt::format("spherecut {}", app::version()));
  commands.require_subcommand(1);
  std::string scenario;
  std::string out;
  int threads = 0;
  const auto add_threads = [&](CLI::App* command, const std::string& by_default) {
    command->add_option("--threads", threads,
                        "Threads of a solve, 1 to 256; the results do not depend on it; default " + by_default);
  };

  const auto named = [](const std::string& given) {
    return std::string(given.empty() ? "the name is empty; allowed: the name of a file or folder" : "");
  };

  auto* run_command = commands.add_subcommand("run", "Run a scenario");
  add_threads(run_command, "one a core, at most 16");
  run_command->add_option("scenario", scenario, "TOML file")->required()->check(named);
  run_command->add_option("--out", out, "Folder for the results; must not hold results yet")->required()->check(named);

  auto* check = commands.add_subcommand("check", "Check a scenario without running it");
  check->add_option("scenario", scenario, "TOML file")->required()->check(named);
  check->add_option("--write", out, "Surface file (.obj, .ply) for the organ as it is mended, in the unit of its file")
      ->check(named);

  app::HapticCommand haptic;
  auto* haptics = commands.add_subcommand("haptics", "Hold the tool of a scenario in real time, with a force at 1 kHz");
  auto* held = haptics->add_option("scenario", haptic.scenario, "TOML file")->check(named);
  haptics
      ->add_option("--replay", haptic.replay,
                   "Run a recorded session again off line and compare; in place of a scenario")
      ->check(named)
      ->excludes(held);
  haptics->add_option("--out", haptic.out, "Folder for the results; must not hold results yet")
      ->required()
      ->check(named);
  haptics->add_option("--duration", haptic.duration, "Length of the session, s; default 10");
  haptics->add_flag("--virtual", haptic.in_virtual_time,
                    "Without clock and threads: a solve every budget, the same bits every time");
  haptics
      ->add_option("--solved-every", haptic.solved_stride,
                   "Afterwards solve at every so many ticks for the model's error; 0: not; default 10")
      ->check(CLI::NonNegativeNumber);

  add_threads(haptics, "one a core but one, at most 16");

  app::ServeCommand served;
  auto* serve = commands.add_subcommand("serve", "Press and cut in a browser: a live session at http://ADDRESS:PORT/");
  serve->add_option("scenario", served.scenario, "TOML file; default liver_live.toml of those that come along")
      ->check(named);
  serve->add_option("--port", served.port, "Port; 0: any free one; default 8080");
  serve->add_option("--address", served.address, "IP address; default 127.0.0.1, this machine alone");
  serve->add_flag("--open", served.open, "Open the page in a browser");
  serve->add_option("--out", served.out, "Folder for recordings; default out/serve")->check(named);
  serve->add_option("--page", served.page, "Folder of the built page; default: beside the program or as installed")
      ->check(named);

  add_threads(serve, "one a core but one, at most 16");

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

  bool has_threads = false;
  for (const CLI::App* command : {run_command, haptics, serve})
    has_threads = has_threads || (command->parsed() && command->count("--threads") > 0);
  solvers::set_thread_count(has_threads ? threads : default_threads(haptics->parsed() || serve->parsed()));

  if (!help->parsed())
    program::require_resources(haptics->parsed() || serve->parsed());
  if (run_command->parsed())
    return status_of(app::run_scenario(scenario, out, stdout));
  if (haptics->parsed())
    return status_of(app::run_haptics(haptic, stdout));
  if (serve->parsed())
    return status_of(app::serve(served, stdout));
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
