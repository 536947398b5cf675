// The command line. Exit status: 0 done, 1 a check of an experiment failed or a replay differs, 2 unusable input or
// command line, 3 numerical failure, 130 interrupted. A server has no other end than an interrupt: that is 0.
#include "experiments/experiment.hpp"
#include "solvers/parallel.hpp"
#include "src/haptics/run_haptics.hpp"
#include "src/interrupt.hpp"
#include "src/printable.hpp"
#include "src/process_settings.hpp"
#include "src/run.hpp"
#include "src/scenario_keys.hpp"
#include "src/sweep.hpp"
#include "src/version.hpp"
#include "src/viewer/serve.hpp"
#include "topology/errors.hpp"
#include "topology/interruption.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <fmt/core.h>
#include <poll.h>
#include <string_view>
#include <system_error>
#include <thread>
#include <unistd.h>

namespace {

using namespace spherecut;

constexpr int status_check_failed = 1;
constexpr int status_bad_input = 2;
constexpr int status_numerical = 3;

int complain(const std::string& message, int status) {
  fmt::print(stderr, "spherecut: error: {}\n", app::printable(message));
  return status;
}

int status_of(app::RunEnd end) {
  switch (end) {
  case app::RunEnd::complete:
    return 0;
  case app::RunEnd::interrupted:
    return app::status_of_interrupted;
  case app::RunEnd::differs:
    break;
  }
  return status_check_failed;
}

/// Of the exception at hand.
std::string what_failed() {
  try {
    throw;
  } catch (const NumericalError& error) {
    return error.what();
  } catch (const std::bad_alloc&) {
    return "out of memory; use fewer nodes, fewer threads or a coarser mesh";
  } catch (const std::system_error& error) {
    if (error.code() == std::errc::resource_unavailable_try_again)
      return fmt::format("no thread can be made ({}); more processes or memory must be allowed (ulimit -u, -v)",
                         error.what());
    return fmt::format("the system refuses: {}", error.what());
  } catch (const std::exception& error) {
    return fmt::format("unexpected: {}", error.what());
  } catch (...) {
    return "unexpected: an exception without a text";
  }
}

void list_experiments(bool names_only) {
  for (const experiments::Experiment& experiment : experiments::all_experiments())
    std::fputs((names_only ? fmt::format("{}\n", experiment.name)
                           : fmt::format("{:<24} {}\n", experiment.name, experiment.purpose))
                   .c_str(),
               stdout); // whether that could be written is asked at the end
}

std::string interrupted_text(const std::string& out) {
  return app::printable(
      fmt::format("interrupted: nothing was checked; {} has what was written before, without summary.json", out));
}

int say_interrupted(const std::string& text) {
  fmt::print("{}\n", text);
  std::fflush(stdout);
  return app::status_of_interrupted;
}

int run_experiment(const std::string& name, const std::string& out, bool quick) {
  const app::InterruptWatch watch(interrupted_text(out), app::status_of_interrupted);
  const auto say = [&](const std::string& line) {
    interruption_point();
    fmt::print("{}\n", app::printable(line));
    std::fflush(stdout);
  };
  std::vector<experiments::Check> checks;
  try {
    checks = experiments::run_experiment(name, out, quick, say);
  } catch (const Interrupted&) {
    return say_interrupted(interrupted_text(out));
  }
  std::size_t width = 5;
  for (const experiments::Check& check : checks)
    width = std::max(width, check.name.size());
  bool all_pass = true;
  fmt::print("\n{:<{}}  {:>12}     {:>10}\n", "check", width, "value", "bound");
  for (const experiments::Check& check : checks) {
    all_pass = all_pass && check.pass();
    fmt::print("{:<{}}  {:>12.5g}  {} {:>10.4g}  {}\n", check.name, width, check.value, check.relation, check.bound,
               check.pass() ? "pass" : "FAIL");
  }
  fmt::print("{}: {}; results in {}\n", name, all_pass ? "every check passed" : "a check FAILED", app::printable(out));
  return all_pass ? 0 : status_check_failed;
}

/// Cores of the machine that threads of a solve may have; the real-time loop keeps one for itself.
int default_threads(bool is_real_time) {
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  return std::clamp(is_real_time ? cores - 1 : cores, 1, 16);
}

/// What a command line that cannot be read has wrong: what nobody knows comes before what is missing, which may be no
/// more than a mistyped option.
std::string what_is_wrong(const CLI::App& commands, int argc, char** argv, const CLI::ParseError& error) {
  const CLI::App* at = &commands;
  std::string path = commands.get_name();
  for (int i = 1; i < argc && argv[i][0] != '-'; ++i) {
    const std::vector<const CLI::App*> below = at->get_subcommands([](const CLI::App*) { return true; });
    const auto named = [&](const CLI::App* command) { return command->get_name() == argv[i]; };
    const auto found = std::find_if(below.begin(), below.end(), named);
    if (below.empty())
      break;
    if (found == below.end())
      return fmt::format("unknown command '{}' ({} --help)", argv[i], path);
    at = *found;
    path += " " + at->get_name();
  }
  std::string options, arguments;
  for (const std::string& unknown : commands.remaining(true)) {
    std::string& text = unknown.size() > 1 && unknown.front() == '-' ? options : arguments;
    text += fmt::format("{}'{}'", text.empty() ? "" : ", ", unknown);
  }
  // An argument that is left over beside an unknown option may be its value.
  if (!options.empty())
    return fmt::format("unknown option {} ({} --help)", options, path);
  if (!arguments.empty())
    return fmt::format("unexpected argument {} ({} --help)", arguments, path);
  return fmt::format("{} ({} --help)", error.what(), path);
}

/// What a command says is its result where it writes no files. Said in vain it has failed, unless its reader has gone
/// and wants no more (a pipe to `head`).
int ended(int status) {
  std::fflush(stdout);
  if (std::ferror(stdout) == 0)
    return status;
  pollfd reader{STDOUT_FILENO, 0, 0};
  if (::poll(&reader, 1, 0) > 0 && (reader.revents & POLLERR) != 0)
    return status;
  const int failed = complain("the standard output cannot be written: a full disk?", status_bad_input);
  return status == 0 ? failed : status;
}

/// The stack of this thread grows where it is used: without memory that ends the program by a signal.
[[gnu::noinline]] void touch_stack() {
  std::array<volatile char, std::size_t{1} << 20U> pages; // of the 8 MB that there may be
  for (std::size_t at = 0; at < pages.size(); at += 4096)
    pages[at] = 0;
}

/// What libraries below would wait for for ever, or end the program by: told before there is anything to lose. Bodies
/// that are made beside the steps of a loop have threads of their own.
void require_resources(bool is_real_time) {
  touch_stack();
  std::thread([] {}).join();
  app::reserve_blas_memory(solvers::thread_count() + (is_real_time ? 4 : 1));
}

int run(int argc, char** argv) {
  if (argc > 1 && argv[1] == std::string_view("sweep"))
    app::become_sweep({argv + 2, argv + argc});
  CLI::App commands("Spherecut: pressing, cutting and tearing of soft tissue by the method of finite spheres",
                    "spherecut");
  commands.set_version_flag("--version", fmt::format("spherecut {}", app::version()));
  commands.require_subcommand(1);
  std::string scenario;
  std::string out;
  std::string name;
  bool quick = false;
  bool names_only = false;
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

  auto* experiment = commands.add_subcommand("experiment", "List or run the experiments");
  experiment->require_subcommand(1);
  auto* list = experiment->add_subcommand("list", "List the experiments");
  list->add_flag("--names", names_only, "Names alone");
  auto* run_one = experiment->add_subcommand("run", "Run one experiment");
  run_one->add_option("name", name, "Name, from the list")->required();
  run_one->add_option("--out", out, "Folder for tables, figures and summary.json; must not hold results yet")
      ->required()
      ->check(named);
  run_one->add_flag("--quick", quick, "Smaller variant");
  add_threads(run_one, "1, as times are compared");

  commands.add_subcommand("sweep", "Run a scenario over many values of its keys: one table, figures; sweep --help");

  auto* help = commands.add_subcommand("scenario-help", "Every key of a scenario file");
  bool markdown = false;
  help->add_flag("--markdown", markdown, "As the reference part of docs/scenario.md");

  try {
    commands.parse(argc, argv);
  } catch (const CLI::Success& success) { // --help, --version
    return ended(commands.exit(success));
  } catch (const CLI::ParseError& error) {
    return complain(what_is_wrong(commands, argc, argv, error), status_bad_input);
  }

  bool has_threads = false;
  for (const CLI::App* command : {run_command, haptics, serve, run_one})
    has_threads = has_threads || (command->parsed() && command->count("--threads") > 0);
  solvers::set_thread_count(has_threads         ? threads
                            : run_one->parsed() ? 1
                                                : default_threads(haptics->parsed() || serve->parsed()));

  if (!list->parsed() && !help->parsed())
    require_resources(haptics->parsed() || serve->parsed());
  if (run_command->parsed())
    return status_of(app::run_scenario(scenario, out, stdout));
  if (haptics->parsed())
    return status_of(app::run_haptics(haptic, stdout));
  if (serve->parsed())
    return status_of(app::serve(served, stdout));
  if (check->parsed())
    app::check_scenario(scenario, out, stdout);
  else if (list->parsed())
    list_experiments(names_only);
  else if (run_one->parsed())
    return run_experiment(name, out, quick);
  else
    std::fputs((markdown ? app::scenario_reference() : app::scenario_help()).c_str(), stdout);
  return ended(0);
}

} // namespace

namespace {

int end_in_words(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const Interrupted&) {
    return say_interrupted("interrupted before there was anything to keep");
  } catch (const std::filesystem::filesystem_error& error) {
    return complain(error.what(), status_bad_input);
  } catch (const InputError& error) {
    return complain(error.what(), status_bad_input);
  } catch (...) {
    return complain(what_failed(), status_numerical);
  }
}

/// Where no one else catches: an exception in a library's own thread, or before main() is reached.
[[noreturn]] void end_uncaught() {
  const std::string text =
      fmt::format("spherecut: error: {}\n",
                  app::printable(std::current_exception() != nullptr ? what_failed()
                                                                     : "unexpected: a library has ended the program"));
  if (::write(STDERR_FILENO, text.data(), text.size()) < 0)
    ::_exit(status_numerical);
  ::_exit(status_numerical);
}

// Before the constructors of the libraries: one of them makes threads there.
void before_libraries(int /*argc*/, char** /*argv*/, char** /*environment*/) {
  std::set_terminate(end_uncaught);
}
using Initialiser = void (*)(int, char**, char**);
[[gnu::section(".preinit_array"), gnu::used]] const Initialiser first_initialiser = before_libraries;

} // namespace

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN); // a run goes on when nobody reads its progress
  std::signal(SIGXFSZ, SIG_IGN); // a file over the limit is a disk that takes no more
  app::use_one_blas_thread();
  app::keep_freed_memory();
  const int status = end_in_words(argc, argv);
  if (status != status_numerical)
    return status;
  // Without memory or threads a library may wait in its destructors for what it never had.
  std::fflush(nullptr);
  ::_exit(status);
}
