// ./dev as a user meets it, in a folder of its own beside programs that stand in for cmake and ninja.
#include "tests/support/run_program.hpp"
#include "tests/support/temporary_folder.hpp"

#include <catch2/catch.hpp>

using namespace spherecut;
using namespace spherecut::tests;
using Catch::Contains;

namespace {

const std::filesystem::path script = std::filesystem::path(SPHERECUT_SOURCE_DIR) / "dev";

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
  };
  for (const Case& c : cases) {
    const ProgramResult result = dev(c.arguments);
    CHECK(result.status == 2);
    CHECK(result.err == c.said);
    CHECK(result.out.empty());
  }
  CHECK(dev("--help").status == 0);
}
