#include "src/run/sweep.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <unistd.h>

namespace spherecut::app {
namespace {

namespace fs = std::filesystem;

// Its first argument is the folder of the package, or nothing.
constexpr const char* hand_over = R"(
import sys
folder, arguments = sys.argv[1], sys.argv[2:]
if folder:
    sys.path.insert(0, folder)
try:
    from spherecut.sweep import main
except ImportError as error:
    print(f"spherecut: error: sweep: {sys.executable} cannot load the Python package spherecut: {error}; "
          "./dev python builds it, docs/python.md installs it", file=sys.stderr)
    sys.exit(2)
sys.exit(main(arguments))
)";

/// Beside the program in a build tree, below lib where it is installed; empty: neither.
fs::path package_folder(const fs::path& program) {
  std::vector<fs::path> places{program.parent_path() / "python"};
  std::error_code error;
  std::vector<fs::path> versions;
  for (fs::directory_iterator at(program.parent_path() / "../lib", error), end; !error && at != end;
       at.increment(error))
    if (at->path().filename().string().starts_with("python3"))
      versions.push_back(at->path());
  std::sort(versions.begin(), versions.end());
  for (const fs::path& version : versions)
    for (const char* name : {"dist-packages", "site-packages"})
      places.push_back(version / name);
  for (const fs::path& place : places)
    if (fs::exists(place / "spherecut/sweep/__init__.py", error))
      return fs::weakly_canonical(place, error);
  return {};
}

std::string interpreter() {
  const char* environment = std::getenv("VIRTUAL_ENV");
  for (const fs::path& python :
       {environment != nullptr ? fs::path(environment) / "bin/python3" : fs::path(), fs::path("/usr/bin/python3")})
    if (!python.empty() && ::access(python.c_str(), X_OK) == 0)
      return python.string();
  return "python3";
}

} // namespace

void become_sweep(const std::vector<std::string>& arguments) {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  ::setenv("SPHERECUT_COMMAND", program.c_str(), 1);
  std::vector<std::string> words{interpreter(), "-c", hand_over, package_folder(program).string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  pointers.reserve(words.size() + 1);
  for (std::string& word : words)
    pointers.push_back(word.data());
  pointers.push_back(nullptr);
  // What is ignored here would be ignored there, and by everything that is run from there.
  std::signal(SIGPIPE, SIG_DFL);
  std::signal(SIGXFSZ, SIG_DFL);
  ::execvp(pointers.front(), pointers.data());
  throw InputError(
      fmt::format("sweep: {} cannot be started: {}; studies need python3, numpy and snakemake (apt-get install "
                  "--no-install-recommends python3 python3-numpy snakemake)",
                  words.front(), std::strerror(errno)));
}

} // namespace spherecut::app
