#include "tests/support/served_program.hpp"

#include "tests/support/run_program.hpp"

#include <chrono>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace spherecut::tests {

ServedProgram::ServedProgram(const std::string& scenario) {
  const std::string file = write_file(folder_.path() / "served.toml", scenario).string();
  const std::string out = (folder_.path() / "out").string();
  const std::string said = (folder_.path() / "said").string();
  child_ = fork();
  if (child_ == 0) {
    const int log = open(said.c_str(), O_WRONLY | O_CREAT, 0600);
    dup2(log, 1);
    dup2(log, 2);
    execl(SPHERECUT_BINARY, SPHERECUT_BINARY, "serve", file.c_str(), "--port", "0", "--out", out.c_str(),
          static_cast<char*>(nullptr));
    _exit(127);
  }
  static constexpr const char* address = "http://127.0.0.1:";
  for (int i = 0; i < 6000 && port_ == 0 && waitpid(child_, nullptr, WNOHANG) == 0; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    const std::string text = read_file(said);
    if (const auto at = text.find(address);
        at != std::string::npos && text.find('/', at + std::strlen(address)) != std::string::npos)
      port_ = std::stoi(text.substr(at + std::strlen(address)));
  }
  if (port_ == 0) {
    kill(child_, SIGKILL);
    throw std::runtime_error("the server did not start: " + read_file(said));
  }
}

ServedProgram::~ServedProgram() {
  kill(child_, SIGKILL);
  waitpid(child_, nullptr, 0);
}

pid_t ServedProgram::thread(const std::string& name) const {
  for (const auto& entry : std::filesystem::directory_iterator("/proc/" + std::to_string(child_) + "/task")) {
    std::string line;
    std::getline(std::ifstream(entry.path() / "comm"), line);
    if (line == name)
      return std::stoi(entry.path().filename().string());
  }
  return 0;
}

Holdings ServedProgram::holdings() const {
  const std::string process = "/proc/" + std::to_string(child_);
  const auto entries = [&](const char* what) {
    const std::filesystem::directory_iterator folder(process + what);
    return static_cast<int>(std::distance(begin(folder), end(folder)));
  };
  Holdings result{entries("/fd"), entries("/task"), 0};
  std::ifstream status(process + "/status");
  for (std::string line; std::getline(status, line);)
    if (line.rfind("VmRSS:", 0) == 0)
      result.memory = std::stod(line.substr(6)) / 1024;
  return result;
}

} // namespace spherecut::tests
