#include "src/viewer/serve.hpp"

#include "src/base/interrupt.hpp"
#include "src/base/progress.hpp"
#include "src/viewer/hub.hpp"
#include "topology/base/errors.hpp"
#include "topology/base/interruption.hpp"

#include <array>
#include <fmt/format.h>
#include <malloc.h>
#include <spawn.h>
#include <unistd.h>

namespace spherecut::app {
namespace {

constexpr const char* default_scenario = "liver_live.toml";

std::filesystem::path program_folder() {
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  return error ? std::filesystem::path(".") : program.parent_path();
}

/// A folder of the program: beside it in a build tree, under share where it is installed; empty: neither.
std::filesystem::path folder_of(const char* name) {
  const std::filesystem::path program = program_folder();
  for (const std::filesystem::path& folder : {program / name, program / "../share/spherecut" / name})
    if (std::error_code error; std::filesystem::is_directory(folder, error))
      return std::filesystem::weakly_canonical(folder, error);
  return {};
}

std::filesystem::path scenario_of(const ServeCommand& command) {
  if (!command.scenario.empty())
    return command.scenario;
  const std::filesystem::path folder = folder_of("scenarios");
  if (folder.empty())
    throw InputError(fmt::format("the scenarios that come with this program are not where they belong ({}); give one "
                                 "by name",
                                 (program_folder() / "scenarios").string()));
  return folder / default_scenario;
}

/// Shows the page in the user's browser; false when there is no way to.
bool open_browser(const std::string& url) {
  std::string opener = "xdg-open";
  std::string address = url;
  const std::array<char*, 3> arguments{opener.data(), address.data(), nullptr};
  pid_t child = 0;
  return posix_spawnp(&child, opener.c_str(), nullptr, nullptr, arguments.data(), environ) == 0;
}

std::string url_of(const std::string& address, int port) {
  const bool any = address == "0.0.0.0" || address == "::";
  const bool brackets = address.find(':') != std::string::npos;
  const std::string host = any ? "localhost" : brackets ? "[" + address + "]" : address;
  return fmt::format("http://{}:{}/", host, port);
}

/// Sessions come and go, each with threads of its own. With an arena for every thread, and thresholds that grow with
/// what was freed, glibc keeps most of what the ones before had. So a server does not keep what it frees, as the other
/// commands do (process_settings.hpp).
void keep_memory_together() {
  mallopt(M_ARENA_MAX, 2);
  mallopt(M_MMAP_THRESHOLD, 1 << 20);  // bytes; also keeps it from growing
  mallopt(M_TRIM_THRESHOLD, 16 << 20); // bytes
}

} // namespace

RunEnd serve(const ServeCommand& command, std::FILE* screen) {
  keep_memory_together();
  const InterruptWatch watch("ended", 0);
  Progress progress(screen);
  const auto say = [&](const std::string& line) { progress.say(line); };
  const std::filesystem::path page = command.page.empty() ? folder_of("page") : command.page;
  if (std::error_code error; !command.page.empty() && !std::filesystem::is_directory(page, error))
    throw InputError(fmt::format("--page {}: there is no such folder", page.string()));

  HubOptions settings;
  settings.scenario = scenario_of(command);
  settings.recordings = command.out.empty() ? std::filesystem::path("out/serve") : command.out;
  std::unique_ptr<Hub> hub;
  WebServerOptions options;
  options.address = command.address;
  options.port = command.port;
  options.clients = settings.viewers;
  options.file = [&](std::string_view path) -> std::optional<std::filesystem::path> {
    static constexpr std::string_view recordings = "/recordings";
    if (path.substr(0, recordings.size() + 1) == "/recordings/")
      return file_below(settings.recordings, path.substr(recordings.size()));
    return page.empty() ? std::nullopt : file_below(page, path);
  };
  options.no_page = "The page is not built. ./dev build makes it (it needs node and npm), or give its folder with "
                    "--page. The WebSocket at /ws is open all the same.";
  WebServer* running = nullptr;
  WebServer::Handlers handlers;
  handlers.opened = [&](int client) { hub->opened(client); };
  handlers.message = [&](int client, std::string_view text) { return hub->message(client, text); };
  handlers.closed = [&](int client) { hub->closed(client); };
  handlers.tick = [&] {
    hub->tick();
    if (watch.interrupted())
      running->stop();
  };
  WebServer server(options, handlers); // before the session: a port in use is told at once
  running = &server;
  say(fmt::format("building the session of {}", settings.scenario.string()));
  try {
    hub = std::make_unique<Hub>(settings, say);
  } catch (const Interrupted&) {
    say("ended");
    return RunEnd::complete;
  }
  hub->attach(server);
  const std::string url = url_of(command.address, server.port());
  say(fmt::format("{} nodes, {} triangles; serving at {}", hub->session().nodes(),
                  hub->session().domain().surface().triangles.size(), url));
  if (page.empty())
    say("warning: " + options.no_page);
  say("Ctrl-C ends it");
  if (command.open && !open_browser(url))
    say("warning: no browser could be opened; go to " + url);
  server.run();
  say("ended");
  return RunEnd::complete;
}

} // namespace spherecut::app
