// The command line of sessions in real time, which `spherecut haptics` and `spherecut serve` pass on to. Exit status as
// src/apps/main.cpp says.
#include "solvers/algebra/parallel.hpp"
#include "src/apps/program.hpp"
#include "src/live/run_haptics.hpp"
#include "src/viewer/serve.hpp"

#include <CLI/CLI.hpp>

namespace {

using namespace spherecut;

int run(int argc, char** argv) {
  CLI::App commands("Sessions in real time", "spherecut");
  commands.require_subcommand(1);
  int threads = 0;
  const auto named = [](const std::string& given) {
    return std::string(given.empty() ? "the name is empty; allowed: the name of a file or folder" : "");
  };

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
  haptics
      ->add_flag("--bench", haptic.bench,
                 "A press, a tap, a slide and a cut with the device of the scenario (left out: a simulated hand), and "
                 "what they were like in figures; with a real device --duration each")
      ->excludes("--replay");
  haptics->add_flag("--virtual", haptic.in_virtual_time,
                    "Without clock and threads: a solve every budget, the same bits every time");
  haptics
      ->add_option("--solved-every", haptic.solved_stride,
                   "Afterwards solve at every so many ticks for the model's error; 0: not; default 10")
      ->check(CLI::NonNegativeNumber);

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
  for (CLI::App* command : {haptics, serve})
    command->add_option("--threads", threads, program::about_threads("one a core but one, at most 16"));

  try {
    commands.parse(argc, argv);
  } catch (const CLI::Success& success) { // --help
    return program::ended(commands.exit(success));
  } catch (const CLI::ParseError& error) {
    return program::complain(program::what_is_wrong(commands, argc, argv, error), program::status_bad_input);
  }

  const CLI::App* const command = haptics->parsed() ? haptics : serve;
  // The loop keeps a core for itself.
  solvers::set_thread_count(command->count("--threads") > 0 ? threads : program::threads_unless_told(1));
  program::require_resources(true);
  return program::status_of(haptics->parsed() ? app::run_haptics(haptic, stdout) : app::serve(served, stdout));
}

} // namespace

int main(int argc, char** argv) {
  return spherecut::program::start(argc, argv, run);
}
