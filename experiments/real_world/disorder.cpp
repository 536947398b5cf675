// What comes from outside and is not what was asked for: every one of these is refused in words before any work hangs
// on it, and every long computation gives up when it is told to.
#include "experiments/real_world/live_situations.hpp"
#include "experiments/support/haptic_motions.hpp"
#include "solvers/nodes/nodes.hpp"
#include "src/base/output_file.hpp"
#include "src/base/printable.hpp"
#include "src/scenario/keys.hpp"
#include "src/viewer/requests.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"
#include "topology/base/regular_file.hpp"

#include <cmath>
#include <fmt/format.h>
#include <sys/stat.h>

namespace spherecut::experiments::real_world {
namespace {

/// 1 where `act` is refused in words.
template <typename Act>
int refused(const Act& act) {
  try {
    act();
  } catch (const InputError& error) {
    return std::string(error.what()).empty() ? 0 : 1;
  }
  return 0;
}

std::string many_times(const std::string& part, int count) {
  std::string text;
  for (int i = 0; i < count; ++i)
    text += part;
  return text;
}

double share_of_bounded_keys() {
  double bounded = 0, all = 0;
  for (const app::ScenarioKey& key : app::scenario_keys())
    if (key.kind == app::KeyKind::number || key.kind == app::KeyKind::integer || key.kind == app::KeyKind::vector ||
        key.kind == app::KeyKind::points || key.kind == app::KeyKind::strain) {
      ++all;
      bounded += std::isfinite(key.range.lower) && std::isfinite(key.range.upper) && !key.range.lower_open ? 1 : 0;
    }
  return bounded / all;
}

int refused_numbers() {
  app::Scenario scenario = haptic_block(haptic_motions().front(), solvers::Method::galerkin);
  int count = 0;
  for (const double tiny : {5e-324, 1e-322, 1e-300, 1e-9}) {
    app::SettingsChange change;
    change.fine_spacing = tiny;
    count += refused([&] { app::apply(change, scenario); });
    app::Scenario forced = scenario;
    forced.nodes.fine_spacing = tiny;
    count += refused([&] { const app::Session session(forced); });
  }
  return count;
}

int refused_texts() {
  const std::vector<std::string> texts{fmt::format("{}a = 1\n", many_times("a.", 40'000)),
                                       fmt::format("[{}a]\n", many_times("a.", 40'000)),
                                       fmt::format("a = {{ {}b = 1 }}\n", many_times("b.", 40'000)),
                                       fmt::format("a = {}\n", many_times("[", 100'000)),
                                       many_times("[[fixed]]\n", 20'000),
                                       many_times("#\n", 3'000'000)};
  int count = 0;
  for (const std::string& text : texts)
    count += refused([&] { static_cast<void>(app::read_scenario_text("text.toml", text)); });
  return count;
}

int refused_files(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  const std::filesystem::path pipe = folder / "pipe", link = folder / "endless", claimed = folder / "claimed";
  int count = ::mkfifo(pipe.c_str(), 0600) == 0 ? 0 : -10;
  std::filesystem::create_symlink("/dev/zero", link);
  for (const std::filesystem::path& file : {pipe, link, folder, folder / "none"})
    count += refused([&] { static_cast<void>(topology::read_regular_file(file, 1000)); });
  const app::ResultsClaim claim = app::claim_results_folder(claimed);
  count += refused([&] { static_cast<void>(app::claim_results_folder(claimed)); });
  std::filesystem::remove(pipe);
  std::filesystem::remove(link);
  return count;
}

/// Computations that give up when they are told to, of four.
int interrupted_computations() {
  const app::Scenario scenario = haptic_block(haptic_motions().front(), solvers::Method::galerkin);
  app::Session session(scenario);
  const auto gives_up = [](const auto& act) {
    request_interruption();
    int given_up = 0;
    try {
      act();
    } catch (const Interrupted&) {
      given_up = 1;
    }
    withdraw_interruption();
    return given_up;
  };
  int count = gives_up([&] { const app::Session another(scenario); });
  count += gives_up([&] {
    solvers::SprinkleOptions options;
    options.spacing = session.zone().spacing;
    static_cast<void>(solvers::sprinkle(*session.organ().domain, options));
  });
  count += gives_up([&] { session.prepare(session.steps().front()); });
  session.prepare(session.steps().front());
  count += gives_up([&] { static_cast<void>(session.step(session.steps().back())); });
  return count;
}

} // namespace

std::vector<Check> disorder(const ExperimentContext& context) {
  std::vector<Check> checks;
  const auto check = [&](const std::string& name, double value, double bound, const std::string& what) {
    checks.push_back({name, value, ">=", bound});
    context.say(fmt::format("{}: {:g} of {:g}", what, value, bound));
  };
  check("numbers_with_two_bounds", share_of_bounded_keys(), 1, "share of a scenario's numbers with two bounds");
  check("tiny_numbers_refused", refused_numbers(), 8, "spacings next to nothing refused");
  check("deep_texts_refused", refused_texts(), 6, "texts without bottom refused");
  check("odd_files_refused", refused_files(context.out / "files"), 5,
        "pipes, devices, folders and claimed folders refused");
  check("computations_interrupted", interrupted_computations(), 4, "computations that give up when they are told to");
  const std::string shown = app::printable("\x1b]0;x\x07\x1b[2J\r\xc2\x9b\xff");
  double control = 0;
  for (const char c : shown)
    control += static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) >= 0x7f ? 1 : 0;
  checks.push_back({"control_characters_shown", control, "<=", 0});
  return checks;
}

} // namespace spherecut::experiments::real_world
