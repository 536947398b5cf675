#include "src/apps/program.hpp"

#include "solvers/algebra/parallel.hpp"
#include "src/base/interrupt.hpp"
#include "src/base/printable.hpp"
#include "src/base/process_settings.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <fcntl.h>
#include <filesystem>
#include <fmt/core.h>
#include <poll.h>
#include <system_error>
#include <thread>
#include <unistd.h>
#include <vector>

namespace spherecut::program {
namespace {

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

/// The stack of this thread grows where it is used: without memory that ends the program by a signal.
[[gnu::noinline]] void touch_stack() {
  std::array<volatile char, std::size_t{1} << 20U> pages; // of the 8 MB that there may be
  for (std::size_t at = 0; at < pages.size(); at += 4096)
    pages[at] = 0;
}

/// Where somebody has closed input, output or error the next file that is opened would get its number, and what is said
/// would stand among the results.
void hold_standard_numbers() {
  for (int number = STDIN_FILENO; number <= STDERR_FILENO; ++number)
    if (::fcntl(number, F_GETFD) == -1 && errno == EBADF && ::open("/dev/null", O_RDWR) != number)
      ::_exit(status_bad_input);
}

int end_in_words(int argc, char** argv, int (*run)(int, char**)) {
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

int complain(const std::string& message, int status) {
  fmt::print(stderr, "spherecut: error: {}\n", app::printable(message));
  return status;
}

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

int say_interrupted(const std::string& text) {
  fmt::print("{}\n", text);
  std::fflush(stdout);
  return app::status_of_interrupted;
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

int threads_unless_told(int reserved) {
  return std::clamp(static_cast<int>(std::thread::hardware_concurrency()) - reserved, 1, 16);
}

std::string about_threads(const std::string& by_default) {
  return "Threads of a solve, 1 to 256; the results do not depend on it; default " + by_default;
}

int pass_on(const std::string& name, char** arguments) {
  const std::filesystem::path path = std::filesystem::read_symlink("/proc/self/exe").replace_filename(name);
  std::string file = path.string();
  std::vector<char*> all{file.data()};
  for (; *arguments != nullptr; ++arguments)
    all.push_back(*arguments);
  all.push_back(nullptr);
  ::execv(file.c_str(), all.data());
  return complain(fmt::format("{}: {}; ./dev build makes it", file, std::generic_category().message(errno)),
                  status_bad_input);
}

void require_resources(bool is_real_time) {
  touch_stack();
  std::thread([] {}).join();
  app::reserve_blas_memory(solvers::thread_count() + (is_real_time ? 4 : 1));
}

int start(int argc, char** argv, int (*run)(int, char**)) {
  hold_standard_numbers();
  std::signal(SIGPIPE, SIG_IGN); // a run goes on when nobody reads its progress
  std::signal(SIGXFSZ, SIG_IGN); // a file over the limit is a disk that takes no more
  app::use_one_blas_thread();
  app::keep_freed_memory();
  const int status = end_in_words(argc, argv, run);
  if (status != status_numerical)
    return status;
  // Without memory or threads a library may wait in its destructors for what it never had.
  std::fflush(nullptr);
  ::_exit(status);
}

} // namespace spherecut::program
