// The command line of the experiments, which `spherecut experiment` passes on to. Exit status as src/apps/main.cpp
// says.
#include "experiments/experiment.hpp"
#include "solvers/algebra/parallel.hpp"
#include "src/apps/program.hpp"
#include "src/base/interrupt.hpp"
#include "src/base/printable.hpp"
#include "src/run/run.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <fmt/core.h>

namespace {

using namespace spherecut;

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
    return program::say_interrupted(interrupted_text(out));
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
  return all_pass ? 0 : program::status_check_failed;
}

int run(int argc, char** argv) {
  CLI::App commands("List or run the experiments", "spherecut experiment");
  commands.require_subcommand(1);
  std::string out;
  std::string name;
  bool quick = false;
  bool names_only = false;
  int threads = 1;
  const auto named = [](const std::string& given) {
    return std::string(given.empty() ? "the name is empty; allowed: the name of a file or folder" : "");
  };
  auto* list = commands.add_subcommand("list", "List the experiments");
  list->add_flag("--names", names_only, "Names alone");
  auto* run_one = commands.add_subcommand("run", "Run one experiment");
  run_one->add_option("name", name, "Name, from the list")->required();
  run_one->add_option("--out", out, "Folder for tables, figures and summary.json; must not hold results yet")
      ->required()
      ->check(named);
  run_one->add_flag("--quick", quick, "Smaller variant");
  run_one->add_option(
      "--threads", threads,
      "Threads of a solve, 1 to 256; the results do not depend on it; default 1, as times are compared");
  try {
    commands.parse(argc, argv);
  } catch (const CLI::Success& success) { // --help
    return program::ended(commands.exit(success));
  } catch (const CLI::ParseError& error) {
    return program::complain(program::what_is_wrong(commands, argc, argv, error), program::status_bad_input);
  }
  solvers::set_thread_count(threads);
  if (list->parsed()) {
    list_experiments(names_only);
    return program::ended(0);
  }
  program::require_resources(false);
  return run_experiment(name, out, quick);
}

} // namespace

int main(int argc, char** argv) {
  return spherecut::program::start(argc, argv, run);
}
