// What disorder and ill will bring from outside: numbers without bound, texts without bottom, signals at any time, no
// threads, no memory, a terminal that obeys what it is shown.
#include "solvers/algebra/parallel.hpp"
#include "solvers/nodes/nodes.hpp"
#include "src/base/printable.hpp"
#include "src/scenario/keys.hpp"
#include "src/scenario/toml_limits.hpp"
#include "src/viewer/requests.hpp"
#include "tests/src/scenario_session.hpp"
#include "tests/src/scenario_text.hpp"
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"
#include "topology/base/regular_file.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <sys/stat.h>

using namespace spherecut;
using namespace spherecut::app;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

std::string many(const std::string& part, int count) {
  std::string text;
  for (int i = 0; i < count; ++i)
    text += part;
  return text;
}

/// Asks for the end of everything while it lives.
struct Interruption {
  Interruption() { request_interruption(); }
  ~Interruption() { withdraw_interruption(); }
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;
};

} // namespace

TEST_CASE("Every number of a scenario has two bounds, and none that must be positive may be next to nothing") {
  for (const ScenarioKey& key : scenario_keys()) {
    const bool numeric = key.kind == KeyKind::number || key.kind == KeyKind::integer || key.kind == KeyKind::vector ||
                         key.kind == KeyKind::points || key.kind == KeyKind::strain;
    if (!numeric)
      continue;
    INFO(key.path);
    CHECK(std::isfinite(key.range.lower));
    CHECK(std::isfinite(key.range.upper));
    CHECK_FALSE(key.range.lower_open);
    CHECK((key.range.lower <= 0 || key.range.lower >= 1e-12));
  }
}

TEST_CASE("A spacing next to nothing is refused by every way in, down to the sprinkling") {
  const std::string text = replaced(small_scenario, "fine_spacing = 0.004", "fine_spacing = 5e-324");
  CHECK_THROWS_WITH(scenario_of(text), Contains("nodes.fine_spacing") && Contains("out of range"));
  Scenario scenario = scenario_of(small_scenario);
  for (const double tiny : {5e-324, 1e-322, 1e-300, 1e-9}) {
    SettingsChange change;
    change.fine_spacing = tiny;
    CHECK_THROWS_AS(apply(change, scenario), InputError);
    Scenario forced = scenario;
    forced.nodes.fine_spacing = tiny;
    CHECK_THROWS_AS(Session(forced), InputError);
  }
  CHECK(scenario.nodes.fine_spacing == 0.004);
}

TEST_CASE("A text that would go through the bottom of its parser is refused before") {
  const auto refused = [](const std::string& text) {
    CHECK_THROWS_WITH(read_scenario_text("deep.toml", text), Contains("deep.toml:") && Contains("allowed"));
  };
  refused(many("a.", 40'000) + "a = 1\n");
  refused(many("\"a\" . ", 40'000) + "a = 1\n");
  refused("[" + many("a.", 40'000) + "a]\n");
  refused("[[" + many("'a'.", 40'000) + "a]]\n");
  refused("a = { " + many("b.", 40'000) + "b = 1 }\n");
  refused("a = " + many("[", 100'000) + "\n");
  refused("a = " + many("{a=", 100'000) + "\n");
  refused("# a\n\n" + many("a.", 20) + "a = 1\n");
  CHECK_THROWS_WITH(read_scenario_text("wide.toml", many("[[fixed]]\n", 20'000)), Contains("fixed: 20000 entries"));
  std::string keys;
  for (int i = 0; i < 5000; ++i)
    keys += "key" + std::to_string(i) + " = 1\n";
  CHECK_THROWS_WITH(read_scenario_text("keys.toml", keys), Contains("more"));
  CHECK_THROWS_WITH(read_scenario_text("long.toml", many("#\n", 3'000'000)), Contains("larger than"));
  // Dots and brackets that are none of keys and arrays.
  CHECK_NOTHROW(require_shallow_toml("title = \"" + many(".", 1000) + many("[", 1000) + "\" # " + many("a.", 1000) +
                                         "\na = [" + many("1.5, ", 1000) + "]\nb = '''\n" + many("[.", 500) +
                                         "'''\nc = \"\\\"" + many("[", 100) + "\"\n",
                                     "flat.toml"));
  CHECK(scenario_of(small_scenario).title == "small");
}

TEST_CASE("A terminal shows what it gets and obeys none of it") {
  CHECK(printable("plain, \tand a line\n") == "plain, \tand a line\n");
  CHECK(printable("\x1b]0;title\x07\x1b[2J") == "\\x1b]0;title\\x07\\x1b[2J");
  CHECK(printable("\r\b\x7f") == "\\x0d\\x08\\x7f");
  CHECK(printable("\xc2\x9b 31m") == "\\u009b 31m");             // a control sequence in one character
  CHECK(printable("\x9b 31m\xff") == "\\x9b 31m\\xff");          // and in one byte
  CHECK(printable("\xe2\x80\xae gnp.exe") == "\\u202e gnp.exe"); // turns the reading around
  const std::string text = "Leber \xc3\xa4\xe2\x82\xac\xf0\x9f\x98\x80";
  CHECK(printable(text) == text);
  CHECK(printable("\xc0\xaf\xed\xa0\x80\xf4\x90\x80\x80\xe2\x82") ==
        "\\xc0\\xaf\\xed\\xa0\\x80\\xf4\\x90\\x80\\x80\\xe2\\x82");
}

TEST_CASE("Neither error nor result of the command brings an escape sequence to the terminal") {
  const TemporaryFolder folder;
  const auto scenario = write_file(folder.path() / "s\x1b]0;x\x07.toml", small_scenario);
  const ProgramResult good = run_spherecut({"check", scenario});
  CHECK(good.status == 0);
  CHECK(good.out.find('\x1b') == std::string::npos);
  CHECK_THAT(good.out, Contains("\\x1b]0;x\\x07.toml: good"));
  const auto bad = write_file(folder.path() / "b.toml", "\"\\u001b[2J\" = 1\n");
  const ProgramResult refused = run_spherecut({"check", bad});
  CHECK(refused.status == 2);
  CHECK(refused.err.find('\x1b') == std::string::npos);
  CHECK_THAT(refused.err, Contains("\\x1b[2J"));
}

TEST_CASE("What is said in vain is told, unless its reader has gone") {
  const TemporaryFolder folder;
  const auto scenario = write_file(folder.path() / "s.toml", small_scenario);
  const std::vector<std::vector<std::string>> commands{
      {"check", scenario.string()}, {"scenario-help"}, {"experiment", "list"}, {"--help"}};
  for (const std::vector<std::string>& command : commands) {
    const ProgramResult full = run_shell(spherecut_command(command) + " >/dev/full");
    CHECK(full.status == 2);
    CHECK_THAT(full.err, Contains("standard output"));
  }
  const ProgramResult cut = run_shell("{ " + spherecut_command({"scenario-help"}) + "; echo $? >&2; } | true");
  CHECK(cut.err == "0\n");
}

TEST_CASE("A pipe or a device by a file's name is refused, and a file longer than allowed") {
  const TemporaryFolder folder;
  const auto file = write_file(folder.path() / "file", "12345");
  const auto read = [](const std::filesystem::path& from, std::uintmax_t most) {
    return topology::read_regular_file(from, most);
  };
  CHECK(read(file, 5) == "12345");
  CHECK_THROWS_WITH(read(file, 4), Contains("5 bytes") && Contains("at most 4"));
  CHECK(topology::start_of_regular_file(file, 3) == "123");
  const auto pipe = folder.path() / "pipe";
  REQUIRE(mkfifo(pipe.c_str(), 0600) == 0);
  CHECK_THROWS_WITH(read(pipe, 100), Contains("pipe"));
  CHECK(topology::start_of_regular_file(pipe, 3).empty());
  CHECK_THROWS_AS(read("/dev/zero", 100), InputError);
  CHECK(topology::start_of_regular_file("/dev/zero", 3).empty());
  CHECK_THROWS_WITH(read(folder.path() / "none", 100), Contains("no such file"));
  CHECK_THROWS_AS(read(folder.path(), 100), InputError);
}

TEST_CASE("Sprinkling, assembly, contact and loops in threads give up when they are told to") {
  const Scenario scenario = scenario_of(small_scenario);
  Session session(scenario);
  {
    const Interruption now;
    CHECK_THROWS_AS(interruption_point(), Interrupted);
    CHECK_THROWS_AS(Session(scenario), Interrupted);
    CHECK_THROWS_AS(session.prepare(session.steps().front()), Interrupted);
    solvers::SprinkleOptions options;
    options.spacing = session.zone().spacing;
    CHECK_THROWS_AS(solvers::sprinkle(*session.organ().domain, options), Interrupted);
    for (const int threads : {1, 2}) {
      solvers::set_thread_count(threads);
      CHECK_THROWS_AS(solvers::parallel_ranges(10, 1, [](int, int) {}), Interrupted);
      const WindingUp winding_up; // what is left to do is done all the same, in its threads too
      CHECK_NOTHROW(solvers::parallel_ranges(64, 1, [](int, int) { interruption_point(); }));
    }
    solvers::set_thread_count(1);
  }
  CHECK_NOTHROW(interruption_point());
  session.prepare(session.steps().front());
  CHECK(session.step(session.steps().back()).force.norm() > 0);
  const Interruption now;
  CHECK_THROWS_AS(session.step(session.steps().back()), Interrupted);
}

TEST_CASE("A signal ends a run that is still being built, and says so") {
  const TemporaryFolder folder;
  // 150,000 nodes: minutes to sprinkle, more to factor.
  const auto scenario =
      write_file(folder.path() / "s.toml", replaced(small_scenario, "fine_radius = 0.006", "count = 150000"));
  for (const std::string signal : {"INT", "TERM"}) {
    const auto out = folder.path() / signal;
    const std::string said = "'" + (folder.path() / ("said" + signal)).string() + "'";
    const ProgramResult result = run_shell(spherecut_command({"run", scenario.string(), "--out", out.string()}) + " >" +
                                           said + " & run=$!; until [ -d '" + out.string() +
                                           "' ]; do kill -0 $run || break; sleep 0.05; done; sleep 1; kill -" + signal +
                                           " $run; wait $run; status=$?; cat " + said + "; exit $status");
    INFO(result.out << result.err);
    CHECK(result.status == 130);
    CHECK_THAT(result.out, Contains("interrupted") && !Contains(" fixed\n")); // the body was never there
    CHECK((!std::filesystem::exists(out) || !std::filesystem::exists(out / "summary.json")));
  }
}

TEST_CASE("Where no thread can be made the command says so and ends, or goes on without") {
  const TemporaryFolder folder;
  const auto scenario = write_file(folder.path() / "s.toml", small_scenario);
  for (int threads = 0; threads < 6; ++threads) {
    const auto out = folder.path() / std::to_string(threads);
    const ProgramResult result =
        run_shell("LD_PRELOAD='" SPHERECUT_NO_THREADS "' SPHERECUT_THREADS=" + std::to_string(threads) + " " +
                  spherecut_command({"haptics", scenario.string(), "--duration", "0.5", "--solved-every", "0",
                                     "--threads", "2", "--out", out.string()}));
    INFO(threads << ": " << result.status << "\n" << result.out << result.err);
    CHECK((result.status == 0 || result.status == 3));
    if (result.status == 3)
      CHECK_THAT(result.err, Contains("thread"));
    else
      CHECK_THAT(result.out, Contains("results in"));
  }
}

TEST_CASE("Without memory the command says so and ends") {
  const TemporaryFolder folder;
  const auto scenario =
      write_file(folder.path() / "s.toml", replaced(small_scenario, "fine_radius = 0.006", "count = 2000"));
  bool told = false;
  for (const int megabytes : {150, 200, 250, 300, 350, 400}) { // from too little to start to enough for all
    const auto out = folder.path() / std::to_string(megabytes);
    const ProgramResult result = run_shell("ulimit -v " + std::to_string(1024 * megabytes) + "; timeout -s KILL 300 " +
                                           spherecut_command({"run", scenario.string(), "--out", out.string()}));
    INFO(megabytes << " MB: " << result.status << "\n" << result.out << result.err);
    CHECK(result.status != 137); // it would have gone on for ever
    told = told || (result.status == 3 && result.err.find("memory") != std::string::npos);
  }
  CHECK(told);
}
