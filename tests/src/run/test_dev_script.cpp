// ./dev as a user meets it, in a folder of its own beside programs that stand in for cmake and ninja.
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

const std::filesystem::path script = std::filesystem::path(SPHERECUT_SOURCE_DIR) / "dev";

void write_program(const std::filesystem::path& file, const std::string& text) {
  write_file(file, "#!/bin/sh\n" + text);
  std::filesystem::permissions(file, std::filesystem::perms::owner_all);
}

} // namespace

TEST_CASE("./dev refuses arguments that it has no use for") {
  const TemporaryFolder folder;
  std::filesystem::copy_file(script, folder.path() / "dev");
  const auto dev = [&](const std::string& arguments) {
    return run_shell("'" + (folder.path() / "dev").string() + "' " + arguments);
  };
  struct Case {
    std::string arguments, said;
  };
  const std::vector<Case> cases = {
      {"demo extra", "dev: demo: unexpected argument 'extra'; allowed: none\n"},
      {"demo --out here", "dev: demo: unexpected argument '--out'; allowed: none\n"},
      {"lint --dep", "dev: lint: unexpected argument '--dep'; allowed: --deep\n"},
      {"lint --deep topology", "dev: lint: unexpected argument 'topology'; allowed: --deep\n"},
      {"--help demo", "dev: --help: unexpected argument 'demo'; allowed: none\n"},
      {"coverage src", "dev: coverage: unexpected argument 'src'; allowed: topology, solvers\n"},
      {"coverage topology --all", "dev: coverage: unexpected argument '--all'; allowed: topology, solvers\n"},
  };
  for (const Case& c : cases) {
    const ProgramResult result = dev(c.arguments);
    CHECK(result.status == 2);
    CHECK(result.err == c.said);
    CHECK(result.out.empty());
  }
  CHECK(dev("--help").status == 0);
}

TEST_CASE("./dev coverage builds, runs and reports the groups that are asked for") {
  const TemporaryFolder folder;
  std::filesystem::copy_file(script, folder.path() / "dev");
  std::filesystem::create_directories(folder.path() / "bin");
  std::filesystem::create_directories(folder.path() / "build/coverage");
  write_file(folder.path() / "build/coverage/old.gcda", "of a run before");
  const std::string told = "echo \"$(basename \"$0\") $*\" >>told\n";
  for (const char* name : {"cmake", "ninja", "ctest"})
    write_program(folder.path() / "bin" / name, told);
  write_program(folder.path() / "bin/gcovr", told + "echo 'lines: 87.5% (7 out of 8)'\n");
  const auto dev = [&](const std::string& arguments) {
    std::filesystem::remove(folder.path() / "told");
    return run_shell("cd '" + folder.path().string() + "' && PATH=\"$PWD/bin:$PATH\" SPHERECUT_SKIP_PACKAGES=1 ./dev " +
                     arguments);
  };
  const ProgramResult both = dev("coverage");
  INFO(both.err);
  CHECK(both.status == 0);
  CHECK_THAT(both.out, Contains("topology: lines: 87.5%") && Contains("solvers: lines: 87.5%"));
  CHECK_FALSE(std::filesystem::exists(folder.path() / "build/coverage/old.gcda"));
  std::string told_of = read_file(folder.path() / "told");
  CHECK_THAT(told_of, Contains("cmake --preset coverage") && Contains("test_topology test_solvers test_elasticity"));
  CHECK_THAT(told_of, Contains("--label-regex ^(topology|solvers)$"));
  const ProgramResult one = dev("coverage topology");
  CHECK(one.status == 0);
  CHECK_THAT(one.out, Contains("topology: lines: 87.5%") && !Contains("solvers"));
  told_of = read_file(folder.path() / "told");
  CHECK_THAT(told_of, Contains("--label-regex ^(topology)$") && !Contains("test_solvers"));
}

TEST_CASE("./dev that is interrupted says so and ends with 130") {
  const TemporaryFolder folder;
  std::filesystem::copy_file(script, folder.path() / "dev");
  std::filesystem::create_directory(folder.path() / "bin");
  // As ninja under Ctrl-C: the signal comes to the whole group, as from a terminal, and the program takes it and fails.
  // Not at once: in the millisecond in which bash forks the rest of the pipeline it may end by the program's status.
  const std::string waits = "trap 'exit 2' INT\nsleep 0.3\nkill -INT 0\nsleep 60\n";
  write_program(folder.path() / "bin/cmake", "exit 0\n");
  const auto dev = [&](const std::string& arguments) {
    // In a group of its own, and with the signal as a terminal leaves it: a shell that was started with it ignored, as
    // in the background, cannot take it.
    return run_shell("cd '" + folder.path().string() + "' && PATH=\"$PWD/bin:$PATH\" SPHERECUT_SKIP_PACKAGES=1 " +
                     "env --default-signal=INT setsid --wait ./dev " + arguments);
  };
  const auto says_so = [](const ProgramResult& result) {
    INFO(result.err);
    CHECK(result.status == 130);
    CHECK_THAT(result.err, Contains("dev: interrupted\n") && !Contains("failed"));
  };
  write_program(folder.path() / "bin/ninja", waits);
  says_so(dev("build"));
  says_so(dev("demo"));
  write_program(folder.path() / "bin/ninja", "exit 0\n");
  write_program(folder.path() / "bin/ctest", waits);
  says_so(dev("test"));
  write_program(folder.path() / "bin/cmake", waits);
  says_so(dev("lint"));
  write_program(folder.path() / "bin/cmake", "exit 2\n");
  CHECK_THAT(dev("build").err, Contains("failed") && !Contains("interrupted"));
}
